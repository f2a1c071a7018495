#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/linear_algebra.h"
#include "core/manifold/manifold.h"
#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double pi = std::numbers::pi;

SampleAxis turn(int samples) {
  SampleAxis axis{Dof{"table", "deg", 0.0, 360.0, true}, {}};
  for (int i = 0; i < samples; ++i) axis.samples.push_back(360.0 * i / samples);
  return axis;
}

SampleAxis line(const std::string& name, int samples, double lower = 0.0, double upper = 10.0) {
  SampleAxis axis{Dof{name, "mm", lower, upper, false}, {}};
  for (int i = 0; i < samples; ++i) axis.samples.push_back(lower + (upper - lower) * i / (samples - 1));
  return axis;
}

/// Random poses inside the ranges of the axes.
Eigen::MatrixXd scattered(const std::vector<SampleAxis>& axes, int count, std::mt19937& random) {
  Eigen::MatrixXd poses(static_cast<Eigen::Index>(axes.size()), count);
  for (std::size_t a = 0; a < axes.size(); ++a) {
    std::uniform_real_distribution<double> inside(axes[a].dof.lower, axes[a].dof.upper);
    for (int i = 0; i < count; ++i) poses(static_cast<Eigen::Index>(a), i) = inside(random);
  }
  return poses;
}

std::vector<double> pose(const Eigen::MatrixXd& poses, Eigen::Index i) {
  return {poses.col(i).begin(), poses.col(i).end()};
}

std::string refusal(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ManifoldFit, IsTheInterpolationBitForBitOnAFullGrid) {
  std::mt19937 random(1);
  const std::vector<SampleAxis> axes{turn(9), line("x", 4)};
  const Eigen::MatrixXd points = synthetic::random_matrix(5, 36, random);
  for (int degree = 1; degree <= 3; ++degree)
    EXPECT_EQ(Manifold::fit(axes, Eigen::MatrixXd(), points, {.degree = degree}).coefficients(),
              Manifold::interpolate(axes, points, degree).coefficients());
}

TEST(ManifoldFit, AgreesWithTheInterpolationOnGridPosesUpToThePenalty) {
  // Smooth points: the penalty moves them by about λ times their curvature per step, and a little more at the
  // open ends, where the penalty and "not a knot" choose different ghosts.
  const std::vector<SampleAxis> axes{turn(24), line("x", 6)};
  const Eigen::MatrixXd poses = grid_poses(axes);
  Eigen::MatrixXd points(2, poses.cols());
  for (Eigen::Index i = 0; i < poses.cols(); ++i)
    points.col(i) << std::cos(poses(0, i) * pi / 180.0) + 0.1 * poses(1, i),
        std::sin(poses(0, i) * pi / 90.0);
  for (int degree = 1; degree <= 3; ++degree) {
    const Manifold exact = Manifold::interpolate(axes, points, degree);
    const Manifold fitted = Manifold::fit(axes, poses, points, {.degree = degree, .smoothing = 1e-6});
    for (double table = 0.0; table < 360.0; table += 7.0)
      for (double x = 0.0; x <= 10.0; x += 2.5)
        ASSERT_LT((exact.evaluate({{table, x}}) - fitted.evaluate({{table, x}})).norm(), 1e-3) << degree;
  }
}

TEST(ManifoldFit, ReproducesConstantsAndLinesExactlyWhateverThePosesAndTheSmoothing) {
  std::mt19937 random(2);
  for (int degree = 1; degree <= 3; ++degree)
    for (const double smoothing : {1e-4, 10.0}) {
      const std::vector<SampleAxis> axes{turn(7), line("x", 5), line("y", 4, -3.0, 3.0)};
      const Eigen::MatrixXd poses = scattered(axes, 60, random);
      Eigen::MatrixXd points(2, poses.cols());
      points.row(0).setConstant(4.0);
      points.row(1) = 1.0 + 0.5 * poses.row(1).array() - 2.0 * poses.row(2).array();
      const Manifold f = Manifold::fit(axes, poses, points, {.degree = degree, .smoothing = smoothing});
      const Eigen::MatrixXd others = scattered(axes, 40, random);
      for (Eigen::Index i = 0; i < others.cols(); ++i) {
        const Eigen::VectorXd at = f.evaluate(pose(others, i));
        // Solved from normal equations whose condition is up to 1e8.
        ASSERT_NEAR(at(0), 4.0, 1e-6) << degree << " " << smoothing;
        ASSERT_NEAR(at(1), 1.0 + 0.5 * others(1, i) - 2.0 * others(2, i), 1e-6) << degree << " " << smoothing;
      }
    }
}

