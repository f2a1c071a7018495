#pragma once

/// Lists of manifolds and points to search for, made up or from real photographs.

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/manifold/manifold.h"

namespace eigenpose::bench {

struct SearchWorld {
  std::string name;
  std::vector<Manifold> manifolds;  ///< K = 20, closed quadratic splines through 36 views
  std::vector<Eigen::VectorXf> known;
  std::vector<Eigen::VectorXf> perturbed;
  std::vector<Eigen::VectorXf> unknown;
  double rejection_distance = 0.0;  ///< 99 % quantile of the distance of the perturbed views
};

/// Smooth curves whose coordinates decay like eigenvalues. Known views lie between the samples, about 0.01
/// off the spline; perturbed ones 0.04; unknown ones on curves outside the list.
SearchWorld synthetic_world(std::size_t objects, std::size_t queries);

/// COIL-100 colour at 64×64 from `folder`: 40 objects learned from every second view, the other views known;
/// the same moved by ±2 pixels and scaled by ±3 % perturbed; the other 10 objects unknown. More objects are
/// copies with random signs of the axes and random rotations of neighbouring axes, queries likewise.
/// @throws std::runtime_error when images are missing.
SearchWorld coil_world(const std::filesystem::path& folder, std::size_t objects, std::size_t queries);

}  // namespace eigenpose::bench
