#include "core/manifold/manifold.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

// Interpolation is solved in double with condition numbers below 100.
constexpr double solve_tolerance = 1e-11;

/// m, degree, whether axes close on themselves, whether samples are jittered.
struct Shape {
  int dofs;
  int degree;
  bool periodic;
  bool jittered;
};

void PrintTo(const Shape& s, std::ostream* out) {
  *out << "m=" << s.dofs << " degree=" << s.degree << (s.periodic ? " periodic" : " open")
       << (s.jittered ? " jittered" : " uniform");
}

std::vector<Shape> all_shapes() {
  std::vector<Shape> shapes;
  for (int m = 1; m <= 4; ++m)
    for (int degree = 1; degree <= 3; ++degree)
      for (bool periodic : {false, true})
        for (bool jittered : {false, true}) shapes.push_back({m, degree, periodic, jittered});
  return shapes;
}

class EveryManifold : public ::testing::TestWithParam<Shape> {
 protected:
  EveryManifold() {
    const Shape shape = GetParam();
    const int samples[] = {9, 8, 5, 4};
    for (int a = 0; a < shape.dofs; ++a)
      axes_.push_back(
          synthetic::axis("q" + std::to_string(a), samples[a], shape.periodic, shape.jittered, random_));
    Eigen::Index count = 1;
    for (const auto& axis : axes_) count *= static_cast<Eigen::Index>(axis.samples.size());
    points_ = synthetic::random_matrix(5, count, random_);
  }
  Manifold manifold() const { return Manifold::interpolate(axes_, points_, GetParam().degree); }
  std::vector<double> random_q() {
    std::vector<double> q;
    for (const auto& axis : axes_) {
      const double first = axis.dof.periodic ? axis.dof.lower : axis.samples.front();
      const double last = axis.dof.periodic ? axis.dof.upper : axis.samples.back();
      q.push_back(std::uniform_real_distribution<double>(first, last)(random_));
    }
    return q;
  }

  std::mt19937 random_{7};
  std::vector<SampleAxis> axes_;
  Eigen::MatrixXd points_;
};

TEST_P(EveryManifold, PassesThroughItsSamples) {
  const Manifold f = manifold();
  std::vector<std::size_t> index(axes_.size(), 0);
  for (Eigen::Index column = 0; column < points_.cols(); ++column) {
    std::vector<double> q;
    for (std::size_t a = 0; a < axes_.size(); ++a) q.push_back(axes_[a].samples[index[a]]);
    ASSERT_LT((f.evaluate(q) - points_.col(column)).norm(), solve_tolerance) << "column " << column;
    for (std::size_t a = axes_.size(); a-- > 0;) {
      if (++index[a] < axes_[a].samples.size()) break;
      index[a] = 0;
    }
  }
}

TEST_P(EveryManifold, WeightsArePartitionsOfUnity) {
  // All coefficients equal: the manifold is that point, and its derivatives vanish.
  Manifold f = manifold();
  const Eigen::VectorXd point = Eigen::VectorXd::LinSpaced(5, 1.0, 2.0);
  const Manifold constant =
      Manifold::from_coefficients(axes_, point.replicate(1, f.coefficients().cols()), GetParam().degree);
  for (int i = 0; i < 50; ++i) {
    const ManifoldPoint at = constant.evaluate_with_jacobian(random_q());
    ASSERT_LT((at.value - point).norm(), 1e-14 * 100);
    ASSERT_LT(at.jacobian.norm(), 1e-12);
  }
}

TEST_P(EveryManifold, HasTheJacobianOfItsDifferences) {
  const Manifold f = manifold();
  // Central differences over 1e-5 of values near 1 with derivatives near 0.1 per unit: the rounding part is
  // about 1e-11, the third-derivative part 1e-11; kinks of degree 1 are avoided by staying inside a segment.
  constexpr double step = 1e-5;
  for (int i = 0; i < 20; ++i) {
    const std::vector<double> q = random_q();
    const ManifoldPoint at = f.evaluate_with_jacobian(q);
    for (std::size_t a = 0; a < axes_.size(); ++a) {
      const auto place = f.bases()[a].locate(q[a]);
      if (place.u < 1e-3 || place.u > 1.0 - 1e-3) continue;
      std::vector<double> up = q;
      std::vector<double> down = q;
      up[a] += step;
      down[a] -= step;
      const Eigen::VectorXd difference = (f.evaluate(up) - f.evaluate(down)) / (2.0 * step);
      ASSERT_LT((difference - at.jacobian.col(static_cast<Eigen::Index>(a))).norm(), 1e-8);
    }
  }
}