TEST(ManifoldFit, ReproducesLinesOnUnevenAxes) {
  // The penalty uses Greville abscissae; plain differences of the coefficients would bend a line here.
  for (int degree = 1; degree <= 3; ++degree) {
    SampleAxis x{Dof{"x", "mm", 0.0, 10.0, false}, {0.0, 0.5, 1.0, 4.0, 9.0, 10.0}};
    Eigen::MatrixXd poses(1, 4);
    poses << 0.2, 3.0, 7.0, 9.5;
    const Manifold f = Manifold::fit({x}, poses, Eigen::MatrixXd(3.0 * poses.array() - 1.0),
                                     {.degree = degree, .smoothing = 1.0});
    for (double at = 0.0; at <= 10.0; at += 0.25)
      ASSERT_NEAR(f.evaluate({{at}})(0), 3.0 * at - 1.0, 1e-8) << degree;
  }
}

TEST(ManifoldFit, IsNotDeterminedBySamplesThatAllStandBeyondOneEnd) {
  // A pose beyond the end of an axis counts as the end.
  Eigen::MatrixXd poses(1, 3);
  poses << 10.0, 12.0, 15.0;
  EXPECT_EQ(Manifold::undetermined_dof(std::vector{line("x", 4)}, poses), "x");
  poses << 0.0, -2.0, -5.0;
  EXPECT_EQ(Manifold::undetermined_dof(std::vector{line("x", 4)}, poses), "x");
  poses << -5.0, 12.0, 15.0;
  EXPECT_EQ(Manifold::undetermined_dof(std::vector{line("x", 4)}, poses), "");
}

TEST(ManifoldFit, FollowsASmoothFunctionThroughScatteredPoses) {
  std::mt19937 random(3);
  const std::vector<SampleAxis> axes{turn(16), line("light", 5)};
  const auto truth = [](double table, double light) {
    return std::cos(table * pi / 180.0) * (1.0 + 0.05 * light) + 0.02 * light * light;
  };
  const Eigen::MatrixXd poses = scattered(axes, 200, random);
  Eigen::MatrixXd points(1, poses.cols());
  for (Eigen::Index i = 0; i < poses.cols(); ++i) points(0, i) = truth(poses(0, i), poses(1, i));
  const Manifold f = Manifold::fit(axes, poses, points);
  const Eigen::MatrixXd others = scattered(axes, 200, random);
  double worst = 0.0;
  for (Eigen::Index i = 0; i < others.cols(); ++i)
    worst = std::max(worst, std::abs(f.evaluate(pose(others, i))(0) - truth(others(0, i), others(1, i))));
  // A quadratic spline of 22.5° steps errs by 1 % of a cosine; corners without a sample by a few times that.
  EXPECT_LT(worst, 0.06);
}

TEST(ManifoldFit, ClosesTheTurnSmoothlyAndTakesPosesAtAnyTurn) {
  std::mt19937 random(4);
  const std::vector<SampleAxis> axes{turn(12)};
  const Eigen::MatrixXd poses = scattered(axes, 30, random);
  const Eigen::MatrixXd points = synthetic::random_matrix(3, 30, random);
  const Manifold f = Manifold::fit(axes, poses, points, {.smoothing = 1e-2});
  const ManifoldPoint before = f.evaluate_with_jacobian({{360.0 - 1e-9}});
  const ManifoldPoint after = f.evaluate_with_jacobian({{0.0}});
  EXPECT_LT((before.value - after.value).norm(), 1e-6);
  EXPECT_LT((before.jacobian - after.jacobian).norm(), 1e-6);
  const Manifold turned =
      Manifold::fit(axes, Eigen::MatrixXd(poses.array() - 720.0), points, {.smoothing = 1e-2});
  EXPECT_LT((turned.coefficients() - f.coefficients()).norm(), 1e-8);
}

