#include "core/learning/calibration/cross_validation.h"

#include <cmath>
#include <cstdint>

#include "core/manifold/sample_grid.h"
#include "core/search/search.h"

namespace eigenpose {

namespace {

/// Halves of views that are no grid: a fixed random order that does not follow the order of the poses.
std::vector<Fold> make_halves(const ObjectViews& object, std::size_t d) {
  std::vector<Fold> folds;
  for (std::uint32_t first = 0; first < 2; ++first) {
    Fold fold;
    fold.axes = object.axes;
    for (std::size_t i = 0; i < object.count; ++i) {
      const auto view = static_cast<Eigen::Index>(i);
      const bool left_out = (static_cast<std::uint32_t>(i) * 2654435761U >> 31) == first;
      if (left_out) fold.left_out_values.push_back(object.poses(static_cast<Eigen::Index>(d), view));
      (left_out ? fold.left_out : fold.kept).push_back(view);
    }
    if (fold.kept.size() < 3 || fold.left_out.empty()) return {};
    fold.poses = object.poses(Eigen::all, fold.kept);
    if (!Manifold::undetermined_dof(fold.axes, fold.poses).empty()) return {};
    folds.push_back(std::move(fold));
  }
  return folds;
}

}  // namespace

std::vector<Fold> make_folds(const ObjectViews& object, std::size_t d) {
  const auto& axis = object.axes[d];
  const auto& all = axis.samples;
  if (object.poses.size() > 0) return all.size() < 2 ? std::vector<Fold>() : make_halves(object, d);
  std::vector<Fold> folds;
  if (all.size() < (axis.dof.periodic ? 6U : 5U)) return folds;
  const Grid grid = grid_of(object.axes);
  for (std::size_t first = 0; first < 2; ++first) {
    const auto leaves = [&](std::size_t i) {
      const bool end = i == 0 || i + 1 == all.size();
      return i % 2 == first && (axis.dof.periodic || !end);
    };
    Fold fold;
    fold.axes = object.axes;
    fold.axes[d].samples.clear();
    for (std::size_t i = 0; i < all.size(); ++i)
      if (!leaves(i)) fold.axes[d].samples.push_back(all[i]);
    for (std::size_t cell = 0; cell < object.count; ++cell) {
      const std::size_t i = grid.index(cell, d);
      if (leaves(i)) fold.left_out_values.push_back(all[i]);
      (leaves(i) ? fold.left_out : fold.kept).push_back(static_cast<Eigen::Index>(cell));
    }
    folds.push_back(std::move(fold));
  }
  return folds;
}

std::vector<double> left_out_errors(const ObjectViews& object, std::size_t d, int degree,
                                    const std::function<FoldPoints(const Fold&)>& project) {
  std::vector<double> errors;
  for (const Fold& fold : make_folds(object, d)) {
    const FoldPoints points = project(fold);
    const std::vector<Manifold> manifold{
        Manifold::fit(fold.axes, fold.poses, points.kept, {.degree = degree})};
    const auto search = make_search("tree", manifold);
    for (Eigen::Index i = 0; i < points.left_out.cols(); ++i) {
      const double found = search->nearest(points.left_out.col(i).cast<float>(), 1).front().q[d];
      errors.push_back(
          std::abs(object.axes[d].dof.difference(found, fold.left_out_values[static_cast<std::size_t>(i)])));
    }
  }
  return errors;
}

}  // namespace eigenpose
