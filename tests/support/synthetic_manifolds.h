#pragma once

/// Made-up axes, curves and patches for the tests and benchmarks of manifolds.

#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/manifold/manifold.h"

namespace eigenpose::synthetic {

inline Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index cols, std::mt19937& random) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd matrix(rows, cols);
  for (Eigen::Index c = 0; c < cols; ++c)
    for (Eigen::Index r = 0; r < rows; ++r) matrix(r, c) = normal(random);
  return matrix;
}

/// Samples over 0…360, jittered by up to a third of their spacing if asked for.
inline SampleAxis axis(const std::string& name, int samples, bool periodic, bool jittered,
                       std::mt19937& random) {
  SampleAxis axis{Dof{name, "deg", 0.0, 360.0, periodic}, {}};
  const double spacing = 360.0 / (periodic || samples < 2 ? samples : samples - 1);
  std::uniform_real_distribution<double> jitter(-spacing / 3.0, spacing / 3.0);
  for (int i = 0; i < samples; ++i) {
    const bool inner = i > 0 && (periodic || i < samples - 1);
    axis.samples.push_back(spacing * i + (jittered && inner ? jitter(random) : 0.0));
  }
  return axis;
}

/// A manifold like those of real objects: unit-energy appearances whose coordinates decay like eigenvalues,
/// smooth in each DOF (`harmonics` Fourier terms with falling amplitude), around a random centre.
inline Manifold smooth_manifold(const std::vector<SampleAxis>& axes, Eigen::Index dimensions, int degree,
                                std::mt19937& random, int harmonics = 5, double radius = 0.35) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi);
  const auto scale = [](Eigen::Index k) { return 1.0 / std::sqrt(1.0 + static_cast<double>(k)); };
  Eigen::Index count = 1;
  for (const auto& a : axes) count *= static_cast<Eigen::Index>(a.samples.size());
  Eigen::MatrixXd points = Eigen::MatrixXd::Zero(dimensions, count);
  for (Eigen::Index k = 0; k < dimensions; ++k) points.row(k).setConstant(0.25 * scale(k) * normal(random));
  for (int h = 1; h <= harmonics; ++h)
    for (Eigen::Index k = 0; k < dimensions; ++k) {
      const double amplitude = radius * scale(k) / h * normal(random) / std::sqrt(3.0);
      std::vector<double> phases;
      std::vector<int> waves;
      for (std::size_t a = 0; a < axes.size(); ++a) {
        phases.push_back(phase(random));
        waves.push_back(a == 0 ? h : std::uniform_int_distribution<int>(0, 2)(random));
      }
      for (Eigen::Index column = 0; column < count; ++column) {
        Eigen::Index rest = column;
        double product = amplitude;
        for (std::size_t a = axes.size(); a-- > 0;) {
          const auto n = static_cast<Eigen::Index>(axes[a].samples.size());
          const double angle = axes[a].samples[static_cast<std::size_t>(rest % n)] * std::numbers::pi / 180.0;
          rest /= n;
          product *= std::cos(waves[a] * (axes[a].dof.periodic ? angle : 0.5 * angle) + phases[a]);
        }
        points(k, column) += product;
      }
    }
  return Manifold::interpolate(axes, points, degree);
}

/// A closed curve of `samples` views.
inline Manifold smooth_curve(int samples, Eigen::Index dimensions, int degree, std::mt19937& random,
                             bool jittered = false) {
  return smooth_manifold({axis("table", samples, true, jittered, random)}, dimensions, degree, random);
}

}  // namespace eigenpose::synthetic