TEST(ManifoldFit, HasTheDerivativeOfItsDifferences) {
  std::mt19937 random(5);
  const std::vector<SampleAxis> axes{turn(12), line("x", 5)};
  const Manifold f = Manifold::fit(axes, scattered(axes, 100, random),
                                   synthetic::random_matrix(3, 100, random), {.smoothing = 0.1});
  for (const std::vector<double>& q : {std::vector<double>{33.0, 4.1}, {200.0, 9.0}, {359.0, 0.4}}) {
    const ManifoldPoint at = f.evaluate_with_jacobian(q);
    for (std::size_t a = 0; a < 2; ++a) {
      std::vector<double> up = q;
      std::vector<double> down = q;
      up[a] += 1e-5;
      down[a] -= 1e-5;
      const Eigen::VectorXd difference = (f.evaluate(up) - f.evaluate(down)) / 2e-5;
      EXPECT_LT((difference - at.jacobian.col(static_cast<Eigen::Index>(a))).norm(), 1e-6);
    }
  }
}

TEST(ManifoldFit, StaysWithinItsSamplesAcrossALargeGap) {
  // Half a turn without a sample: the fit bridges it without swinging far beyond what it saw.
  const std::vector<SampleAxis> axes{turn(36)};
  Eigen::MatrixXd poses(1, 18);
  Eigen::MatrixXd points(2, 18);
  for (int i = 0; i < 18; ++i) {
    poses(0, i) = 10.0 * i;
    points.col(i) << std::cos(poses(0, i) * pi / 180.0), std::sin(poses(0, i) * pi / 180.0);
  }
  const Manifold f = Manifold::fit(axes, poses, points);
  for (double q = 0.0; q < 360.0; q += 1.0) ASSERT_LT(f.evaluate({{q}}).norm(), 2.0) << q;
  for (int i = 0; i < 18; ++i) ASSERT_LT((f.evaluate({{10.0 * i}}) - points.col(i)).norm(), 1e-2) << i;
}

TEST(ManifoldFit, GoesThroughTheMeanOfEqualPoses) {
  const std::vector<SampleAxis> axes{line("x", 3)};
  Eigen::MatrixXd poses(1, 4);
  poses << 0.0, 5.0, 5.0, 10.0;
  Eigen::MatrixXd points(1, 4);
  points << 1.0, 1.0, 3.0, 3.0;
  EXPECT_NEAR(Manifold::fit(axes, poses, points, {.smoothing = 1e-6}).evaluate({{5.0}})(0), 2.0, 1e-4);
}

