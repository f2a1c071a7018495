#include "core/search/pattern_rejector.h"

#include <random>
#include <set>

#include <gtest/gtest.h>

#include "tests/core/search/search_queries.h"
#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

std::vector<Manifold> curves(int count, std::mt19937& random) {
  std::vector<Manifold> list;
  list.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) list.push_back(synthetic::smooth_curve(24, 16, 2, random, i % 3 == 0));
  return list;
}

TEST(PatternRejector, NeverChangesAnAnswer) {
  std::mt19937 random(31);
  std::vector<Manifold> list = curves(60, random);
  list.push_back(synthetic::smooth_manifold(
      {synthetic::axis("table", 8, true, false, random), synthetic::axis("x", 4, false, true, random)}, 16, 2,
      random, 2));
  list.push_back(synthetic::smooth_curve(9, 16, 3, random));
  for (double distance : {0.01, 0.1, 0.4}) {
    RejectorOptions options;
    options.distance = distance;
    const RejectionSearch rejecting(list, options);
    const auto tree = make_search(list);
    std::size_t found = 0;
    for (int i = 0; i < 4000; ++i) {
      const auto query = synthetic::random_query(list, random);
      const auto expected = tree->nearest(query.point, 2, distance);
      const auto answer = rejecting.nearest(query.point, 2);
      ASSERT_EQ(answer.size(), expected.size()) << query.kind;
      found += answer.size();
      for (std::size_t k = 0; k < answer.size(); ++k) {
        ASSERT_EQ(answer[k].manifold, expected[k].manifold);
        // Patches are solved to 1e-7.
        ASSERT_NEAR(answer[k].distance, expected[k].distance, 2e-7);
      }
    }
    EXPECT_GT(found, 1000U);
  }
}

TEST(PatternRejector, KeepsEveryPatchOnTheEdgeOfTheDistance) {
  // Points exactly T away from a place of a curve, in random directions: its patch survives.
  std::mt19937 random(32);
  const std::vector<Manifold> list = curves(30, random);
  const PatchSet patches(list);
  RejectorOptions options;
  options.distance = 0.08;
  const PatternRejector rejector(patches, options);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 5000; ++i) {
    const std::size_t patch = std::uniform_int_distribution<std::size_t>(0, patches.size() - 1)(random);
    PatchPoint place{patches.manifold_of(patch), static_cast<std::uint32_t>(patch), {}, 0.0};
    place.u[0] = std::uniform_real_distribution<double>(0.0, 1.0)(random);
    const auto q = patches.position(place);
    Eigen::VectorXd away(16);
    for (Eigen::Index k = 0; k < 16; ++k) away[k] = normal(random);
    const Eigen::VectorXd point =
        list[place.manifold].evaluate({q.data(), 1}) + options.distance * away.normalized();
    const auto survivors = rejector.survivors(point.data());
    ASSERT_NE(std::find(survivors.begin(), survivors.end(), patch), survivors.end());
  }
}

TEST(PatternRejector, RejectsMostOfThePatches) {
  std::mt19937 random(33);
  const std::vector<Manifold> list = curves(100, random);
  RejectorOptions options;
  options.distance = 0.05;
  const RejectionSearch search(list, options);
  std::size_t kept = 0;
  for (int i = 0; i < 500; ++i) {
    const auto query = synthetic::random_query(list, random);
    const Eigen::VectorXd point = query.point.cast<double>();
    kept += search.rejector().survivors(point.data()).size();
  }
  // Effectiveness: on average less than a tenth of the classes is left to look at.
  EXPECT_LT(static_cast<double>(kept) / 500.0, 0.1 * static_cast<double>(search.patches()));
}

TEST(PatternRejector, EachBoundOfItsOptionsEndsTheDivision) {
  std::mt19937 random(35);
  const std::vector<Manifold> list = curves(40, random);
  const PatchSet patches(list);
  const auto components_with = [&](const auto& change) {
    RejectorOptions options;
    options.distance = 0.05;
    change(options);
    return PatternRejector(patches, options).components();
  };
  const std::size_t usual = components_with([](RejectorOptions&) {});
  EXPECT_GT(usual, 50U);
  EXPECT_EQ(components_with([](RejectorOptions& options) { options.max_depth = 0; }), 1U);
  const std::size_t one_level = components_with([](RejectorOptions& options) { options.max_depth = 1; });
  EXPECT_GT(one_level, 2U);
  EXPECT_LE(one_level, 1 + RejectorOptions{}.cells) << "the root and its cells";
  EXPECT_EQ(components_with([&](RejectorOptions& options) { options.small_set = patches.size(); }), 1U);
  EXPECT_EQ(components_with([](RejectorOptions& options) { options.worthwhile = 0.0; }), 1U);
  EXPECT_EQ(components_with([](RejectorOptions& options) { options.max_growth = 0.5; }), 1U);
  EXPECT_LE(components_with([](RejectorOptions& options) {
              options.cells = 2;
              options.max_depth = 1;
            }),
            3U);
}

TEST(PatternRejector, RefusesOptionsOutOfRange) {
  std::mt19937 random(34);
  const std::vector<Manifold> list = curves(2, random);
  RejectorOptions options;
  options.distance = 0.0;
  EXPECT_THROW(RejectionSearch(list, options), std::invalid_argument);
  options = {};
  options.cells = 1;
  EXPECT_THROW(RejectionSearch(list, options), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
