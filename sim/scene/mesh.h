#pragma once

/// Triangles of a shape's surface.

#include <cstdint>
#include <vector>

#include "sim/scene/shape.h"

namespace eigenpose::sim {

struct Mesh {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;             ///< unit length, one a vertex
  std::vector<float> openness;           ///< how much of the sky a vertex sees, 0…1
  std::vector<int> parts;                ///< nearest part of the field, one a vertex
  std::vector<std::uint32_t> triangles;  ///< three vertices each, counter-clockwise seen from outside

  [[nodiscard]] std::size_t triangle_count() const { return triangles.size() / 3; }
};

/// Where the shape's distance is zero, by surface nets on a grid of `shape.cell`; each vertex is then moved
/// onto the surface. `openness` is left at 1.
Mesh mesh_of(const Shape& shape);

}  // namespace eigenpose::sim
