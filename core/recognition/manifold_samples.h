#pragma once

/// A manifold sampled once, for what must not allocate or search again in every frame: how well each pose can
/// be told, and which other pose looks about the same.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/base/workspace.h"
#include "core/manifold/manifold.h"

namespace eigenpose {

/// Samples of one manifold on a grid. Immutable; const calls are thread-safe.
class ManifoldSamples {
 public:
  explicit ManifoldSamples(const Manifold& manifold);

  /// A pose and its distance.
  struct Fit {
    std::size_t sample = 0;
    double distance = 0.0;
  };

  /// The best local minimum of the distance to `point` that is not the valley around `q`: at least `apart` of
  /// the range away in some DOF. Refined between samples where there is one DOF. Nothing if there is none.
  /// @param other_q gets its pose. @param squared scratch, as large as `samples()` once used: then nothing is
  /// allocated.
  [[nodiscard]] std::optional<Fit> other_minimum(const Eigen::Ref<const Eigen::VectorXf>& point,
                                                 std::span<const double> q, double apart,
                                                 std::span<double> other_q, Eigen::VectorXf& squared) const;

  /// Covariance of q where each number of the point has variance 1, at the sample next to `q`: (JᵀJ)⁻¹, m ×
  /// m, row by row. Infinite where the point does not depend on a DOF.
  [[nodiscard]] std::span<const double> covariance(std::span<const double> q) const;

  [[nodiscard]] std::size_t dofs() const { return axes_.size(); }
  [[nodiscard]] std::size_t samples() const { return static_cast<std::size_t>(points_.cols()); }
  /// Pose of a sample, m numbers, and its point, K numbers.
  [[nodiscard]] std::vector<double> pose(std::size_t sample) const;
  [[nodiscard]] auto point(std::size_t sample) const {
    return points_.col(static_cast<Eigen::Index>(sample));
  }

 private:
  /// Sample positions along one DOF.
  struct Axis {
    Dof dof;
    std::vector<double> values;
    std::size_t stride = 1;  ///< between neighbours, in samples
  };

  [[nodiscard]] std::size_t nearest_index(const Axis& axis, double value) const;
  /// @param squared distance of each sample.
  [[nodiscard]] bool is_minimum(const Eigen::VectorXf& squared, std::size_t sample) const;
  [[nodiscard]] std::size_t neighbour(std::size_t sample, const Axis& axis, int direction) const;
  [[nodiscard]] double value(std::size_t sample, const Axis& axis) const {
    return axis.values[(sample / axis.stride) % axis.values.size()];
  }

  std::vector<Axis> axes_;
  Eigen::MatrixXf points_;          ///< K × samples
  std::vector<double> covariance_;  ///< samples × m × m
};

}  // namespace eigenpose
