#include "core/subspace/orthogonalization.h"

#include <gtest/gtest.h>

#include "core/base/linear_algebra.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solver.h"
#include "tests/core/subspace/subspace_samples.h"
#include "tests/support/byte_source.h"
#include "tests/support/dense_solver.h"

namespace eigenpose {
namespace {

constexpr std::size_t kObjectLength = 300;

/// Three objects' views as bytes.
struct Objects {
  std::vector<std::uint8_t> mug = test::smooth_views(50, kObjectLength, 1);
  std::vector<std::uint8_t> duck = test::smooth_views(36, kObjectLength, 2);
  std::vector<std::uint8_t> car = test::smooth_views(72, kObjectLength, 3);
};

TEST(Orthogonalize, SpansWhatTheGivenSubspacesSpan) {
  const Eigen::MatrixXf all = test::views_of_rank(80, 40, 12, 9);
  const Eigenspace whole = test::dense_eigenspace(FloatSource(all), 9);
  // Two overlapping parts of one basis: columns 0…5 and 4…8.
  const std::vector<Eigen::MatrixXf> parts{whole.basis.leftCols(6), whole.basis.rightCols(5)};
  const OrthogonalizedBasis result = orthogonalize(parts, 1e-3);
  ASSERT_EQ(result.basis.cols(), 9);
  EXPECT_LT(test::largest_angle_deg(result.basis, whole.basis), 1e-3);  // float bases
  // Shared directions have σ = √2, single ones 1, and two of the eleven columns are no directions.
  EXPECT_NEAR(result.singular_values[0], std::sqrt(2.0), 1e-5);
  EXPECT_NEAR(result.singular_values[1], std::sqrt(2.0), 1e-5);
  EXPECT_NEAR(result.singular_values[2], 1.0, 1e-5);
  EXPECT_LT(result.singular_values[9], 1e-5);
}

TEST(Orthogonalize, DropsDirectionsBelowTau) {
  Eigen::MatrixXf a = Eigen::MatrixXf::Zero(10, 1), b = a;
  a(0, 0) = 1.0F;
  b(0, 0) = std::cos(0.02F);
  b(1, 0) = std::sin(0.02F);
  const std::vector<Eigen::MatrixXf> pair{a, b};
  // Two vectors at an angle of 0.02: singular values √(1 ± cos 0.02), the small one 0.0141.
  EXPECT_EQ(orthogonalize(pair, 0.013).basis.cols(), 2);
  EXPECT_EQ(orthogonalize(pair, 0.015).basis.cols(), 1);
}

TEST(Orthogonalize, HoldsEveryObjectsEigenspace) {
  const Objects objects;
  std::vector<Eigenspace> spaces;
  spaces.reserve(3);
  std::vector<const std::vector<std::uint8_t>*> sets{&objects.mug, &objects.duck, &objects.car};
  for (const auto* bytes : sets) {
    spaces.push_back(solve_eigenspace(ByteSource(*bytes, kObjectLength), {.components = 4}));
  }
  const Eigenspace joint = orthogonalize(std::span<const Eigenspace>(spaces));
  EXPECT_LE(joint.components(), 3 * 4 + 2);
  for (const Eigenspace& space : spaces) {
    // A point of the object's space goes through the joint space and comes back, up to float rounding and
    // tau.
    const Eigen::VectorXf view = space.mean + space.basis * Eigen::VectorXf::LinSpaced(4, 0.3F, 0.1F);
    EXPECT_LT((joint.mean + joint.basis * joint.project(view) - view).norm(), 2e-3F);
  }
  for (Eigen::Index k = 1; k < joint.components(); ++k)
    EXPECT_GE(joint.eigenvalues[k - 1], joint.eigenvalues[k]);
}

ScatterFactor all_of(const Eigen::MatrixXd& views) {
  ScatterFactor result;
  result.mean = views.rowwise().mean();
  result.factor = views.colwise() - result.mean;
  result.views = static_cast<std::size_t>(views.cols());
  result.total_scatter = result.factor.squaredNorm();
  return result;
}

TEST(ScatterFactor, JoinsAboutTheCommonMean) {
  const Eigen::MatrixXd views = test::views_of_rank(30, 60, 20, 3).cast<double>();
  const ScatterFactor whole = all_of(views);
  ScatterFactor joined = all_of(views.leftCols(11));
  join(joined, all_of(views.middleCols(11, 40)));
  join(joined, all_of(views.rightCols(9)));
  EXPECT_EQ(joined.views, 60U);
  EXPECT_LT((joined.mean - whole.mean).norm(), 1e-14);
  EXPECT_NEAR(joined.total_scatter, whole.total_scatter, 1e-12);
  EXPECT_LT((joined.factor * joined.factor.transpose() - whole.factor * whole.factor.transpose()).norm(),
            1e-12);
  EXPECT_THROW(join(joined, all_of(Eigen::MatrixXd::Identity(7, 3))), std::invalid_argument);
}

TEST(ScatterFactor, LeavesOutOfAJoinedWholeWhatWasLeftOutOfItsParts) {
  const Eigen::MatrixXd views = test::views_of_rank(30, 60, 20, 3).cast<double>();
  const ScatterFactor whole = all_of(views);
  std::vector<ScatterFactor> parts{all_of(views.leftCols(25)), all_of(views.rightCols(35))};
  double bound = 0.0;
  double rest = 0.0;
  for (ScatterFactor& part : parts) {
    orthogonalize(part, 0.05 * part.total_scatter, 2);
    ASSERT_GT(part.rest_bound, 0.0);
    bound += part.rest_bound;
    rest += part.rest();
  }
  ScatterFactor joined;
  for (const ScatterFactor& part : parts) join(joined, part);
  EXPECT_DOUBLE_EQ(joined.rest_bound, bound);
  EXPECT_NEAR(joined.rest(), rest, 1e-12);
  const Eigen::MatrixXd missing =
      whole.factor * whole.factor.transpose() - joined.factor * joined.factor.transpose();
  EXPECT_LE(symmetric_eigen(missing).values[0], joined.rest_bound + 1e-12);
}

TEST(ScatterFactor, LeavesOutNoMoreThanIsSpare) {
  ScatterFactor views = all_of(test::views_of_rank(50, 40, 12, 6).cast<double>());
  const Eigen::MatrixXd before = views.factor * views.factor.transpose();
  const double spare = 0.02 * views.total_scatter;
  orthogonalize(views, spare, 2);
  EXPECT_LT(views.factor.cols(), 12);
  EXPECT_LE(views.rest(), spare);
  EXPECT_GT(views.rest(), 0.0);
  const Eigen::MatrixXd products = views.factor.transpose() * views.factor;
  EXPECT_LT((products - Eigen::MatrixXd(products.diagonal().asDiagonal())).norm(), 1e-12);
  const Eigen::MatrixXd rest = before - views.factor * views.factor.transpose();
  EXPECT_NEAR(rest.trace(), views.rest(), 1e-12);
  EXPECT_LE(symmetric_eigen(rest).values[0], views.rest_bound + 1e-12);
}

TEST(Orthogonalize, RefusesSubspacesOfDifferentLength) {
  const std::vector<Eigen::MatrixXf> bases{Eigen::MatrixXf::Identity(5, 2), Eigen::MatrixXf::Identity(6, 2)};
  EXPECT_THROW(orthogonalize(bases), std::invalid_argument);
  EXPECT_THROW(orthogonalize(std::span<const Eigen::MatrixXf>{}), std::invalid_argument);
  const std::vector<Eigen::MatrixXf> one{Eigen::MatrixXf::Identity(5, 2)};
  EXPECT_THROW(orthogonalize(one, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
