#include "core/manifold/axis_basis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/base/angle.h"

namespace eigenpose {

namespace {

constexpr std::size_t max_points = max_spline_degree + 1;

void check(const SampleAxis& axis, int degree) {
  const std::string name = "axis \"" + axis.dof.name + "\": ";
  const auto& x = axis.samples;
  if (degree < 1 || degree > max_spline_degree)
    throw std::invalid_argument("spline degree " + std::to_string(degree) + " is not 1, 2 or 3");
  if (x.empty()) throw std::invalid_argument(name + "needs samples, got 0");
  if (axis.dof.periodic && x.size() == 2)
    throw std::invalid_argument(name + "a periodic axis needs at least 3 samples, got 2");
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]))
      throw std::invalid_argument(name + "sample " + std::to_string(i) + " is not finite");
    if (i > 0 && !(x[i - 1] < x[i]))
      throw std::invalid_argument(name + "samples must ascend, but sample " + std::to_string(i) + " is " +
                                  std::to_string(x[i]) + " after " + std::to_string(x[i - 1]));
  }
  if (axis.dof.periodic && (x.front() < axis.dof.lower || x.back() >= axis.dof.upper))
    throw std::invalid_argument(name + "samples " + std::to_string(x.front()) + " … " +
                                std::to_string(x.back()) + " do not lie in [" +
                                std::to_string(axis.dof.lower) + ", " + std::to_string(axis.dof.upper) + ")");
}

/// Bernstein polynomials of degree n at u, or their derivatives with respect to u.
void bernstein(int n, int order, double u, std::array<double, max_points>& out) {
  out.fill(0.0);
  if (order > n) return;
  // Values of degree n − order, raised by differences: d/du B_i^n = n (B_{i−1}^{n−1} − B_i^{n−1}).
  const int low = n - order;
  out[0] = 1.0;
  for (int d = 1; d <= low; ++d)
    for (int i = d; i >= 0; --i) out[i] = (i < d ? (1.0 - u) * out[i] : 0.0) + (i > 0 ? u * out[i - 1] : 0.0);
  for (int d = low + 1; d <= n; ++d)
    for (int i = d; i >= 0; --i) out[i] = d * ((i > 0 ? out[i - 1] : 0.0) - (i < d ? out[i] : 0.0));
}

}  // namespace

AxisBasis::AxisBasis(const SampleAxis& axis, int degree) : samples_(axis.samples), dof_(axis.dof) {
  check(axis, degree);
  const std::size_t n = samples_.size();
  periodic_ = dof_.periodic && n > 1;
  degree_ = periodic_ ? degree : std::min(degree, static_cast<int>(n) - 1);
  const bool ghosts = !periodic_ && degree_ >= 2;
  coefficients_ = n + (ghosts ? 2 : 0);
  // The first coefficient on segment s is centred on sample s − 1 for degrees 2 and 3, on sample s for
  // degree 1.
  offset_ = periodic_ && degree_ >= 2 ? n - 1 : 0;

  if (degree_ == 0) {
    breaks_ = {samples_[0], samples_[0]};
    extraction_ = {1.0};
    return;
  }
  const bool even = degree_ % 2 == 0;
  const std::size_t segments = periodic_ || even ? n : n - 1;
  for (std::size_t s = 0; s <= segments; ++s) breaks_.push_back(knot(static_cast<std::ptrdiff_t>(s)));
  if (!periodic_) {
    breaks_.front() = samples_.front();
    breaks_.back() = samples_.back();
  }
  extraction_.resize(segments * static_cast<std::size_t>((degree_ + 1) * (degree_ + 1)));
  for (std::size_t s = 0; s < segments; ++s) extract(s);
}

/// Sample i, continued beyond the ends: by the period, or by the spacing at the end.
double AxisBasis::sample(std::ptrdiff_t i) const {
  const auto n = static_cast<std::ptrdiff_t>(samples_.size());
  if (i >= 0 && i < n) return samples_[static_cast<std::size_t>(i)];
  if (periodic_) {
    const std::ptrdiff_t turn = i >= 0 ? i / n : -((n - 1 - i) / n);
    return samples_[static_cast<std::size_t>(i - turn * n)] + static_cast<double>(turn) * dof_.period();
  }
  if (i < 0) return samples_[0] + static_cast<double>(i) * (samples_[1] - samples_[0]);
  return samples_.back() + static_cast<double>(i - n + 1) * (samples_.back() - samples_[samples_.size() - 2]);
}

double AxisBasis::knot(std::ptrdiff_t i) const {
  return degree_ % 2 == 0 ? 0.5 * (sample(i - 1) + sample(i)) : sample(i);
}

