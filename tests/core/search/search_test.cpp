#include "core/search/search.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/search/tree_search.h"
#include "core/simd/targets.h"
#include "tests/core/search/search_queries.h"
#include "tests/support/exhaustive_search.h"
#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

// What ManifoldSearch promises against the oracle.
constexpr double promised = 1e-5;

struct World {
  std::string name;
  std::vector<Manifold> manifolds;
  int queries;
};

/// Lists of manifolds of every shape that the searches must handle.
std::vector<World> worlds() {
  std::vector<World> all;
  std::mt19937 random(11);
  for (int degree = 1; degree <= 3; ++degree) {
    World curves{"closed curves of degree " + std::to_string(degree), {}, degree == 3 ? 150 : 2000};
    for (int i = 0; i < 12; ++i)
      curves.manifolds.push_back(synthetic::smooth_curve(24, 12, degree, random, i % 2 == 1));
    all.push_back(std::move(curves));
  }
  World open{"open curves", {}, 1000};
  for (int i = 0; i < 10; ++i)
    open.manifolds.push_back(
        synthetic::smooth_manifold({synthetic::axis("x", 5 + i, false, i % 2 == 1, random)}, 7, 2, random));
  all.push_back(std::move(open));
  for (int m = 2; m <= 4; ++m)
    for (int degree = 2; degree <= (m == 2 ? 3 : 2); ++degree) {
      World world{"m=" + std::to_string(m) + " degree " + std::to_string(degree),
                  {},
                  m == 2   ? 40
                  : m == 3 ? 6
                           : 3};
      const int samples[] = {10, m == 4 ? 4 : 6, 4, 3};
      for (int i = 0; i < (m == 2 ? 3 : m == 3 ? 2 : 1); ++i) {
        std::vector<SampleAxis> axes;
        for (int a = 0; a < m; ++a)
          axes.push_back(synthetic::axis("q" + std::to_string(a), samples[a], a == 0, i == 1, random));
        world.manifolds.push_back(synthetic::smooth_manifold(axes, 8, degree, random, 2));
      }
      all.push_back(std::move(world));
    }
  // Different numbers of DOFs in one list, one of them constant.
  World mixed{"mixed DOFs", {}, 60};
  mixed.manifolds.push_back(synthetic::smooth_curve(12, 8, 2, random));
  mixed.manifolds.push_back(synthetic::smooth_manifold(
      {synthetic::axis("table", 12, true, false, random), synthetic::axis("light", 4, false, false, random)},
      8, 2, random, 3));
  mixed.manifolds.push_back(synthetic::smooth_manifold(
      {synthetic::axis("table", 12, true, false, random), synthetic::axis("light", 1, true, false, random)},
      8, 2, random, 3));
  mixed.manifolds.push_back(
      synthetic::smooth_manifold({synthetic::axis("light", 1, true, false, random)}, 8, 2, random));
  all.push_back(std::move(mixed));
  return all;
}

class EverySearch : public ::testing::TestWithParam<const char*> {};

TEST_P(EverySearch, GivesTheAnswerOfTheOracle) {
  for (const World& world : worlds()) {
    SCOPED_TRACE(world.name);
    const ExhaustiveSearch oracle(world.manifolds);
    const auto search = make_search(GetParam(), world.manifolds);
    std::mt19937 random(5);
    for (int i = 0; i < world.queries; ++i) {
      const synthetic::Query query = synthetic::random_query(world.manifolds, random);
      const auto expected = oracle.nearest(query.point, 2);
      const auto found = search->nearest(query.point, 2);
      ASSERT_EQ(found.size(), expected.size()) << query.kind << " query " << i;
      for (std::size_t k = 0; k < found.size(); ++k) {
        ASSERT_NEAR(found[k].distance, expected[k].distance, promised) << query.kind << " query " << i;
        if (expected.size() > 1 && expected[1].distance - expected[0].distance > 2.0 * promised) {
          ASSERT_EQ(found[k].manifold, expected[k].manifold) << query.kind << " query " << i;
        }
        // The distance reported is that of the place reported.
        const Manifold& f = world.manifolds[found[k].manifold];
        ASSERT_NEAR((f.evaluate(found[k].q) - query.point.cast<double>()).norm(), found[k].distance, 1e-9);
      }
    }
  }
}

TEST_P(EverySearch, LeavesOutWhatIsBeyondTheBound) {
  std::mt19937 random(6);
  std::vector<Manifold> manifolds;
  for (int i = 0; i < 20; ++i) manifolds.push_back(synthetic::smooth_curve(18, 10, 2, random));
  const auto search = make_search(GetParam(), manifolds);
  for (int i = 0; i < 300; ++i) {
    const auto query = synthetic::random_query(manifolds, random);
    const auto all = search->nearest(query.point, 2);
    ASSERT_EQ(all.size(), 2U);
    const double between = 0.5 * (all[0].distance + all[1].distance);
    const auto one = search->nearest(query.point, 2, between);
    if (all[1].distance - all[0].distance > 1e-6) {
      ASSERT_EQ(one.size(), 1U);
      EXPECT_EQ(one[0].manifold, all[0].manifold);
      EXPECT_EQ(one[0].distance, all[0].distance);
    }
    if (all[0].distance > 1e-6) {
      EXPECT_TRUE(search->nearest(query.point, 2, 0.99 * all[0].distance).empty());
    }
    EXPECT_EQ(search->nearest(query.point, 50).size(), 20U);
    EXPECT_TRUE(search->nearest(query.point, 0).empty());
  }
}

