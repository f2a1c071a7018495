#include "sim/scene/mesh.h"

#include <array>
#include <cmath>

namespace eigenpose::sim {
namespace {

constexpr float gradient_step = 0.12F;  // mm: smaller than every rounding, far above float's resolution

Vec3 gradient(const Shape& shape, Vec3 p) {
  // Four points of a tetrahedron give the gradient with four evaluations.
  constexpr std::array<Vec3, 4> corners{{{1, -1, -1}, {-1, -1, 1}, {-1, 1, -1}, {1, 1, 1}}};
  Vec3 sum;
  for (const Vec3 corner : corners) sum += shape.field(p + gradient_step * corner).distance * corner;
  return (0.25F / gradient_step) * sum;
}

/// The grid of distances around a shape.
struct Grid {
  int nx, ny, nz;
  Vec3 origin;
  float cell;
  std::vector<float> values;

  [[nodiscard]] std::size_t index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(ny) + static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(nx) +
           static_cast<std::size_t>(x);
  }
  [[nodiscard]] Vec3 point(int x, int y, int z) const {
    return origin + cell * Vec3{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
  }
};

Grid sampled(const Shape& shape) {
  const auto count = [&](float extent) { return static_cast<int>(std::ceil(extent / shape.cell)) + 5; };
  const Vec3 extent = shape.upper - shape.lower;
  Grid grid{count(extent.x), count(extent.y), count(extent.z), shape.lower, shape.cell, {}};
  grid.origin = shape.lower - (2.0F * shape.cell) * Vec3{1.0F, 1.0F, 1.0F};
  grid.values.resize(grid.index(0, 0, grid.nz));
  for (int z = 0; z < grid.nz; ++z) {
    for (int y = 0; y < grid.ny; ++y) {
      for (int x = 0; x < grid.nx;) {
        const float d = shape.field(grid.point(x, y, z)).distance;
        grid.values[grid.index(x, y, z)] = d;
        ++x;
        // Far from the surface the neighbours can't cross it either. Half of the distance is kept as a
        // margin, since an ellipsoid's is only about right.
        for (float left = 0.5F * std::abs(d) - 3.0F * grid.cell; left > 0.0F && x < grid.nx;
             left -= grid.cell, ++x) {
          grid.values[grid.index(x, y, z)] = d;
        }
      }
    }
  }
  return grid;
}

/// The mean of the points where the cell's edges cross zero.
bool crossing_mean(const Grid& grid, int x, int y, int z, Vec3& mean) {
  constexpr std::array<std::array<int, 2>, 12> edges{
      {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};
  std::array<float, 8> corner{};
  int inside = 0;
  for (int i = 0; i < 8; ++i) {
    corner[static_cast<std::size_t>(i)] =
        grid.values[grid.index(x + (i & 1), y + ((i >> 1) & 1), z + (i >> 2))];
    if (corner[static_cast<std::size_t>(i)] < 0.0F) ++inside;
  }
  if (inside == 0 || inside == 8) return false;
  Vec3 sum;
  float count = 0.0F;
  for (const auto& edge : edges) {
    const float a = corner[static_cast<std::size_t>(edge[0])];
    const float b = corner[static_cast<std::size_t>(edge[1])];
    if ((a < 0.0F) == (b < 0.0F)) continue;
    const auto place = [&](int i) { return grid.point(x + (i & 1), y + ((i >> 1) & 1), z + (i >> 2)); };
    sum += mix(place(edge[0]), place(edge[1]), a / (a - b));
    count += 1.0F;
  }
  mean = (1.0F / count) * sum;
  return true;
}

void add_quad(Mesh& mesh, std::array<std::uint32_t, 4> corner, bool flip) {
  if (flip) std::swap(corner[1], corner[3]);
  for (const std::size_t i : {0U, 1U, 2U, 0U, 2U, 3U}) mesh.triangles.push_back(corner[i]);
}

}  // namespace

Mesh mesh_of(const Shape& shape) {
  const Grid grid = sampled(shape);
  Mesh mesh;
  std::vector<std::uint32_t> vertex(grid.values.size(), 0);
  for (int z = 0; z + 1 < grid.nz; ++z) {
    for (int y = 0; y + 1 < grid.ny; ++y) {
      for (int x = 0; x + 1 < grid.nx; ++x) {
        Vec3 p;
        if (!crossing_mean(grid, x, y, z, p)) continue;
        Vec3 normal;
        for (int round = 0; round < 3; ++round) {
          normal = gradient(shape, p);
          const float squared = std::max(dot(normal, normal), 0.05F);
          const float step = std::clamp(shape.field(p).distance / squared, -grid.cell, grid.cell);
          p = p - step * normal;
        }
        vertex[grid.index(x, y, z)] = static_cast<std::uint32_t>(mesh.positions.size());
        mesh.positions.push_back(p);
        mesh.normals.push_back(normalized(gradient(shape, p)));
        mesh.parts.push_back(shape.field(p).part);
      }
    }
  }
  mesh.openness.assign(mesh.positions.size(), 1.0F);

  // Each grid edge that crosses the surface is shared by four cells: their vertices make a quad.
  for (int z = 1; z + 1 < grid.nz; ++z) {
    for (int y = 1; y + 1 < grid.ny; ++y) {
      for (int x = 1; x + 1 < grid.nx; ++x) {
        const bool inside = grid.values[grid.index(x, y, z)] < 0.0F;
        const auto at = [&](int dx, int dy, int dz) { return vertex[grid.index(x - dx, y - dy, z - dz)]; };
        if (inside != (grid.values[grid.index(x + 1, y, z)] < 0.0F)) {
          add_quad(mesh, {at(0, 1, 1), at(0, 0, 1), at(0, 0, 0), at(0, 1, 0)}, !inside);
        }
        if (inside != (grid.values[grid.index(x, y + 1, z)] < 0.0F)) {
          add_quad(mesh, {at(1, 0, 1), at(1, 0, 0), at(0, 0, 0), at(0, 0, 1)}, !inside);
        }
        if (inside != (grid.values[grid.index(x, y, z + 1)] < 0.0F)) {
          add_quad(mesh, {at(1, 1, 0), at(0, 1, 0), at(0, 0, 0), at(1, 0, 0)}, !inside);
        }
      }
    }
  }
  return mesh;
}

}  // namespace eigenpose::sim