/// Bézier point j of a segment is the blossom of the spline at (a, …, a, b, …, b) with j times b: de Boor's
/// scheme with these arguments, applied to each unit vector of coefficients.
void AxisBasis::extract(std::size_t segment) {
  const int p = degree_;
  const double a = breaks_[segment];
  const double b = breaks_[segment + 1];
  std::array<double, 2 * max_spline_degree> local{};
  for (int i = 0; i < 2 * p; ++i) local[i] = knot(static_cast<std::ptrdiff_t>(segment) - (p - 1) + i);
  double* matrix = extraction_.data() + segment * static_cast<std::size_t>((p + 1) * (p + 1));
  for (int j = 0; j <= p; ++j)
    for (int unit = 0; unit <= p; ++unit) {
      std::array<double, max_points> d{};
      d[unit] = 1.0;
      for (int level = 1; level <= p; ++level) {
        const double argument = level <= j ? b : a;
        for (int k = p; k >= level; --k) {
          const double alpha = (argument - local[k - 1]) / (local[k + p - level] - local[k - 1]);
          d[k] = (1.0 - alpha) * d[k - 1] + alpha * d[k];
        }
      }
      matrix[j * (p + 1) + unit] = d[p];
    }
}

AxisBasis::Location AxisBasis::locate(double q) const {
  if (degree_ == 0) return {};
  if (periodic_)
    q = wrap(q, breaks_.front(), dof_.period());
  else
    q = std::clamp(q, breaks_.front(), breaks_.back());
  const auto above = std::upper_bound(breaks_.begin() + 1, breaks_.end() - 1, q);
  const auto s = static_cast<std::size_t>(above - breaks_.begin()) - 1;
  return {s, std::clamp((q - breaks_[s]) / (breaks_[s + 1] - breaks_[s]), 0.0, 1.0)};
}

double AxisBasis::position(Location place) const {
  const double a = breaks_[place.segment];
  const double b = breaks_[place.segment + 1];
  const double q = std::clamp(a + place.u * (b - a), a, b);
  return periodic_ ? dof_.canonical(q) : q;
}

void AxisBasis::weights(Location place, int order, std::span<double> weights) const {
  std::array<double, max_points> values{};
  bernstein(degree_, order, place.u, values);
  const double width = breaks_[place.segment + 1] - breaks_[place.segment];
  const double scale = order == 0 || degree_ == 0 ? 1.0 : std::pow(width, -order);
  const auto matrix = extraction(place.segment);
  const auto points = static_cast<std::size_t>(degree_ + 1);
  for (std::size_t k = 0; k < points; ++k) {
    double sum = 0.0;
    for (std::size_t j = 0; j < points; ++j) sum += values[j] * matrix[j * points + k];
    weights[k] = sum * scale;
  }
}

std::vector<double> AxisBasis::greville_abscissae() const {
  // Coefficient i is the first of segment i − offset_; ξ is the mean of the `degree` knots inside its
  // support.
  std::vector<double> result(coefficients_, 0.0);
  if (degree_ == 0) return result;
  const bool ghosts = coefficients_ > samples_.size();
  for (std::size_t i = 0; i < coefficients_; ++i) {
    const auto centre = static_cast<std::ptrdiff_t>(i) - (ghosts ? 1 : 0);
    if (degree_ == 1) result[i] = sample(centre);
    if (degree_ == 2) result[i] = 0.5 * (knot(centre) + knot(centre + 1));
    if (degree_ == 3) result[i] = (knot(centre - 1) + knot(centre) + knot(centre + 1)) / 3.0;
  }
  return result;
}

Eigen::MatrixXd AxisBasis::interpolation_matrix() const {
  const auto count = static_cast<Eigen::Index>(coefficients_);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(count, count);
  std::array<double, max_points> w{};
  const auto add = [&](Eigen::Index row, Location place, int order, double factor) {
    weights(place, order, w);
    for (int k = 0; k <= degree_; ++k)
      matrix(row, static_cast<Eigen::Index>(coefficient(place.segment, k))) += factor * w[k];
  };
  for (std::size_t i = 0; i < samples_.size(); ++i)
    add(static_cast<Eigen::Index>(i), locate(samples_[i]), 0, 1.0);
  if (coefficients_ > samples_.size()) {
    // Not a knot: the highest derivative, constant on each segment, does not jump at the outermost inner
    // knots.
    const auto row = static_cast<Eigen::Index>(samples_.size());
    const std::size_t last = segments() - 1;
    const double near = std::pow(end(0) - begin(0), degree_);
    const double far = std::pow(end(last) - begin(last), degree_);
    add(row, {0, 0.5}, degree_, near);
    add(row, {1, 0.5}, degree_, -near);
    add(row + 1, {last, 0.5}, degree_, far);
    add(row + 1, {last - 1, 0.5}, degree_, -far);
  }
  return matrix;
}

}  // namespace eigenpose
