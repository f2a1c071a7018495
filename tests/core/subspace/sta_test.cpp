#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/subspace/memory_source.h"
#include "core/subspace/solver.h"
#include "core/subspace/sta_code.h"
#include "tests/core/subspace/subspace_samples.h"
#include "tests/support/byte_source.h"
#include "tests/support/dense_solver.h"

namespace eigenpose {
namespace {

constexpr AppearanceShape kPicture{24, 20, 1};  // no whole number of 8 × 8 blocks across

/// Pictures of soft blobs that wander slowly: blocks and runs to be saved on.
std::vector<std::uint8_t> wandering_blobs(std::size_t count) {
  std::vector<std::uint8_t> views(count * kPicture.length());
  for (std::size_t j = 0; j < count; ++j) {
    const double t = 2.0 * std::numbers::pi * static_cast<double>(j) / static_cast<double>(count);
    for (std::size_t y = 0; y < kPicture.rows; ++y) {
      for (std::size_t x = 0; x < kPicture.columns; ++x) {
        const auto blob = [&](double cx, double cy, double width) {
          const double dx = static_cast<double>(x) - cx, dy = static_cast<double>(y) - cy;
          return std::exp(-(dx * dx + dy * dy) / (2.0 * width * width));
        };
        const double value = 130.0 * blob(10 + 6 * std::cos(t), 12 + 7 * std::sin(t), 3.0) +
                             90.0 * blob(10 + 3 * std::sin(2 * t), 12.0, 5.0) + 4.0;
        views[(j * kPicture.rows + y) * kPicture.columns + x] = static_cast<std::uint8_t>(value);
      }
    }
  }
  return views;
}

SolverOptions sta(double spatial, double temporal, std::size_t components) {
  SolverOptions options;
  options.solver = "sta";
  options.components = components;
  options.sta = {8, spatial, temporal};
  return options;
}

/// Share of the scatter of the views themselves.
double energy_kept(const AppearanceSource& source, const Eigenspace& space) {
  Eigen::MatrixXf views(static_cast<Eigen::Index>(source.length()),
                        static_cast<Eigen::Index>(source.count()));
  source.read(0, views);
  const Eigen::MatrixXf centred = views.colwise() - views.rowwise().mean();
  return static_cast<double>((space.basis.transpose() * centred).squaredNorm() / centred.squaredNorm());
}

TEST(BlockTransform, KeepsInnerProductsAndComesBack) {
  const BlockTransform transform({13, 11, 3}, 8);
  ASSERT_EQ(transform.positions(), 2U * 2U * 3U);
  const Eigen::VectorXf a = Eigen::VectorXf::Random(13 * 11 * 3);
  const Eigen::VectorXf b = Eigen::VectorXf::Random(13 * 11 * 3);
  Eigen::VectorXd back = Eigen::VectorXd::Zero(a.size());
  double product = 0.0;
  std::vector<float> x(transform.size()), y(transform.size());
  for (std::size_t p = 0; p < transform.positions(); ++p) {
    EXPECT_TRUE(transform.forward(a.data(), p, x.data()));
    EXPECT_TRUE(transform.forward(b.data(), p, y.data()));
    for (std::size_t c = 0; c < x.size(); ++c) product += static_cast<double>(x[c]) * y[c];
    const std::vector<double> exact(x.begin(), x.end());
    transform.add_inverse(exact.data(), p, back.data());
  }
  // Parseval, to the rounding of floats: 1e-6 of the norms, which are about 12.
  EXPECT_NEAR(product, a.cast<double>().dot(b.cast<double>()), 2e-4);
  EXPECT_LT((back - a.cast<double>()).norm(), 1e-6 * a.norm());
  const Eigen::VectorXf black = Eigen::VectorXf::Zero(a.size());
  EXPECT_FALSE(transform.forward(black.data(), 0, x.data()));
  EXPECT_EQ(x, std::vector<float>(x.size(), 0.0F));
}

TEST(Sta, RoundsToStepsWhereItMayChangeNothingElse) {
  const auto bytes = wandering_blobs(150);
  const ByteSource source(bytes, kPicture.length(), kPicture);
  SolverReport report;
  const Eigenspace found = solve_eigenspace(source, sta(0.0, 0.0, 6), &report);
  const Eigenspace exact = test::dense_eigenspace(source, 6);
  // Half a step in each of 576 coefficients at most: 7e-4 of a view.
  ASSERT_TRUE(report.sta);
  EXPECT_LT(report.sta->largest_change, 0.5 * sta_step * std::sqrt(576.0) + 3e-6);
  const double bound_deg = std::asin(report.sta->angle_sine_bound) * 180.0 / std::numbers::pi;
  EXPECT_LT(test::largest_angle_deg(found.basis, exact.basis), std::min(bound_deg, 0.05));
  EXPECT_LT((found.mean - exact.mean).cwiseAbs().maxCoeff(), 1e-6F);
}

TEST(Sta, HoldsItsErrorBounds) {
  const auto bytes = wandering_blobs(200);
  const ByteSource source(bytes, kPicture.length(), kPicture);
  bool some_angle_bound_says_something = false;
  bool some_energy_bound_says_something = false;
  for (const double share : {0.001, 0.003, 0.01, 0.05, 0.1}) {
    for (const std::size_t components : {2U, 5U}) {
      SolverReport report;
      const Eigenspace found = solve_eigenspace(source, sta(share, share, components), &report);
      const Eigenspace exact = test::dense_eigenspace(source, components);
      ASSERT_TRUE(report.sta);
      // The rounding to steps comes on top.
      EXPECT_LE(report.sta->largest_change, 2.0 * share + 0.5 * sta_step * std::sqrt(576.0));
      EXPECT_LE((found.eigenvalues - exact.eigenvalues).cwiseAbs().maxCoeff(),
                report.sta->eigenvalue_error_bound);
      const double bound_deg = std::asin(report.sta->angle_sine_bound) * 180.0 / std::numbers::pi;
      EXPECT_LE(test::largest_angle_deg(found.basis, exact.basis), bound_deg + 1e-4);
      EXPECT_LE(std::abs(report.energy - exact.eigenvalues.sum() / exact.total_scatter), report.energy_bound);
      EXPECT_LE(std::abs(report.energy - energy_kept(source, found)), report.energy_bound);
      some_energy_bound_says_something |= report.energy_bound < 0.1;
      some_angle_bound_says_something |= report.sta->angle_sine_bound < 0.5;
    }
  }
  EXPECT_TRUE(some_angle_bound_says_something) << "the test shows nothing about angles";
  EXPECT_TRUE(some_energy_bound_says_something) << "the test shows nothing about energy";
}

TEST(Sta, HoldsItsBoundOnEveryInnerProduct) {
  const auto bytes = wandering_blobs(120);
  const ByteSource source(bytes, kPicture.length(), kPicture);
  const BlockTransform transform(kPicture, 4);  // whole blocks: nothing is cropped when they come back
  const StaCode code = sta_code(source, transform, {4, 0.05, 0.05}, {.threads = 2});
  const Eigen::MatrixXd coded = sta_gram(code, 120, transform.size(), 2);
  Eigen::MatrixXf views(static_cast<Eigen::Index>(kPicture.length()), 120);
  source.read(0, views);
  const Eigen::MatrixXd exact = views.cast<double>().transpose() * views.cast<double>();
  const double change = std::sqrt(code.changes.maxCoeff());
  const double worst = (coded - exact).cwiseAbs().maxCoeff();
  EXPECT_GT(worst, 1e-4) << "nothing was simplified";
  EXPECT_LE(worst, 2.0 * change + change * change);
  // The products are those of the coded views themselves.
  const Eigen::MatrixXd back = sta_back_project(code, transform, Eigen::MatrixXd::Identity(120, 120), 1);
  EXPECT_LT((coded - back.transpose() * back).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_NEAR((back - views.cast<double>()).colwise().squaredNorm().maxCoeff(), code.changes.maxCoeff(),
              1e-6);
}

TEST(Sta, SavesCoefficientsAndRuns) {
  const auto bytes = wandering_blobs(300);
  const ByteSource source(bytes, kPicture.length(), kPicture);
  SolverReport report;
  solve_eigenspace(source, sta(0.05, 0.05, 5), &report);
  EXPECT_LT(report.sta->coefficient_share, 0.2);
  EXPECT_LT(report.sta->superblock_ratio, 0.8);
}

TEST(Sta, GivesTheSameBitsOnAnyNumberOfThreads) {
  const auto bytes = wandering_blobs(130);
  const ByteSource source(bytes, kPicture.length(), kPicture);
  SolverOptions one = sta(0.05, 0.05, 5);
  SolverOptions three = one;
  one.threads = 1;
  three.threads = 3;
  EXPECT_EQ(solve_eigenspace(source, one).basis, solve_eigenspace(source, three).basis);
}

TEST(Sta, RefusesWrongOptions) {
  const auto bytes = wandering_blobs(10);
  const ByteSource source(bytes, kPicture.length(), kPicture);
  EXPECT_THROW(solve_eigenspace(source, sta(-0.1, 0.1, 3)), std::invalid_argument);
  EXPECT_THROW(solve_eigenspace(source, sta(0.1, 1.5, 3)), std::invalid_argument);
  SolverOptions wide = sta(0.1, 0.1, 3);
  wide.sta.block = 40;
  EXPECT_THROW(solve_eigenspace(source, wide), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
