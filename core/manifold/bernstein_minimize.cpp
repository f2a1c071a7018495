#include <algorithm>
#include <cmath>
#include <limits>

#include "core/manifold/bernstein.h"

namespace eigenpose::bernstein {

double* MinimizeScratch::level(std::size_t depth, std::size_t size) {
  return memory_.data() + depth * size;
}

void MinimizeScratch::reserve(std::size_t size) {
  if (memory_.size() < size * (max_halvings + 2)) memory_.resize(size * (max_halvings + 2));
}

namespace {

using Vector = std::array<double, max_axes>;
using Matrix = std::array<Vector, max_axes>;

/// Value, gradient and Hessian of p at one place.
struct Expansion {
  double value = 0.0;
  Vector gradient{};
  Matrix hessian{};
};

/// Bernstein polynomials and their first and second derivatives at u.
struct Basis {
  std::array<double, max_degree + 1> order[3];

  void set(int n, double u) {
    std::array<double, max_degree + 1> b{};
    b[0] = 1.0;
    std::array<double, max_degree + 1> low{};  // degree n − 2
    std::array<double, max_degree + 1> mid{};  // degree n − 1
    if (n == 1) mid = b;
    if (n == 2) low = b;
    for (int d = 1; d <= n; ++d) {
      for (int i = d; i >= 0; --i) b[i] = (i < d ? (1.0 - u) * b[i] : 0.0) + (i > 0 ? u * b[i - 1] : 0.0);
      if (d == n - 2) low = b;
      if (d == n - 1) mid = b;
    }
    for (int i = 0; i <= n; ++i) {
      const auto at = [&](const std::array<double, max_degree + 1>& v, int j, int last) {
        return j < 0 || j > last ? 0.0 : v[j];
      };
      order[0][i] = b[i];
      order[1][i] = n * (at(mid, i - 1, n - 1) - at(mid, i, n - 1));
      order[2][i] =
          n < 2 ? 0.0
                : n * (n - 1) * (at(low, i - 2, n - 2) - 2.0 * at(low, i - 1, n - 2) + at(low, i, n - 2));
    }
  }
};

Expansion expand(const Shape& shape, const double* b, const Vector& u) {
  std::array<Basis, max_axes> basis;
  for (int a = 0; a < shape.axes; ++a) basis[a].set(shape.degree[a], u[a]);
  const int last = shape.axes - 1;
  const auto row = static_cast<std::size_t>(shape.degree[last] + 1);
  const std::size_t rows = shape.size() / row;
  Expansion e;
  std::array<int, max_axes> index{};
  for (std::size_t r = 0; r < rows; ++r, b += row) {
    double v[3] = {0.0, 0.0, 0.0};
    for (std::size_t i = 0; i < row; ++i)
      for (int o = 0; o < 3; ++o) v[o] += basis[last].order[o][i] * b[i];
    const auto weight = [&](int first, int second) {
      double product = 1.0;
      for (int a = 0; a < last; ++a)
        product *= basis[a].order[(a == first ? 1 : 0) + (a == second ? 1 : 0)][index[a]];
      return product;
    };
    const double plain = weight(-1, -1);
    e.value += plain * v[0];
    e.gradient[last] += plain * v[1];
    e.hessian[last][last] += plain * v[2];
    for (int a = 0; a < last; ++a) {
      const double once = weight(a, -1);
      e.gradient[a] += once * v[0];
      e.hessian[a][last] += once * v[1];
      for (int c = a; c < last; ++c) e.hessian[a][c] += weight(a, c) * v[0];
    }
    for (int a = last - 1; a >= 0; --a) {
      if (++index[a] <= shape.degree[a]) break;
      index[a] = 0;
    }
  }
  for (int a = 0; a < shape.axes; ++a)
    for (int c = 0; c < a; ++c) e.hessian[a][c] = e.hessian[c][a];
  return e;
}

/// Cholesky factor in place, lower triangle. False where the matrix is not positive definite.
bool factor(Matrix& a, int n) {
  for (int j = 0; j < n; ++j) {
    double d = a[j][j];
    for (int k = 0; k < j; ++k) d -= a[j][k] * a[j][k];
    if (!(d > 0.0)) return false;
    a[j][j] = std::sqrt(d);
    for (int i = j + 1; i < n; ++i) {
      double s = a[i][j];
      for (int k = 0; k < j; ++k) s -= a[i][k] * a[j][k];
      a[i][j] = s / a[j][j];
    }
  }
  return true;
}

void solve(const Matrix& factor, int n, Vector& x) {
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) x[i] -= factor[i][k] * x[k];
    x[i] /= factor[i][i];
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) x[i] -= factor[k][i] * x[k];
    x[i] /= factor[i][i];
  }
}

