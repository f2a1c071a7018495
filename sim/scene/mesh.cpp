#include "sim/scene/mesh.h"

#include <array>
#include <cmath>

namespace eigenpose::sim {
namespace {

constexpr float gradient_step = 0.12F;  // mm: smaller than every rounding, far above float's resolution
/// Keeps the vertex of a nearly flat cell from sliding along its surface. Relative to one crossing's weight.
constexpr float regularization = 0.08F;

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
  [[nodiscard]] bool inside(int x, int y, int z) const { return values[index(x, y, z)] < 0.0F; }
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

/// Where an edge of the grid meets the surface.
struct Crossing {
  Vec3 point;
  Vec3 normal;
};

/// All crossings; `number[axis][i]` is the crossing on the edge from grid point i along the axis, or −1.
struct Crossings {
  std::array<std::vector<int>, 3> number;
  std::vector<Crossing> all;
};

Crossing crossing_near(const Shape& shape, Vec3 p) {
  // Four points of a tetrahedron give the gradient with four evaluations, and their mean the distance.
  constexpr std::array<Vec3, 4> corners{{{1, -1, -1}, {-1, -1, 1}, {-1, 1, -1}, {1, 1, 1}}};
  Vec3 gradient;
  float distance = 0.0F;
  for (const Vec3 corner : corners) {
    const float d = shape.field(p + gradient_step * corner).distance;
    gradient += d * corner;
    distance += 0.25F * d;
  }
  gradient = (0.25F / gradient_step) * gradient;
  const float squared = std::max(dot(gradient, gradient), 0.05F);
  const float step = std::clamp(distance / squared, -0.3F * shape.cell, 0.3F * shape.cell);
  return {p - step * gradient, normalized(gradient)};
}

Crossings crossings_of(const Shape& shape, const Grid& grid) {
  Crossings result;
  for (auto& numbers : result.number) numbers.assign(grid.values.size(), -1);
  constexpr std::array<std::array<int, 3>, 3> step{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (int z = 0; z + 1 < grid.nz; ++z) {
    for (int y = 0; y + 1 < grid.ny; ++y) {
      for (int x = 0; x + 1 < grid.nx; ++x) {
        const float a = grid.values[grid.index(x, y, z)];
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const int x1 = x + step[axis][0];
          const int y1 = y + step[axis][1];
          const int z1 = z + step[axis][2];
          const float b = grid.values[grid.index(x1, y1, z1)];
          if ((a < 0.0F) == (b < 0.0F)) continue;
          result.number[axis][grid.index(x, y, z)] = static_cast<int>(result.all.size());
          result.all.push_back(
              crossing_near(shape, mix(grid.point(x, y, z), grid.point(x1, y1, z1), a / (a - b))));
        }
      }
    }
  }
  return result;
}

/// The edges of a cell: axis, and offset of the grid point they start from.
constexpr std::array<std::array<int, 4>, 12> cell_edges{{{0, 0, 0, 0},
                                                         {0, 0, 1, 0},
                                                         {0, 0, 0, 1},
                                                         {0, 0, 1, 1},
                                                         {1, 0, 0, 0},
                                                         {1, 1, 0, 0},
                                                         {1, 0, 0, 1},
                                                         {1, 1, 0, 1},
                                                         {2, 0, 0, 0},
                                                         {2, 1, 0, 0},
                                                         {2, 0, 1, 0},
                                                         {2, 1, 1, 0}}};

/// Solves a symmetric system of three equations. @param m its xx, xy, xz, yy, yz, zz.
Vec3 solved(const std::array<float, 6>& m, Vec3 right) {
  const Vec3 c0{m[0], m[1], m[2]};
  const Vec3 c1{m[1], m[3], m[4]};
  const Vec3 c2{m[2], m[4], m[5]};
  const Vec3 u = cross(c1, c2);
  const float determinant = dot(c0, u);
  return (1.0F / determinant) * Vec3{dot(right, u), dot(right, cross(c2, c0)), dot(right, cross(c0, c1))};
}

/// Adds the cell's vertex where the planes through its crossings meet best (dual contouring: Ju et al. 2002),
/// so that edges of the shape stay sharp.
bool add_vertex(const Shape& shape, const Grid& grid, const Crossings& crossings, int x, int y, int z,
                Mesh& mesh) {
  std::array<const Crossing*, 12> found{};
  std::size_t count = 0;
  Vec3 mean;
  Vec3 normal;
  for (const auto& edge : cell_edges) {
    const int number =
        crossings
            .number[static_cast<std::size_t>(edge[0])][grid.index(x + edge[1], y + edge[2], z + edge[3])];
    if (number < 0) continue;
    const Crossing& crossing = crossings.all[static_cast<std::size_t>(number)];
    found[count++] = &crossing;
    mean += crossing.point;
    normal += crossing.normal;
  }
  if (count == 0) return false;
  mean = (1.0F / static_cast<float>(count)) * mean;
  std::array<float, 6> m{regularization, 0.0F, 0.0F, regularization, 0.0F, regularization};
  Vec3 right;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3 n = found[i]->normal;
    const float offset = dot(n, found[i]->point - mean);
    m[0] += n.x * n.x;
    m[1] += n.x * n.y;
    m[2] += n.x * n.z;
    m[3] += n.y * n.y;
    m[4] += n.y * n.z;
    m[5] += n.z * n.z;
    right += offset * n;
  }
  const Vec3 move = solved(m, right);
  const Vec3 low = grid.point(x, y, z) - (0.1F * grid.cell) * Vec3{1, 1, 1};
  const Vec3 high = grid.point(x + 1, y + 1, z + 1) + (0.1F * grid.cell) * Vec3{1, 1, 1};
  const Vec3 p{std::clamp(mean.x + move.x, low.x, high.x), std::clamp(mean.y + move.y, low.y, high.y),
               std::clamp(mean.z + move.z, low.z, high.z)};
  mesh.positions.push_back(p);
  mesh.normals.push_back(normalized(normal));
  mesh.parts.push_back(shape.field(p).part);
  return true;
}

void add_quad(Mesh& mesh, std::array<std::uint32_t, 4> corner, bool flip) {
  if (flip) std::swap(corner[1], corner[3]);
  for (const std::size_t i : {0U, 1U, 2U, 0U, 2U, 3U}) mesh.triangles.push_back(corner[i]);
}

}  // namespace