TEST(ManifoldFit, DoesNotDependOnHowOftenTheSamplesAreGiven) {
  std::mt19937 random(7);
  const std::vector<SampleAxis> axes{turn(12), line("x", 4)};
  const Eigen::MatrixXd poses = scattered(axes, 60, random);
  const Eigen::MatrixXd points = synthetic::random_matrix(3, 60, random);
  const Manifold once = Manifold::fit(axes, poses, points, {.smoothing = 0.1});
  const Manifold thrice =
      Manifold::fit(axes, poses.replicate(1, 3).eval(), points.replicate(1, 3).eval(), {.smoothing = 0.1});
  // Rounding of normal equations whose condition is far below 1e6.
  EXPECT_LT((once.coefficients() - thrice.coefficients()).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(ManifoldFit, SmoothsMoreWhereAsked) {
  std::mt19937 random(6);
  const std::vector<SampleAxis> axes{turn(20)};
  const Eigen::MatrixXd poses = scattered(axes, 40, random);
  const Eigen::MatrixXd points = synthetic::random_matrix(1, 40, random);
  double former = 0.0;
  for (const double smoothing : {1e-4, 1e-2, 1.0, 100.0, 1e5}) {
    const Manifold f = Manifold::fit(axes, poses, points, {.smoothing = smoothing});
    double residual = 0.0;
    for (Eigen::Index i = 0; i < 40; ++i)
      residual += std::pow(f.evaluate(pose(poses, i))(0) - points(0, i), 2);
    EXPECT_GT(residual, former);
    former = residual;
  }
  const double scatter = (points.array() - points.mean()).square().sum();
  EXPECT_NEAR(former, scatter, 0.05 * scatter) << "hardly more than their mean is left";
}

TEST(ManifoldFit, SaysWhichDofTheSamplesDoNotDetermine) {
  const std::vector<SampleAxis> axes{turn(6), line("x", 3), line("y", 3)};
  std::mt19937 random(7);
  Eigen::MatrixXd poses = scattered(axes, 30, random);
  EXPECT_EQ(Manifold::undetermined_dof(axes, poses), "");
  const Eigen::MatrixXd points = synthetic::random_matrix(2, 30, random);
  poses.row(2).setConstant(4.0);
  EXPECT_THAT(refusal([&] { Manifold::fit(axes, poses, points); }), HasSubstr("\"y\""));
  poses.row(2) = 10.0 - poses.row(1).array();
  EXPECT_THAT(refusal([&] { Manifold::fit(axes, poses, points); }), HasSubstr("\"y\"")) << "follows from x";
  EXPECT_EQ(Manifold::undetermined_dof({axes.data(), 1}, Eigen::MatrixXd::Constant(1, 4, 20.0)), "")
      << "a turn needs no second pose to be determined: the penalty makes it constant";
}

TEST(ManifoldFit, RefusesWhatDoesNotFit) {
  const std::vector<SampleAxis> axes{turn(6)};
  const Eigen::MatrixXd poses = Eigen::MatrixXd::Zero(1, 4);
  const Eigen::MatrixXd points = Eigen::MatrixXd::Zero(2, 4);
  EXPECT_THAT(refusal([&] { Manifold::fit(axes, poses, points.leftCols(3)); }),
              AllOf(HasSubstr("3 points"), HasSubstr("4 poses")));
  EXPECT_THAT(refusal([&] { Manifold::fit(axes, Eigen::MatrixXd::Zero(2, 4), points); }),
              HasSubstr("2 DOFs"));
  EXPECT_THAT(refusal([&] { Manifold::fit(axes, poses, points, {.smoothing = 0.0}); }), HasSubstr("above 0"));
  EXPECT_THAT(refusal([&] { Manifold::fit(axes, poses, points, {.degree = 4}); }), HasSubstr("degree 4"));
  Eigen::MatrixXd endless = poses;
  endless(0, 1) = std::nan("");
  EXPECT_THAT(refusal([&] { Manifold::fit(axes, endless, points); }), HasSubstr("not finite"));
  EXPECT_THAT(refusal([&] {
                Manifold::fit({turn(70), turn(70)}, Eigen::MatrixXd::Zero(2, 4), points);
              }),
              HasSubstr("too large"));
}

TEST(Manifold, IsConditionedAcrossAGapByItsSizeInSteps) {
  // A sample beside a gap of g steps lies near the end of a segment of g/2 steps: its own coefficient has a
  // weight of about 4/g there. The norm of the inverse grows with g, not faster; it is 2 on even samples.
  for (const int gap : {1, 6, 24}) {
    SampleAxis axis = turn(72);
    axis.samples.resize(static_cast<std::size_t>(73 - gap));
    const AxisBasis basis(axis, 2);
    const Eigen::MatrixXd matrix = basis.interpolation_matrix();
    const Eigen::MatrixXd inverse =
        solve_square(matrix, Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols()));
    EXPECT_LT(inverse.cwiseAbs().rowwise().sum().maxCoeff(), 2.0 + 1e-9 + (gap > 1 ? gap : 0)) << gap;
  }
}

TEST(GridPoses, RunTheLastAxisFastest) {
  const Eigen::MatrixXd poses = grid_poses(std::vector<SampleAxis>{turn(2), line("x", 3)});
  Eigen::MatrixXd expected(2, 6);
  expected << 0, 0, 0, 180, 180, 180, 0, 5, 10, 0, 5, 10;
  EXPECT_EQ(poses, expected);
}

TEST(AxisBasis, HasGrevilleAbscissaeThatReproduceThePosition) {
  for (int degree = 1; degree <= 3; ++degree) {
    const SampleAxis x{Dof{"x", "mm", 0.0, 10.0, false}, {0.0, 0.5, 1.0, 4.0, 9.0, 10.0}};
    const AxisBasis basis(x, degree);
    const std::vector<double> at = basis.greville_abscissae();
    ASSERT_EQ(at.size(), basis.coefficients());
    const Manifold f = Manifold::from_coefficients(
        {x}, Eigen::Map<const Eigen::RowVectorXd>(at.data(), static_cast<Eigen::Index>(at.size())), degree);
    for (double q = 0.0; q <= 10.0; q += 0.1) ASSERT_NEAR(f.evaluate({{q}})(0), q, 1e-12) << degree;
  }
}

}  // namespace
}  // namespace eigenpose