struct Descent {
  Vector u{};
  double value = 0.0;
  double gap = 0.0;  ///< if p is convex: value − minimum is at most this
};

/// Projected Newton from `u`. Ends when the gap is below `enough` or nothing improves.
Descent descend(const Shape& shape, const double* b, Vector u, double enough) {
  const int m = shape.axes;
  Descent result;
  Expansion e = expand(shape, b, u);
  for (int iteration = 0; iteration < 40; ++iteration) {
    double gap = 0.0;
    std::array<int, max_axes> free{};
    int count = 0;
    for (int a = 0; a < m; ++a) {
      gap += std::max(e.gradient[a] * u[a], -e.gradient[a] * (1.0 - u[a]));
      const bool held = (u[a] <= 0.0 && e.gradient[a] >= 0.0) || (u[a] >= 1.0 && e.gradient[a] <= 0.0);
      if (!held) free[count++] = a;
    }
    result = {u, e.value, gap};
    if (gap <= enough || count == 0) break;
    double ridge = 0.0;
    Vector step{};
    for (;;) {
      Matrix h{};
      double largest = 0.0;
      for (int i = 0; i < count; ++i)
        for (int j = 0; j < count; ++j) {
          h[i][j] = e.hessian[free[i]][free[j]];
          largest = std::max(largest, std::abs(h[i][j]));
        }
      if (largest == 0.0) largest = 1.0;
      for (int i = 0; i < count; ++i) h[i][i] += ridge * largest;
      if (factor(h, count)) {
        for (int i = 0; i < count; ++i) step[i] = -e.gradient[free[i]];
        solve(h, count, step);
        break;
      }
      ridge = ridge == 0.0 ? 1e-3 : ridge * 10.0;
    }
    bool moved = false;
    for (double length = 1.0; length > 1e-6; length *= 0.25) {
      Vector next = u;
      double promised = 0.0;
      for (int i = 0; i < count; ++i) {
        const int a = free[i];
        next[a] = std::clamp(u[a] + length * step[i], 0.0, 1.0);
        promised += e.gradient[a] * (next[a] - u[a]);
      }
      if (!(promised < 0.0)) break;
      Expansion trial = expand(shape, b, next);
      if (trial.value <= e.value + 1e-4 * promised) {
        u = next;
        e = trial;
        moved = true;
        break;
      }
    }
    if (!moved) break;
  }
  return result;
}

/// Largest |first difference| along an axis, the part of the polynomial that depends on it.
double dependence(const Shape& shape, const double* b, int axis) {
  const std::size_t inner = shape.stride(axis);
  const auto count = static_cast<std::size_t>(shape.degree[axis] + 1);
  const std::size_t size = shape.size();
  double largest = 0.0;
  for (std::size_t base = 0; base < size; base += inner * count)
    for (std::size_t i = 0; i + inner < inner * count; ++i)
      largest = std::max(largest, std::abs(b[base + i + inner] - b[base + i]));
  return largest;
}

/// Whether the Hessian is positive definite on the whole piece: with smallest diagonal entries d and largest
/// magnitudes h beside it, the matrix (d, −h) being positive definite bounds every Hessian from below. Axes
/// on which p does not depend beyond `rounding` are left out.
bool is_convex(const Shape& shape, const double* b, const Vector& depends, double rounding) {
  const int m = shape.axes;
  Matrix bound{};
  const std::size_t size = shape.size();
  std::array<int, max_axes> axis{};
  int count = 0;
  for (int a = 0; a < m; ++a)
    if (depends[a] > rounding) axis[count++] = a;
  for (int x = 0; x < count; ++x) {
    const int a = axis[x];
    const int n = shape.degree[a];
    const std::size_t step = shape.stride(a);
    double smallest = std::numeric_limits<double>::infinity();
    if (n < 2) return false;
    for (std::size_t base = 0; base < size; base += step * static_cast<std::size_t>(n + 1))
      for (std::size_t i = base; i < base + step * static_cast<std::size_t>(n - 1); ++i)
        smallest = std::min(smallest, b[i] - 2.0 * b[i + step] + b[i + 2 * step]);
    if (!(smallest > 0.0)) return false;
    bound[x][x] = n * (n - 1) * smallest;
  }
  for (int x = 0; x < count; ++x)
    for (int y = x + 1; y < count; ++y) {
      const std::size_t outer = shape.stride(axis[x]);
      const std::size_t inner = shape.stride(axis[y]);
      const auto n_outer = static_cast<std::size_t>(shape.degree[axis[x]]);
      const auto n_inner = static_cast<std::size_t>(shape.degree[axis[y]]);
      double largest = 0.0;
      for (std::size_t i = 0; i + outer + inner < size; ++i) {
        if ((i / outer) % (n_outer + 1) == n_outer || (i / inner) % (n_inner + 1) == n_inner) continue;
        largest = std::max(largest, std::abs(b[i + outer + inner] - b[i + outer] - b[i + inner] + b[i]));
      }
      bound[y][x] = bound[x][y] = -static_cast<double>(n_outer * n_inner) * largest;
    }
  return factor(bound, count);
}