TEST_P(EveryManifold, IsSmoothAcrossItsKnotsAndItsSeam) {
  const Manifold f = manifold();
  const int degree = GetParam().degree;
  for (std::size_t a = 0; a < axes_.size(); ++a) {
    const AxisBasis& basis = f.bases()[a];
    const bool closed = axes_[a].dof.periodic;
    for (std::size_t s = 0; s + (closed ? 0 : 1) < basis.segments(); ++s) {
      // Value and derivatives below the degree agree from both sides of the end of segment s.
      for (int order = 0; order < std::min(degree, basis.degree()); ++order) {
        Eigen::VectorXd left = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(basis.coefficients()));
        Eigen::VectorXd right = left;
        double w[4];
        const std::size_t next = (s + 1) % basis.segments();
        basis.weights({s, 1.0}, order, w);
        for (int k = 0; k <= basis.degree(); ++k)
          left[static_cast<Eigen::Index>(basis.coefficient(s, k))] += w[k];
        basis.weights({next, 0.0}, order, w);
        for (int k = 0; k <= basis.degree(); ++k)
          right[static_cast<Eigen::Index>(basis.coefficient(next, k))] += w[k];
        ASSERT_LT((left - right).norm(), 1e-12) << "axis " << a << " segment " << s << " order " << order;
      }
    }
    if (closed) {
      std::vector<double> below = random_q();
      std::vector<double> above = below;
      below[a] = axes_[a].dof.lower;
      above[a] = axes_[a].dof.upper + 3.0 * axes_[a].dof.period();
      ASSERT_LT((f.evaluate(below) - f.evaluate(above)).norm(), 1e-10);
    }
  }
}

TEST_P(EveryManifold, IsTheSameAfterAJourneyThroughItsCoefficients) {
  const Manifold f = manifold();
  const Manifold g = Manifold::from_coefficients(axes_, f.coefficients(), GetParam().degree);
  for (int i = 0; i < 20; ++i) {
    const auto q = random_q();
    ASSERT_EQ(f.evaluate(q), g.evaluate(q));
  }
}

