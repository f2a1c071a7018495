#pragma once

/// Which learned objects, and which poses of one object, look alike: what recognition will not distinguish,
/// found after learning.

#include <cstddef>
#include <vector>

#include "core/model/model.h"

namespace eigenpose {

/// Two poses that look alike, of two objects or of one: where they do most.
struct Resemblance {
  std::size_t first = 0;   ///< object
  std::size_t second = 0;  ///< object; `first` where it is another pose of the same
  std::vector<double> first_q;
  std::vector<double> second_q;
  double distance = 0.0;  ///< between the two points of their manifolds
  double share = 0.0;     ///< of the poses of one of them that look like some pose of the other, 0…1
};

/// Pairs of objects that would be confused if only one of them had been learned: a view of one lies within
/// the rejection distance of the other. Closest first.
std::vector<Resemblance> alike_objects(const Model& model, unsigned threads = 0);

/// Objects with poses, more than `poses_apart` of a DOF's range away from each other, that are no farther
/// from each other than new views of one pose are (the object's typical distance). Closest first.
std::vector<Resemblance> alike_poses(const Model& model, unsigned threads = 0);

}  // namespace eigenpose