struct Piece {
  Vector start{};
  Vector width{};
};

}  // namespace

Minimum minimize(const Shape& shape, const double* coefficients, double cut, double rounding,
                 double distance_tolerance, MinimizeScratch& scratch) {
  const int m = shape.axes;
  const std::size_t size = shape.size();
  scratch.reserve(size);
  std::array<Piece, max_halvings + 1> pieces;
  pieces[0].start.fill(0.0);
  pieces[0].width.fill(1.0);
  std::copy(coefficients, coefficients + size, scratch.level(0, size));
  std::size_t count = 1;
  Minimum best;
  best.value = cut;
  // What a piece must stay below to matter.
  const auto worthwhile = [&] {
    if (!best.found) return cut;
    const double distance = std::sqrt(std::max(best.value, 0.0));
    const double near = distance > distance_tolerance ? distance - distance_tolerance : 0.0;
    return std::min(best.value - rounding, near * near);
  };
  const auto offer = [&](const Piece& piece, const Vector& u, double value) {
    if (!(value < best.value || (value == best.value && !best.found))) return;
    best.found = true;
    best.value = value;
    for (int a = 0; a < m; ++a) best.u[a] = std::clamp(piece.start[a] + u[a] * piece.width[a], 0.0, 1.0);
  };
  bool first = true;
  while (count > 0) {
    const Piece piece = pieces[--count];
    double* b = scratch.level(count, size);
    const auto lowest = static_cast<std::size_t>(std::min_element(b, b + size) - b);
    if (b[lowest] > worthwhile()) continue;
    Vector depends{};
    int widest = 0;
    for (int a = 0; a < m; ++a) {
      depends[a] = dependence(shape, b, a);
      if (depends[a] > depends[widest]) widest = a;
    }
    const bool convex = is_convex(shape, b, depends, rounding);
    if (convex || first) {
      Vector u{};
      for (int a = 0; a < m; ++a) {
        const auto n = static_cast<std::size_t>(shape.degree[a]);
        u[a] = static_cast<double>(lowest / shape.stride(a) % (n + 1)) / static_cast<double>(n);
      }
      const Descent end = descend(shape, b, u, rounding);
      offer(piece, end.u, end.value);
      if (convex && end.value - end.gap > worthwhile() - rounding) continue;
    }
    first = false;
    if (depends[widest] <= rounding || piece.width[widest] < 1e-12 || count + 2 > max_halvings) {
      // Smaller than double resolves: any point of it is the answer.
      offer(piece, Vector{}, b[0]);
      continue;
    }
    double* high = scratch.level(count + 1, size);
    split(shape, widest, b, b, high);
    pieces[count] = pieces[count + 1] = piece;
    pieces[count].width[widest] = pieces[count + 1].width[widest] = 0.5 * piece.width[widest];
    pieces[count + 1].start[widest] += 0.5 * piece.width[widest];
    // The corner of each half with the lowest value is an answer already.
    for (std::size_t half = 0; half < 2; ++half) {
      const double* c = scratch.level(count + half, size);
      for (int corner = 0; corner < 1 << m; ++corner) {
        std::size_t at = 0;
        Vector u{};
        for (int a = 0; a < m; ++a)
          if (corner >> a & 1) {
            at += shape.stride(a) * static_cast<std::size_t>(shape.degree[a]);
            u[a] = 1.0;
          }
        offer(pieces[count + half], u, c[at]);
      }
    }
    count += 2;
  }
  return best;
}

}  // namespace eigenpose::bernstein