Mesh mesh_of(const Shape& shape) {
  const Grid grid = sampled(shape);
  const Crossings crossings = crossings_of(shape, grid);
  Mesh mesh;
  std::vector<std::uint32_t> vertex(grid.values.size(), 0);
  for (int z = 0; z + 1 < grid.nz; ++z) {
    for (int y = 0; y + 1 < grid.ny; ++y) {
      for (int x = 0; x + 1 < grid.nx; ++x) {
        const auto number = static_cast<std::uint32_t>(mesh.positions.size());
        if (add_vertex(shape, grid, crossings, x, y, z, mesh)) vertex[grid.index(x, y, z)] = number;
      }
    }
  }
  mesh.openness.assign(mesh.positions.size(), 1.0F);

  // Each grid edge that crosses the surface is shared by four cells: their vertices make a quad.
  for (int z = 1; z + 1 < grid.nz; ++z) {
    for (int y = 1; y + 1 < grid.ny; ++y) {
      for (int x = 1; x + 1 < grid.nx; ++x) {
        const bool inside = grid.inside(x, y, z);
        const auto at = [&](int dx, int dy, int dz) { return vertex[grid.index(x - dx, y - dy, z - dz)]; };
        if (inside != grid.inside(x + 1, y, z)) {
          add_quad(mesh, {at(0, 1, 1), at(0, 0, 1), at(0, 0, 0), at(0, 1, 0)}, !inside);
        }
        if (inside != grid.inside(x, y + 1, z)) {
          add_quad(mesh, {at(1, 0, 1), at(1, 0, 0), at(0, 0, 0), at(0, 0, 1)}, !inside);
        }
        if (inside != grid.inside(x, y, z + 1)) {
          add_quad(mesh, {at(1, 1, 0), at(0, 1, 0), at(0, 0, 0), at(1, 0, 0)}, !inside);
        }
      }
    }
  }
  return mesh;
}

}  // namespace eigenpose::sim