TEST_P(EverySearch, NamesTheFirstOfTwoEqualManifolds) {
  std::mt19937 random(8);
  std::vector<Manifold> manifolds;
  for (int i = 0; i < 3; ++i) manifolds.push_back(synthetic::smooth_curve(20, 6, 2, random));
  const Manifold twin = manifolds[1];
  manifolds.push_back(twin);
  const auto search = make_search(GetParam(), manifolds);
  for (int i = 0; i < 200; ++i) {
    const double q = 1.8 * i;
    const Eigen::VectorXf point = twin.evaluate({{q}}).cast<float>() + Eigen::VectorXf::Constant(6, 1e-3F);
    const auto found = search->nearest(point, 2);
    ASSERT_EQ(found.size(), 2U);
    EXPECT_EQ(found[0].manifold, 1U);
    EXPECT_EQ(found[1].manifold, 3U);
    EXPECT_EQ(found[0].distance, found[1].distance);
    EXPECT_EQ(found[0].q, found[1].q);
  }
}

TEST_P(EverySearch, FindsAManifoldThatIsASinglePoint) {
  // An object whose appearance does not change: every view is the same.
  const SampleAxis table{Dof{"table", "deg", 0.0, 360.0, true}, {0.0, 90.0, 180.0, 270.0}};
  const Eigen::VectorXd place = Eigen::VectorXd::LinSpaced(5, 0.1, 0.5);
  std::vector<Manifold> manifolds = {Manifold::interpolate({table}, place.replicate(1, 4))};
  const auto search = make_search(GetParam(), manifolds);
  const auto found = search->nearest(Eigen::VectorXf::Zero(5));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].distance, place.norm(), 1e-12);
}

TEST_P(EverySearch, EndsWhereAManifoldFillsItsSpace) {
  // More DOFs than dimensions: a point inside is met on whole curves of places.
  std::mt19937 random(12);
  std::vector<SampleAxis> axes = {synthetic::axis("a", 8, true, false, random)};
  axes.push_back(synthetic::axis("b", 4, false, false, random));
  axes.push_back(synthetic::axis("c", 4, false, false, random));
  const std::vector<Manifold> manifolds = {synthetic::smooth_manifold(axes, 2, 2, random, 2)};
  const auto search = make_search(GetParam(), manifolds);
  const Eigen::VectorXf inside = manifolds[0].evaluate({{100.0, 1.3, 0.7}}).cast<float>();
  ASSERT_EQ(search->nearest(inside).size(), 1U);
  EXPECT_LT(search->nearest(inside)[0].distance, promised);
}

TEST_P(EverySearch, RefusesAPointOfAnotherSize) {
  std::mt19937 random(9);
  const std::vector<Manifold> manifolds = {synthetic::smooth_curve(8, 5, 2, random)};
  EXPECT_THROW((void)make_search(GetParam(), manifolds)->nearest(Eigen::VectorXf::Zero(6)),
               std::invalid_argument);
}

TEST_P(EverySearch, RefusesAnEmptyListAndUnequalDimensions) {
  std::mt19937 random(9);
  const std::vector<Manifold> manifolds = {synthetic::smooth_curve(8, 5, 2, random),
                                           synthetic::smooth_curve(8, 6, 2, random)};
  EXPECT_THROW(make_search(GetParam(), {}), std::invalid_argument);
  EXPECT_THROW(make_search(GetParam(), manifolds), std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(Kinds, EverySearch, ::testing::Values("tree", "flann", "slab"),
                         [](const auto& kind) { return std::string(kind.param); });

TEST(Search, NamesTheKindsThatThereAre) {
  std::mt19937 random(9);
  const std::vector<Manifold> manifolds = {synthetic::smooth_curve(8, 5, 2, random)};
  EXPECT_EQ(make_search(manifolds)->name(), "tree");
  try {
    make_search("forest", manifolds);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), ::testing::AllOf(::testing::HasSubstr("forest"), ::testing::HasSubstr("tree")));
  }
}

TEST(TreeSearch, AnswersAlikeWithEveryInstructionSet) {
  std::mt19937 random(17);
  std::vector<Manifold> manifolds;
  for (int i = 0; i < 60; ++i) manifolds.push_back(synthetic::smooth_curve(36, 21, 2, random));
  const TreeSearch search(manifolds);
  for (int i = 0; i < 2000; ++i) {
    const auto query = synthetic::random_query(manifolds, random);
    ClosestPoint a[2];
    const std::size_t count = search.nearest_into(query.point, a);
    for (const std::string& name : simd_targets()) {
      const OnlySimdTarget only(name);
      ClosestPoint b[2];
      ASSERT_EQ(search.nearest_into(query.point, b), count) << name;
      for (int k = 0; k < 2; ++k) {
        ASSERT_EQ(a[k].manifold, b[k].manifold) << name;
        ASSERT_EQ(a[k].q, b[k].q) << name;
        ASSERT_EQ(a[k].distance, b[k].distance) << name;
      }
    }
  }
}

}  // namespace
}  // namespace eigenpose
