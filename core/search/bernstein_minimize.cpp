#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "core/search/bernstein.h"

namespace eigenpose::bernstein {

double* MinimizeScratch::level(std::size_t depth, std::size_t size) {
  return memory_.data() + depth * size;
}

void MinimizeScratch::reserve(std::size_t size) {
  if (memory_.size() < size * (max_halvings + 4)) memory_.resize(size * (max_halvings + 4));
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

/// First differences along an axis; `out` has one entry less there. @returns their shape.
Shape difference(const Shape& shape, int axis, const double* in, double* out) {
  const std::size_t inner = shape.stride(axis);
  const std::size_t block = inner * static_cast<std::size_t>(shape.degree[axis] + 1);
  const std::size_t steps = block - inner;
  const std::size_t size = shape.size();
  for (std::size_t base = 0; base < size; base += block, out += steps)
    for (std::size_t i = 0; i < steps; ++i) out[i] = in[base + inner + i] - in[base + i];
  Shape result = shape;
  --result.degree[axis];
  return result;
}

Range range_of(const double* values, std::size_t count) {
  Range range{values[0], values[0]};
  for (std::size_t i = 1; i < count; ++i) {
    range.low = std::min(range.low, values[i]);
    range.high = std::max(range.high, values[i]);
  }
  return range;
}

/// Keeps of the coefficients, in place, the first or last along an axis; the shape loses the axis' degree.
void take_face(Shape& shape, double* b, int axis, bool last) {
  const std::size_t inner = shape.stride(axis);
  const std::size_t outer = inner * static_cast<std::size_t>(shape.degree[axis] + 1);
  const std::size_t size = shape.size();
  const std::size_t from = last ? outer - inner : 0;
  double* to = b;
  for (std::size_t base = 0; base < size; base += outer, to += inner)
    std::copy(b + base + from, b + base + from + inner, to);
  shape.degree[axis] = 0;
}

/// A descent that only bounds what others must stay below ends when it is this near to its minimum.
constexpr double rough_share = 1e-3;

/// Pieces to be looked at before a descent is tried on one that is not convex; then after twice as many, and
/// so on.
constexpr std::size_t patience = 64;

/// Slopes smaller than this many times the rounding of a coefficient may be 0.
constexpr double sure_slope = 16.0;

/// The lower triangular factor's inverse, magnitudes only.
Matrix magnitude_of_inverse(const Matrix& factor, int n) {
  Matrix inverse{};
  for (int j = 0; j < n; ++j) {
    inverse[j][j] = 1.0 / factor[j][j];
    for (int i = j + 1; i < n; ++i) {
      double sum = 0.0;
      for (int k = j; k < i; ++k) sum -= factor[i][k] * inverse[k][j];
      inverse[i][j] = sum / factor[i][i];
    }
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j) inverse[i][j] = std::abs(inverse[i][j]);
  return inverse;
}

/// Whether the Hessian is positive definite on the whole piece. Each of its entries has a range, from the
/// second differences of the coefficients: with the middles C = L Lᵀ and the half widths R, every Hessian is
/// L (I + E) Lᵀ with |E| ≤ |L⁻¹| R |L⁻ᵀ|, and positive definite where the row sums of that stay below 1. Axes
/// on which p does not depend beyond `rounding` are left out. @param work room for twice the coefficients.
bool is_convex(const Shape& shape, const double* b, const Vector& depends, double rounding, double* work) {
  std::array<int, max_axes> axis{};
  int count = 0;
  for (int a = 0; a < shape.axes; ++a) {
    if (depends[a] <= rounding) continue;
    if (shape.degree[a] < 2) return false;
    axis[count++] = a;
  }
  double* once = work;
  double* twice = work + shape.size();
  Matrix middle{};
  Matrix half{};
  // The diagonal first: it mostly tells.
  for (int apart = 0; apart < count; ++apart)
    for (int x = 0, y = apart; y < count; ++x, ++y) {
      const Shape first = difference(shape, axis[x], b, once);
      const Shape second = difference(first, axis[y], once, twice);
      const Range range = range_of(twice, second.size());
      if (apart == 0 && !(range.low > 0.0)) return false;
      const int n = shape.degree[axis[x]];
      const double scale = n * (apart == 0 ? n - 1 : shape.degree[axis[y]]);
      middle[x][y] = middle[y][x] = 0.5 * scale * (range.low + range.high);
      half[x][y] = half[y][x] = 0.5 * scale * (range.high - range.low);
    }
  if (!factor(middle, count)) return false;
  const Matrix inverse = magnitude_of_inverse(middle, count);
  for (int i = 0; i < count; ++i) {
    double sum = 0.0;
    for (int j = 0; j < count; ++j)
      for (int x = 0; x <= i; ++x)
        for (int y = 0; y <= j; ++y) sum += inverse[i][x] * half[x][y] * inverse[j][y];
    // Less than 1 by more than rounding of these few operations.
    if (!(sum < 1.0 - 1e-9)) return false;
  }
  return true;
}

struct Piece {
  Vector start{};
  Vector width{};
  Shape shape;
};

/// Shrinks the piece to the faces on which its minimum certainly stands. @returns whether lower values
/// certainly stand beyond one of these faces.
bool comes_lower_outside(Piece& piece, double* b, double rounding, const Joints& joints, Vector& depends,
                         double* work) {
  bool outside = false;
  for (int a = 0; a < piece.shape.axes; ++a) {
    depends[a] = 0.0;
    if (piece.shape.degree[a] == 0) continue;
    const Range along = range_of(work, difference(piece.shape, a, b, work).size());
    depends[a] = std::max(std::abs(along.low), std::abs(along.high));
    const bool rises = along.low > sure_slope * rounding;
    const bool falls = along.high < -sure_slope * rounding;
    if (!rises && !falls) continue;
    const bool inside = rises ? piece.start[a] > 0.0 : piece.start[a] + piece.width[a] < 1.0;
    outside = outside || inside || (rises ? joints.low[a] : joints.high[a]);
    take_face(piece.shape, b, a, falls);
    if (falls) piece.start[a] += piece.width[a];
    piece.width[a] = 0.0;
    a = -1;  // on the face other slopes may be clear
  }
  return outside;
}

/// The place of coefficient number `at` if the coefficients stood evenly spread.
Vector place_of(const Shape& shape, std::size_t at) {
  Vector u{};
  for (int a = 0; a < shape.axes; ++a) {
    const auto n = static_cast<std::size_t>(shape.degree[a]);
    if (n > 0) u[a] = static_cast<double>(at / shape.stride(a) % (n + 1)) / static_cast<double>(n);
  }
  return u;
}

/// Branch and bound over halved pieces of one polynomial.
class Minimization {
 public:
  Minimization(const Shape& shape, const double* coefficients, double cut, const Accuracy& accuracy,
               MinimizeScratch& scratch)
      : axes_(shape.axes), size_(shape.size()), cut_(cut), accuracy_(accuracy), scratch_(scratch) {
    scratch.reserve(size_);
    pieces_[0].start.fill(0.0);
    pieces_[0].width.fill(1.0);
    pieces_[0].shape = shape;
    std::copy(coefficients, coefficients + size_, scratch.level(0, size_));
    best_.value = cut;
  }

  Minimum run(const Joints& joints) {
    // No squared distance is below 0: what is found at about 0 is the answer. Else a set of zeros (more axes
    // than dimensions) would be cut into pieces without end: none of them can be left out, none is convex.
    const double zero = accuracy_.distance * accuracy_.distance + 4.0 * accuracy_.rounding;
    while (count_ > 0 && (first_ || best_.value > zero)) {
      Piece piece = pieces_[--count_];
      look_at(piece, joints);
    }
    return best_;
  }

 private:
  /// What a piece must stay below to matter.
  [[nodiscard]] double worthwhile() const {
    if (!best_.found) return cut_;
    const double distance = std::sqrt(std::max(best_.value, 0.0));
    const double near = distance > accuracy_.distance ? distance - accuracy_.distance : 0.0;
    return std::min(best_.value - accuracy_.rounding, near * near);
  }

  void offer(const Piece& piece, const Vector& u, double value) {
    if (!(value < best_.value || (value == best_.value && !best_.found))) return;
    best_.found = true;
    best_.value = value;
    for (int a = 0; a < axes_; ++a) best_.u[a] = std::clamp(piece.start[a] + u[a] * piece.width[a], 0.0, 1.0);
  }

  /// Leaves a piece out, descends in it, or halves it.
  void look_at(Piece& piece, const Joints& joints) {
    const double rounding = accuracy_.rounding;
    double* b = scratch_.level(count_, size_);
    double* work = scratch_.level(max_halvings + 2, size_);
    if (*std::min_element(b, b + piece.shape.size()) > worthwhile()) return;
    Vector depends{};
    const bool outside = comes_lower_outside(piece, b, rounding, joints, depends, work);
    if (outside && !first_) return;
    const auto lowest = static_cast<std::size_t>(std::min_element(b, b + piece.shape.size()) - b);
    if (b[lowest] > worthwhile()) return;
    int widest = 0;
    for (int a = 1; a < axes_; ++a)
      if (depends[a] > depends[widest]) widest = a;
    const bool convex = !outside && is_convex(piece.shape, b, depends, rounding, work);
    // Where many pieces are not convex, a better value now and then leaves many of them out.
    const bool again = ++looked_ >= patience && std::has_single_bit(looked_);
    if (convex || first_ || again) {
      // Of a patch that is left out, the lowest place of its face still bounds what others must stay below.
      const double enough = first_ && !convex ? rough_share * std::abs(b[lowest]) + rounding : rounding;
      const Descent end = descend(piece.shape, b, place_of(piece.shape, lowest), enough);
      offer(piece, end.u, end.value);
      if (outside || (convex && end.value - end.gap > worthwhile() - rounding)) return;
    }
    first_ = false;
    if (depends[widest] <= rounding || piece.width[widest] < 1e-12 || count_ + 2 > max_halvings) {
      // So small that its polynomial is as good as quadratic: what a descent finds there is the answer.
      const Descent end = descend(piece.shape, b, place_of(piece.shape, lowest), rounding);
      offer(piece, end.u, end.value);
      return;
    }
    halve(piece, widest, b);
  }

  void halve(Piece& piece, int axis, double* b) {
    const std::size_t used = piece.shape.size();
    double* high = scratch_.level(count_ + 1, size_);
    split(piece.shape, axis, b, b, high);
    piece.width[axis] *= 0.5;
    pieces_[count_] = pieces_[count_ + 1] = piece;
    pieces_[count_ + 1].start[axis] += piece.width[axis];
    // The nearer half is looked at first.
    if (*std::min_element(b, b + used) < *std::min_element(high, high + used)) {
      std::swap_ranges(b, b + used, high);
      std::swap(pieces_[count_], pieces_[count_ + 1]);
    }
    count_ += 2;
  }

  int axes_;
  std::size_t size_;
  double cut_;
  Accuracy accuracy_;
  MinimizeScratch& scratch_;
  std::array<Piece, max_halvings + 1> pieces_;
  std::size_t count_ = 1;
  std::size_t looked_ = 0;
  bool first_ = true;
  Minimum best_;
};

}  // namespace

Minimum minimize(const Shape& shape, const double* coefficients, double cut, const Accuracy& accuracy,
                 const Joints& joints, MinimizeScratch& scratch) {
  return Minimization(shape, coefficients, cut, accuracy, scratch).run(joints);
}

}  // namespace eigenpose::bernstein
