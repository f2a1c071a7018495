#include "core/search/bernstein.h"

#include <algorithm>
#include <cmath>

namespace eigenpose::bernstein {

double binomial(int n, int k) {
  double value = 1.0;
  for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
  return value;
}

void apply(const Shape& shape, int axis, std::span<const double> matrix, int rows, const double* in,
           double* out) {
  const std::size_t inner = shape.stride(axis);
  const auto count = static_cast<std::size_t>(shape.degree[axis] + 1);
  const std::size_t outer = shape.size() / (inner * count);
  for (std::size_t o = 0; o < outer; ++o)
    for (std::size_t r = 0; r < static_cast<std::size_t>(rows); ++r) {
      double* target = out + (o * static_cast<std::size_t>(rows) + r) * inner;
      std::fill(target, target + inner, 0.0);
      for (std::size_t c = 0; c < count; ++c) {
        const double weight = matrix[r * count + c];
        const double* source = in + (o * count + c) * inner;
        for (std::size_t i = 0; i < inner; ++i) target[i] += weight * source[i];
      }
    }
}

void split(const Shape& shape, int axis, const double* in, double* low, double* high) {
  const std::size_t inner = shape.stride(axis);
  const int degree = shape.degree[axis];
  const auto count = static_cast<std::size_t>(degree + 1);
  const std::size_t outer = shape.size() / (inner * count);
  for (std::size_t o = 0; o < outer; ++o)
    for (std::size_t i = 0; i < inner; ++i) {
      const std::size_t base = o * count * inner + i;
      std::array<double, max_degree + 1> b{};
      for (int d = 0; d <= degree; ++d) b[d] = in[base + static_cast<std::size_t>(d) * inner];
      for (int level = 0; level <= degree; ++level) {
        low[base + static_cast<std::size_t>(level) * inner] = b[0];
        high[base + static_cast<std::size_t>(degree - level) * inner] = b[degree - level];
        for (int d = 0; d < degree - level; ++d) b[d] = 0.5 * (b[d] + b[d + 1]);
      }
    }
}

namespace {

void widen(const Shape& shape, std::vector<double> piece, int axis, int level, int levels, Range& range) {
  if (axis == shape.axes) {
    const auto [low, high] = std::minmax_element(piece.begin(), piece.end());
    range.low = std::min(range.low, *low);
    range.high = std::max(range.high, *high);
    return;
  }
  if (level == levels || shape.degree[axis] == 0)
    return widen(shape, std::move(piece), axis + 1, 0, levels, range);
  std::vector<double> high(piece.size());
  split(shape, axis, piece.data(), piece.data(), high.data());
  widen(shape, std::move(piece), axis, level + 1, levels, range);
  widen(shape, std::move(high), axis, level + 1, levels, range);
}

}  // namespace

Range range(const Shape& shape, std::span<const double> coefficients, int levels) {
  if (shape.axes == 1 && shape.degree[0] <= 2) {
    // Exact: the ends, and where the derivative of a quadratic vanishes.
    const double first = coefficients[0];
    const double last = coefficients.back();
    Range exact{std::min(first, last), std::max(first, last)};
    if (shape.degree[0] == 2) {
      const double rise = coefficients[1] - first;
      const double fall = coefficients[1] - last;
      if (rise * fall > 0.0) {
        const double extreme = first + rise * rise / (rise + fall);
        exact.low = std::min(exact.low, extreme);
        exact.high = std::max(exact.high, extreme);
      }
    }
    return exact;
  }
  Range result{coefficients[0], coefficients[0]};
  widen(shape, {coefficients.begin(), coefficients.end()}, 0, 0, levels, result);
  return result;
}

namespace {

/// One variable: a piece [start, start + width] of the unit interval.
struct CurvePiece {
  std::array<double, max_degree + 1> b;
  double start;
  double width;
};

/// Value of p at t, by de Casteljau.
double value_at(int degree, std::array<double, max_degree + 1> b, double t) {
  for (int level = degree; level > 0; --level)
    for (int d = 0; d < level; ++d) b[d] += t * (b[d + 1] - b[d]);
  return b[0];
}

/// Root of p′ on a convex piece with p′(0) < 0 < p′(1): Newton's method inside a shrinking bracket.
double convex_minimum(int degree, const std::array<double, max_degree + 1>& b) {
  // p′ / degree in powers of t: differences of differences, times binomials.
  std::array<double, max_degree> power;
  for (int i = 0; i < degree; ++i) power[i] = b[i + 1] - b[i];
  for (int order = 1; order < degree; ++order)
    for (int i = degree - 1; i >= order; --i) power[i] -= power[i - 1];
  double choose = 1.0;
  for (int i = 0; i < degree; ++i) {
    power[i] *= choose;
    choose *= static_cast<double>(degree - 1 - i) / (i + 1);
  }
  double low = 0.0;
  double high = 1.0;
  const double slope0 = b[1] - b[0];
  const double slope1 = b[degree] - b[degree - 1];
  double t = slope0 / (slope0 - slope1);
  for (int iteration = 0; iteration < 60; ++iteration) {
    double first = power[degree - 1];
    double second = 0.0;
    for (int i = degree - 2; i >= 0; --i) {
      second = second * t + first;
      first = first * t + power[i];
    }
    if (first > 0.0)
      high = t;
    else
      low = t;
    double next = second > 0.0 ? t - first / second : 0.5 * (low + high);
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const double step = std::abs(next - t);
    t = next;
    // Steps shrink quadratically: the next one is below rounding.
    if (step < 1e-9) break;
  }
  return t;
}

}  // namespace

Minimum minimize_curve(int degree, const double* coefficients, double cut, double rounding) {
  Minimum best;
  best.value = cut;
  std::array<CurvePiece, max_halvings + 1> pieces;
  std::size_t count = 1;
  std::copy(coefficients, coefficients + degree + 1, pieces[0].b.begin());
  pieces[0].start = 0.0;
  pieces[0].width = 1.0;
  const auto offer = [&](const CurvePiece& piece, double t, double value) {
    if (value < best.value || (value == best.value && !best.found)) {
      best.found = true;
      best.value = value;
      best.u[0] = std::clamp(piece.start + t * piece.width, 0.0, 1.0);
    }
  };
  while (count > 0) {
    const CurvePiece piece = pieces[--count];
    const auto& b = piece.b;
    double lowest = b[0];
    double bend = 0.0;
    for (int i = 1; i <= degree; ++i) lowest = std::min(lowest, b[i]);
    if (lowest > best.value - (best.found ? rounding : 0.0)) continue;
    for (int i = 0; i + 2 <= degree; ++i) bend = std::min(bend, b[i] - 2.0 * b[i + 1] + b[i + 2]);
    if (bend >= -rounding || count + 2 > max_halvings) {
      if (b[1] >= b[0] && bend >= -rounding) {
        offer(piece, 0.0, b[0]);
      } else if (b[degree] <= b[degree - 1] && bend >= -rounding) {
        offer(piece, 1.0, b[degree]);
      } else if (b[1] < b[0] && b[degree] > b[degree - 1]) {
        const double t = convex_minimum(degree, b);
        offer(piece, t, value_at(degree, b, t));
      } else {
        offer(piece, b[0] <= b[degree] ? 0.0 : 1.0, std::min(b[0], b[degree]));
      }
      continue;
    }
    offer(piece, 0.0, b[0]);
    offer(piece, 1.0, b[degree]);
    CurvePiece& low = pieces[count];
    CurvePiece& high = pieces[count + 1];
    split(Shape{1, {degree}}, 0, b.data(), low.b.data(), high.b.data());
    low.width = high.width = 0.5 * piece.width;
    low.start = piece.start;
    high.start = piece.start + low.width;
    // The half with the lower end is looked at first.
    if (b[0] < b[degree]) std::swap(low, high);
    count += 2;
  }
  return best;
}

}  // namespace eigenpose::bernstein