TEST_P(EveryManifold, ReproducesPolynomialsOfItsDegreeOnOpenAxes) {
  if (GetParam().periodic) return;  // A polynomial does not close on itself.
  const int degree = GetParam().degree;
  const auto polynomial = [&](std::span<const double> q) {
    double product = 1.0;
    for (double x : q) product *= std::pow(x / 100.0, degree) - 0.3 * x / 100.0 + 0.7;
    return product;
  };
  Eigen::MatrixXd values(1, points_.cols());
  std::vector<std::size_t> index(axes_.size(), 0);
  for (Eigen::Index column = 0; column < values.cols(); ++column) {
    std::vector<double> q;
    for (std::size_t a = 0; a < axes_.size(); ++a) q.push_back(axes_[a].samples[index[a]]);
    values(0, column) = polynomial(q);
    for (std::size_t a = axes_.size(); a-- > 0;) {
      if (++index[a] < axes_[a].samples.size()) break;
      index[a] = 0;
    }
  }
  const Manifold f = Manifold::interpolate(axes_, values, degree);
  for (int i = 0; i < 50; ++i) {
    const auto q = random_q();
    ASSERT_NEAR(f.evaluate(q)[0], polynomial(q), 1e-9);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, EveryManifold, ::testing::ValuesIn(all_shapes()));

TEST(Manifold, HasTheCentredFormulasOnUniformSamples) {
  const double weights[4][3] = {
      {0, 0, 0}, {0, 1, 0}, {1.0 / 8, 3.0 / 4, 1.0 / 8}, {1.0 / 6, 2.0 / 3, 1.0 / 6}};
  for (int degree = 2; degree <= 3; ++degree)
    for (bool periodic : {true, false}) {
      SampleAxis axis{Dof{"table", "deg", 0.0, 360.0, periodic}, {}};
      for (int i = 0; i < 12; ++i) axis.samples.push_back(30.0 * i);
      const AxisBasis basis(axis, degree);
      const Eigen::MatrixXd matrix = basis.interpolation_matrix();
      const Eigen::Index shift = periodic ? 11 : 0;
      for (Eigen::Index i = 0; i < 12; ++i)
        for (Eigen::Index k = 0; k < 3; ++k)
          EXPECT_NEAR(matrix(i, (i + k + shift) % matrix.cols()), weights[degree][k], 1e-14);
    }
}

TEST(Manifold, StaysWellConditionedForEvenAndOddNumbersOfSamples) {
  std::mt19937 random(3);
  for (int samples : {3, 4, 5, 6, 36, 71, 72})
    for (int degree : {2, 3}) {
      const AxisBasis basis(synthetic::axis("table", samples, true, false, random), degree);
      const Eigen::MatrixXd matrix = basis.interpolation_matrix();
      // Eigenvalues are ¾ + ¼cos ω ≥ ½ (degree 2) and ⅔ + ⅓cos ω ≥ ⅓ (degree 3); the matrix is symmetric.
      const Eigen::MatrixXd product = matrix.transpose() * matrix;
      Eigen::VectorXd v = synthetic::random_matrix(samples, 1, random).col(0);
      for (int i = 0; i < 20; ++i) {
        v = synthetic::random_matrix(samples, 1, random).col(0).normalized();
        EXPECT_GT(v.dot(product * v), (degree == 2 ? 0.25 : 1.0 / 9.0) - 1e-12);
      }
    }
}

TEST(Manifold, ConvergesWithTheThirdOrderOnASmoothCurveUpToOpenEnds) {
  // Halving the spacing divides the error of a quadratic spline by about 8, of a cubic by 16; 6 and 12 leave
  // room.
  const auto worst_error = [](int samples, int degree) {
    SampleAxis axis{Dof{"x", "mm", 0.0, 1.0, false}, {}};
    Eigen::MatrixXd points(1, samples);
    for (int i = 0; i < samples; ++i) {
      axis.samples.push_back(static_cast<double>(i) / (samples - 1));
      points(0, i) = std::sin(5.0 * axis.samples.back());
    }
    const Manifold f = Manifold::interpolate({axis}, points, degree);
    double worst = 0.0;
    for (int i = 0; i <= 2000; ++i) {
      const double x = i / 2000.0;
      worst = std::max(worst, std::abs(f.evaluate({{x}})[0] - std::sin(5.0 * x)));
    }
    return worst;
  };
  EXPECT_GT(worst_error(33, 2) / worst_error(65, 2), 6.0);
  EXPECT_GT(worst_error(33, 3) / worst_error(65, 3), 12.0);
}

TEST(Manifold, IsConstantAlongAnAxisOfOneSample) {
  const SampleAxis table{Dof{"table", "deg", 0.0, 360.0, true}, {0.0, 120.0, 240.0}};
  const SampleAxis light{Dof{"light", "deg", 0.0, 360.0, true}, {30.0}};
  Eigen::MatrixXd points(2, 3);
  points << 1.0, 0.0, -1.0, 0.0, 1.0, 0.5;
  const Manifold f = Manifold::interpolate({table, light}, points);
  EXPECT_LT((f.evaluate({{120.0, 30.0}}) - points.col(1)).norm(), solve_tolerance);
  EXPECT_EQ(f.evaluate({{77.0, 30.0}}), f.evaluate({{77.0, 200.0}}));
  EXPECT_EQ(f.evaluate_with_jacobian({{77.0, 10.0}}).jacobian.col(1).norm(), 0.0);
}

TEST(Manifold, ClampsOpenAxesToTheirSamples) {
  const SampleAxis x{Dof{"x", "mm", -5.0, 5.0, false}, {-1.0, 0.0, 2.0}};
  Eigen::MatrixXd points(1, 3);
  points << 3.0, 4.0, 8.0;
  const Manifold f = Manifold::interpolate({x}, points);
  EXPECT_NEAR(f.evaluate({{-5.0}})[0], 3.0, 1e-12);
  EXPECT_NEAR(f.evaluate({{5.0}})[0], 8.0, 1e-12);
}

TEST(Manifold, RefusesWhatDoesNotFitAndShowsBothSizes) {
  const SampleAxis table{Dof{"table", "deg", 0.0, 360.0, true}, {0.0, 120.0, 240.0}};
  const auto message = [](auto&& make) {
    try {
      make();
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message([&] { Manifold::interpolate({table}, Eigen::MatrixXd::Zero(2, 4)); }),
              ::testing::AllOf(::testing::HasSubstr("3"), ::testing::HasSubstr("4")));
  EXPECT_THAT(message([&] { Manifold::interpolate({table}, Eigen::MatrixXd::Zero(2, 3), 5); }),
              ::testing::HasSubstr("degree 5"));
  EXPECT_THAT(message([&] { Manifold::interpolate({}, Eigen::MatrixXd::Zero(2, 1)); }),
              ::testing::HasSubstr("got 0"));
  SampleAxis unordered = table;
  unordered.samples[2] = 110.0;
  EXPECT_THAT(message([&] { Manifold::interpolate({unordered}, Eigen::MatrixXd::Zero(2, 3)); }),
              ::testing::HasSubstr("ascend"));
  SampleAxis outside = table;
  outside.samples[2] = 360.0;
  EXPECT_THAT(message([&] { Manifold::interpolate({outside}, Eigen::MatrixXd::Zero(2, 3)); }),
              ::testing::HasSubstr("360"));
  SampleAxis two = table;
  two.samples.pop_back();
  EXPECT_THAT(message([&] { Manifold::interpolate({two}, Eigen::MatrixXd::Zero(2, 2)); }),
              ::testing::HasSubstr("at least 3"));
  EXPECT_THAT(message([&] {
                (void)Manifold::interpolate({table}, Eigen::MatrixXd::Zero(2, 3)).evaluate({{1.0, 2.0}});
              }),
              ::testing::HasSubstr("1 DOFs, got 2"));
}

}  // namespace
}  // namespace eigenpose
