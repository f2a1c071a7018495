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

/// Samples of one manifold on a grid. Holds scratch memory: one thread at a time; calls do not allocate.
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
  [[nodiscard]] std::optional<Fit> other_minimum(const Eigen::Ref<const Eigen::VectorXf>& point,
                                                 std::span<const double> q, double apart,
                                                 std::span<double> other_q);

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
  [[nodiscard]] bool is_minimum(std::size_t sample) const;
  [[nodiscard]] std::size_t neighbour(std::size_t sample, const Axis& axis, int direction) const;
  [[nodiscard]] double value(std::size_t sample, const Axis& axis) const {
    return axis.values[(sample / axis.stride) % axis.values.size()];
  }

  std::vector<Axis> axes_;
  Eigen::MatrixXf points_;          ///< K × samples
  std::vector<double> covariance_;  ///< samples × m × m
  Eigen::VectorXf squared_;         ///< scratch: squared distance of each sample
};

}  // namespace eigenpose
