#include "core/search/patch_set.h"

#include <random>

#include <gtest/gtest.h>

#include "core/search/best_list.h"
#include "core/search/sample_cloud.h"
#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

/// Curves of every degree, and a surface.
std::vector<Manifold> manifolds() {
  std::mt19937 random(21);
  std::vector<Manifold> list;
  for (const int degree : {1, 2, 3}) list.push_back(synthetic::smooth_curve(12, 8, degree, random, true));
  list.push_back(synthetic::smooth_manifold(
      {synthetic::axis("a", 6, true, false, random), synthetic::axis("b", 4, false, true, random)}, 8, 2,
      random, 2));
  return list;
}

/// A place in a patch; of axes that are constant, 0.
PatchPoint place_in(const PatchSet& patches, std::size_t patch, std::mt19937& random) {
  PatchPoint place;
  place.manifold = patches.manifold_of(patch);
  place.patch = static_cast<std::uint32_t>(patch);
  const Manifold& f = patches.manifolds()[place.manifold];
  for (std::size_t a = 0; a < f.dofs(); ++a)
    if (f.bases()[a].degree() > 0) place.u[a] = std::uniform_real_distribution<double>(0.0, 1.0)(random);
  return place;
}

Eigen::VectorXd value_at(const PatchSet& patches, const PatchPoint& place) {
  const Manifold& f = patches.manifolds()[place.manifold];
  const auto q = patches.position(place);
  return f.evaluate(std::span(q).first(f.dofs()));
}

TEST(PatchSet, HasAPatchForEverySegment) {
  const auto list = manifolds();
  const PatchSet patches(list);
  std::size_t expected = 0;
  for (const Manifold& f : list) {
    std::size_t own = 1;
    for (const AxisBasis& basis : f.bases()) own *= basis.segments();
    expected += own;
  }
  EXPECT_EQ(patches.size(), expected);
}

TEST(PatchSet, MeasuresTheDistanceToAPlace) {
  const auto list = manifolds();
  const PatchSet patches(list);
  std::mt19937 random(22);
  const Eigen::VectorXd point = Eigen::VectorXd::LinSpaced(8, -0.3, 0.4);
  for (std::size_t p = 0; p < patches.size(); ++p) {
    const PatchPoint place = place_in(patches, p, random);
    EXPECT_NEAR(patches.distance(place, point.data()), (point - value_at(patches, place)).norm(), 1e-12);
  }
}

TEST(PatchSet, FindsAPointOfThePatchNoFartherThanAnySample) {
  const auto list = manifolds();
  const PatchSet patches(list);
  std::mt19937 random(23);
  for (std::size_t p = 0; p < patches.size(); ++p) {
    const Eigen::VectorXd point = 0.3 * synthetic::random_matrix(8, 1, random);
    PatchPoint found;
    const bool any = patches.closest(p, point.data(), 1e9, found);
    double sampled = 1e9;
    for (int i = 0; i < 300; ++i)
      sampled = std::min(sampled, (point - value_at(patches, place_in(patches, p, random))).squaredNorm());
    const bool curve = patches.shape(p).axes == 1;
    if (curve) {
      ASSERT_TRUE(any) << p;
    }
    if (!any) continue;  // on a surface, a neighbour certainly comes nearer
    EXPECT_LE(found.squared_distance, sampled + 1e-6);
    EXPECT_NEAR(found.squared_distance, (point - value_at(patches, found)).squaredNorm(), 1e-9);
    PatchPoint none;
    EXPECT_FALSE(patches.closest(p, point.data(), 0.99 * found.squared_distance, none));
  }
}

TEST(SampleCloud, ReachesFromItsSamplesToEveryPointOfTheManifolds) {
  const auto list = manifolds();
  const PatchSet patches(list);
  const SampleCloud cloud(patches);
  std::mt19937 random(24);
  for (std::size_t p = 0; p < patches.size(); ++p)
    for (int i = 0; i < 20; ++i) {
      const Eigen::VectorXd point = value_at(patches, place_in(patches, p, random));
      bool reached = false;
      for (std::size_t s = 0; s < cloud.size() && !reached; ++s) {
        if (cloud.patch(s) != p) continue;
        const Eigen::Map<const Eigen::VectorXf> sample(cloud.point(s).data(), 8);
        reached = (point - sample.cast<double>()).norm() <= cloud.reach(s);
      }
      EXPECT_TRUE(reached) << "patch " << p;
    }
  double largest = 0.0;
  for (std::size_t s = 0; s < cloud.size(); ++s) largest = std::max(largest, cloud.reach(s));
  EXPECT_EQ(largest, cloud.largest_reach());
}

PatchPoint at(std::uint32_t manifold, double squared) {
  PatchPoint point;
  point.manifold = manifold;
  point.squared_distance = squared;
  return point;
}

TEST(BestList, KeepsTheNearestPointOfEachManifoldInOrder) {
  PatchPoint slots[3];
  BestList best(slots, 10.0);
  EXPECT_EQ(best.cut(), 100.0) << "the bound, squared, until the list is full";
  best.offer(at(4, 9.0));
  best.offer(at(2, 4.0));
  best.offer(at(4, 16.0));  // farther than what is known of 4
  best.offer(at(4, 1.0));   // nearer
  ASSERT_EQ(best.found().size(), 2U);
  EXPECT_EQ(best.found()[0].manifold, 4U);
  EXPECT_EQ(best.found()[1].manifold, 2U);
  EXPECT_EQ(best.cut(), 100.0);
  best.offer(at(7, 25.0));
  EXPECT_EQ(best.cut(), 25.0);
  best.offer(at(8, 36.0));  // beyond the last of a full list
  EXPECT_EQ(best.found()[2].manifold, 7U);
  best.offer(at(9, 2.0));
  EXPECT_EQ(best.found()[1].manifold, 9U);
  EXPECT_EQ(best.found()[2].manifold, 2U);
  EXPECT_EQ(best.cut(), 4.0);
}

TEST(BestList, PutsTheFirstOfEquallyNearManifoldsFirstWhateverTheOrderOfOffers) {
  for (const bool reversed : {false, true}) {
    PatchPoint slots[2];
    BestList best(slots, 10.0);
    for (const std::uint32_t m : reversed ? std::array{5U, 3U, 1U} : std::array{1U, 3U, 5U})
      best.offer(at(m, 4.0));
    EXPECT_EQ(best.found()[0].manifold, 1U);
    EXPECT_EQ(best.found()[1].manifold, 3U);
  }
}

}  // namespace
}  // namespace eigenpose
