#pragma once

/// Cross-validation on learned views: leave some out along one DOF, fit the rest, see where the left-out ones
/// are found.

#include <cstddef>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "core/learning/training_views.h"
#include "core/manifold/manifold.h"

namespace eigenpose {

/// An object's views without every second value of one DOF. The ends of an open DOF stay: beyond them there
/// is no manifold.
struct Fold {
  std::vector<SampleAxis> axes;    ///< of the kept views
  Eigen::MatrixXd poses;           ///< of the kept views, where the object's are no grid; else 0 × 0
  std::vector<Eigen::Index> kept;  ///< views counted from the object's first, in grid order
  std::vector<Eigen::Index> left_out;
  std::vector<double> left_out_values;  ///< of the DOF
};

/// Both folds of DOF `d`; none when it has too few values (6 on a turn, 5 on an open DOF). Views that are no
/// grid are halved at random, the same way every time, where either half determines a manifold.
std::vector<Fold> make_folds(const ObjectViews& object, std::size_t d);

/// Points of the views of one fold, one column a view.
struct FoldPoints {
  Eigen::MatrixXd kept;
  Eigen::MatrixXd left_out;
};

/// |error| in DOF `d` of every left-out view, found on the spline through the kept ones. Empty without folds.
std::vector<double> left_out_errors(const ObjectViews& object, std::size_t d, int degree,
                                    const std::function<FoldPoints(const Fold&)>& project);

}  // namespace eigenpose
