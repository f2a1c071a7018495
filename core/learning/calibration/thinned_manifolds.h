#pragma once

/// Manifolds through some of an object's views: how much the spline misses at the views left out, and how
/// that grows with the step between views.

#include <array>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "core/base/grid.h"
#include "core/learning/training_views.h"
#include "core/manifold/manifold.h"
#include "core/search/search.h"

namespace eigenpose {

/// Every second view is kept, every fourth, every eighth.
inline constexpr std::array<std::size_t, 3> thinnings{2, 4, 8};

/// An object's manifolds through some of its views: without the views at one value of a DOF, and with every
/// n-th other value only, those that are n/2 steps from it and so on.
class ThinnedManifolds {
 public:
  ThinnedManifolds(const ObjectViews& object, const Eigen::Ref<const Eigen::MatrixXd>& points, int degree)
      : object_(object), points_(points), degree_(degree) {}

  /// Squared distance to the manifold without value `from` of DOF `d`. Nothing where too few views are left.
  std::optional<double> squared_distance(std::size_t d, std::size_t every, std::size_t from,
                                         const Eigen::VectorXf& point);

 private:
  struct Thinned {
    std::unique_ptr<Manifold> manifold;
    std::unique_ptr<ManifoldSearch> search;
  };

  [[nodiscard]] Thinned thin(std::size_t d, std::size_t every, std::size_t from) const;
  [[nodiscard]] Thinned thin_scattered(std::size_t every, std::size_t from) const;

  const ObjectViews& object_;
  Eigen::Ref<const Eigen::MatrixXd> points_;
  int degree_;
  std::map<std::array<std::size_t, 3>, Thinned> made_;
};

/// Interpolation error (squared) at one view for each thinning, the sum over the DOFs; −1: too few views.
using MissedErrors = std::array<double, thinnings.size()>;

/// @param view of the object. @param point the view's projection. @param full squared distance to the
/// manifold through all views.
MissedErrors missed_at(ThinnedManifolds& thinned, const Grid& grid, std::size_t view,
                       const Eigen::VectorXf& point, double full);

/// The factor by which the spline's squared error grows when the learned step doubles, over all views:
/// thinning by 2, 4 and 8 gives two estimates of it, extrapolated to the learned step. Between bounds that an
/// error of the first and the third power of the step give.
double error_growth(std::span<const MissedErrors> views);

}  // namespace eigenpose
