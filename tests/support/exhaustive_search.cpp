#include "tests/support/exhaustive_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "core/base/grid.h"
#include "core/base/linear_algebra.h"

namespace eigenpose {

namespace {

/// Samples per patch and axis, by the number of axes that are not constant.
constexpr std::array<int, max_manifold_dofs + 1> samples_per_axis = {1, 12, 6, 4, 3};
/// Different patches from which Newton starts.
constexpr std::array<std::size_t, max_manifold_dofs + 1> seeds = {1, 12, 16, 32, 64};

/// Real roots of a + bx + cx² + dx³, at most 3. Cardano's formulas, polished by Newton.
int cubic_roots(double a, double b, double c, double d, std::array<double, 3>& roots) {
  int count = 0;
  const double scale = std::abs(a) + std::abs(b) + std::abs(c) + std::abs(d);
  if (scale == 0.0) return 0;
  constexpr double negligible = 1e-12;
  if (std::abs(d) > negligible * scale) {
    const double p = c / d / 3.0;
    const double q = b / d;
    const double r = a / d;
    const double m = (3.0 * p * p - q) / 3.0;              // −(depressed linear term)/3
    const double n = (2.0 * p * p * p - p * q + r) / 2.0;  // half of the constant term
    const double discriminant = n * n - m * m * m;
    if (discriminant <= 0.0 && m > 0.0) {
      const double angle = std::acos(std::clamp(-n / std::sqrt(m * m * m), -1.0, 1.0)) / 3.0;
      for (int k = 0; k < 3; ++k)
        roots[count++] = 2.0 * std::sqrt(m) * std::cos(angle + 2.0 * std::numbers::pi * k / 3.0) - p;
    } else {
      const double s = std::cbrt(std::abs(n) + std::sqrt(std::max(discriminant, 0.0)));
      const double x = n > 0.0 ? -s : s;
      roots[count++] = x + (x != 0.0 ? m / x : 0.0) - p;
    }
  } else if (std::abs(c) > negligible * scale) {
    const double discriminant = b * b - 4.0 * a * c;
    if (discriminant < 0.0) return 0;
    const double s = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
    roots[count++] = s / c;
    if (s != 0.0) roots[count++] = a / s;
  } else if (b != 0.0) {
    roots[count++] = -a / b;
  }
  for (int i = 0; i < count; ++i)
    for (int polish = 0; polish < 3; ++polish) {
      const double x = roots[i];
      const double slope = b + x * (2.0 * c + 3.0 * d * x);
      const double value = a + x * (b + x * (c + d * x));
      if (slope != 0.0 && std::abs(value / slope) < 0.1) roots[i] = x - value / slope;
    }
  return count;
}

/// Which DOFs the manifold depends on.
std::vector<std::size_t> active_axes(const Manifold& manifold) {
  std::vector<std::size_t> axes;
  for (std::size_t a = 0; a < manifold.dofs(); ++a)
    if (manifold.bases()[a].degree() > 0) axes.push_back(a);
  return axes;
}

/// Damped Newton on ½‖f(q) − point‖² over all of the manifold, open axes clamped.
class NewtonDescent {
 public:
  NewtonDescent(const Manifold& f, const Eigen::VectorXd& point)
      : f_(f), point_(point), unit_(static_cast<Eigen::Index>(f.dofs())) {
    // Steps are measured in segments, so that a millimetre and a degree weigh the same.
    for (std::size_t a = 0; a < f.dofs(); ++a) {
      const AxisBasis& basis = f.bases()[a];
      const double width =
          (basis.end(basis.segments() - 1) - basis.begin(0)) / static_cast<double>(basis.segments());
      unit_[static_cast<Eigen::Index>(a)] = width > 0.0 ? width : 1.0;
    }
  }

  ClosestPoint from(std::vector<double> q) {
    clamp(q);
    double value = squared_distance(q);
    double damping = 1e-3;
    for (int iteration = 0; iteration < 200; ++iteration)
      if (!step(q, value, damping)) break;
    ClosestPoint result;
    std::copy(q.begin(), q.end(), result.q.begin());
    result.distance = std::sqrt(value);
    return result;
  }

 private:
  void clamp(std::vector<double>& at) const {
    for (std::size_t a = 0; a < f_.dofs(); ++a) {
      const AxisBasis& basis = f_.bases()[a];
      at[a] = basis.position(basis.locate(at[a]));
    }
  }
  [[nodiscard]] double squared_distance(const std::vector<double>& q) const {
    return (f_.evaluate(q) - point_).squaredNorm();
  }

  /// Gradient, Hessian and its Gauss–Newton part at q, in units; axes that cannot move are held.
  void expand(const std::vector<double>& q) {
    const std::size_t m = f_.dofs();
    const ManifoldPoint at = f_.evaluate_with_jacobian(q);
    const Eigen::VectorXd residual = at.value - point_;
    const Eigen::MatrixXd jacobian = at.jacobian * unit_.asDiagonal();
    gradient_ = jacobian.transpose() * residual;
    gauss_ = jacobian.transpose() * jacobian;
    hessian_ = gauss_;
    for (std::size_t a = 0; a < m; ++a)
      for (std::size_t b = a; b < m; ++b) {
        std::vector<int> orders(m, 0);
        ++orders[a];
        ++orders[b];
        f_.derivative(q, orders, second_);
        const auto i = static_cast<Eigen::Index>(a);
        const auto j = static_cast<Eigen::Index>(b);
        const double extra = second_.dot(residual) * unit_[i] * unit_[j];
        hessian_(i, j) += extra;
        if (i != j) hessian_(j, i) += extra;
      }
    for (std::size_t a = 0; a < m; ++a) {
      const AxisBasis& basis = f_.bases()[a];
      const auto i = static_cast<Eigen::Index>(a);
      const bool open = !f_.axes()[a].dof.periodic;
      const bool held = basis.degree() == 0 || (open && q[a] <= basis.begin(0) && gradient_[i] > 0.0) ||
                        (open && q[a] >= basis.end(basis.segments() - 1) && gradient_[i] < 0.0);
      if (!held) continue;
      gradient_[i] = 0.0;
      hessian_.row(i).setZero();
      hessian_.col(i).setZero();
      hessian_(i, i) = 1.0;
    }
  }

  /// One step that lowers the value. False where none does, or it hardly moves.
  bool step(std::vector<double>& q, double& value, double& damping) {
    expand(q);
    for (; damping < 1e12; damping *= 10.0) {
      Eigen::MatrixXd damped = hessian_;
      damped.diagonal() += damping * (gauss_.diagonal().array() + 1e-12 * (1.0 + gauss_.trace())).matrix();
      const auto solved = solve_positive_definite_in_place(damped, gradient_);
      if (!solved) continue;
      std::vector<double> next = q;
      for (std::size_t a = 0; a < q.size(); ++a) {
        const auto i = static_cast<Eigen::Index>(a);
        next[a] -= std::clamp((*solved)(i, 0), -1.0, 1.0) * unit_[i];
      }
      clamp(next);
      const double trial = squared_distance(next);
      if (!(trial < value)) continue;
      const bool moved = (value - trial) > 1e-17 * (1e-6 + value) || solved->cwiseAbs().maxCoeff() > 1e-9;
      value = trial;
      q = next;
      damping = std::max(damping * 0.1, 1e-15);
      return moved;
    }
    return false;
  }

  const Manifold& f_;
  const Eigen::VectorXd& point_;
  Eigen::VectorXd unit_;
  Eigen::VectorXd gradient_;
  Eigen::MatrixXd gauss_;
  Eigen::MatrixXd hessian_;
  Eigen::VectorXd second_;
};

}  // namespace

ExhaustiveSearch::ExhaustiveSearch(std::span<const Manifold> manifolds) : ManifoldSearch(manifolds) {
  if (manifolds.empty()) throw std::invalid_argument("a search needs at least one manifold, got 0");
  for (const Manifold& manifold : manifolds) {
    if (manifold.dimensions() != manifolds[0].dimensions())
      throw std::invalid_argument("a manifold has " + std::to_string(manifold.dimensions()) +
                                  " dimensions, the first one has " +
                                  std::to_string(manifolds[0].dimensions()));
    Scan scan;
    const auto axes = active_axes(manifold);
    scan.closed_form = axes.size() == 1 && manifold.bases()[axes[0]].degree() <= 2;
    if (scan.closed_form)
      cut_segments(manifold, axes[0], scan);
    else
      cut_samples(manifold, axes.size(), scan);
    scans_.push_back(std::move(scan));
  }
}

void ExhaustiveSearch::cut_segments(const Manifold& manifold, std::size_t axis, Scan& scan) {
  const AxisBasis& basis = manifold.bases()[axis];
  scan.terms.resize(manifold.dimensions(), 3 * static_cast<Eigen::Index>(basis.segments()));
  for (std::size_t s = 0; s < basis.segments(); ++s) {
    const double begin = basis.begin(s);
    const double width = basis.end(s) - begin;
    scan.starts.push_back(begin);
    scan.starts.push_back(width);
    // A quadratic is known from three inner points, whatever basis wrote it.
    Eigen::VectorXd value[3];
    for (int i = 0; i < 3; ++i) {
      std::vector<double> q(manifold.dofs(), 0.0);
      q[axis] = begin + width * (0.25 + 0.25 * i);
      value[i] = manifold.evaluate(q);
    }
    const auto column = static_cast<Eigen::Index>(3 * s);
    scan.terms.col(column) = 3.0 * value[0] - 3.0 * value[1] + value[2];
    scan.terms.col(column + 1) = -10.0 * value[0] + 16.0 * value[1] - 6.0 * value[2];
    scan.terms.col(column + 2) = 8.0 * (value[0] - 2.0 * value[1] + value[2]);
  }
}

void ExhaustiveSearch::cut_samples(const Manifold& manifold, std::size_t active_axes, Scan& scan) {
  const auto per_axis = static_cast<std::size_t>(samples_per_axis[active_axes]);
  std::vector<std::size_t> segments;
  std::vector<std::size_t> within;
  for (const AxisBasis& basis : manifold.bases()) {
    segments.push_back(basis.segments());
    within.push_back(basis.degree() > 0 ? per_axis : 1);
  }
  const Grid patches(segments);
  const Grid inside(within);
  scan.samples.resize(manifold.dimensions(), static_cast<Eigen::Index>(patches.size() * inside.size()));
  std::vector<double> q(manifold.dofs());
  for (std::size_t patch = 0; patch < patches.size(); ++patch)
    for (std::size_t sample = 0; sample < inside.size(); ++sample) {
      for (std::size_t a = 0; a < manifold.dofs(); ++a) {
        const AxisBasis& basis = manifold.bases()[a];
        const double u = basis.degree() > 0 ? (static_cast<double>(inside.index(sample, a)) + 0.5) /
                                                  static_cast<double>(per_axis)
                                            : 0.0;
        q[a] = basis.position({patches.index(patch, a), u});
      }
      scan.samples.col(static_cast<Eigen::Index>(scan.patch.size())) = manifold.evaluate(q);
      scan.patch.push_back(patch);
      scan.q.insert(scan.q.end(), q.begin(), q.end());
    }
}

ClosestPoint ExhaustiveSearch::closest_by_roots(std::size_t manifold, const Eigen::VectorXd& point) const {
  const Scan& scan = scans_[manifold];
  double best = std::numeric_limits<double>::infinity();
  std::size_t segment = 0;
  double place = 0.0;
  for (std::size_t s = 0; 2 * s < scan.starts.size(); ++s) {
    const auto column = static_cast<Eigen::Index>(3 * s);
    const auto b = scan.terms.col(column + 1);
    const auto a = scan.terms.col(column + 2);
    double ee = 0.0, eb = 0.0, ea = 0.0, bb = 0.0, ab = 0.0, aa = 0.0;
    for (Eigen::Index k = 0; k < point.size(); ++k) {
      const double e = point[k] - scan.terms(k, column);
      ee += e * e;
      eb += e * b[k];
      ea += e * a[k];
      bb += b[k] * b[k];
      ab += a[k] * b[k];
      aa += a[k] * a[k];
    }
    std::array<double, 3> roots{};
    const int count = cubic_roots(-eb, bb - 2.0 * ea, 3.0 * ab, 2.0 * aa, roots);
    const auto look = [&](double u) {
      const double value = ee + u * (-2.0 * eb + u * (bb - 2.0 * ea + u * (2.0 * ab + u * aa)));
      if (value < best) {
        best = value;
        segment = s;
        place = u;
      }
    };
    look(0.0);
    look(1.0);
    for (int i = 0; i < count; ++i)
      if (roots[i] > 0.0 && roots[i] < 1.0) look(roots[i]);
  }
  const Manifold& f = manifolds()[manifold];
  ClosestPoint result;
  result.manifold = manifold;
  for (std::size_t a = 0; a < f.dofs(); ++a)
    result.q[a] =
        f.bases()[a].degree() == 0 ? f.bases()[a].begin(0) : f.bases()[a].position({segment, place});
  const auto column = static_cast<Eigen::Index>(3 * segment);
  result.distance = (point - scan.terms.col(column) - place * scan.terms.col(column + 1) -
                     place * place * scan.terms.col(column + 2))
                        .norm();
  return result;
}

ClosestPoint ExhaustiveSearch::closest_by_samples(std::size_t manifold, const Eigen::VectorXd& point) const {
  const Scan& scan = scans_[manifold];
  const Manifold& f = manifolds()[manifold];
  // The nearest sample of each patch, nearest patches first.
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < scan.patch.size(); ++i) {
    const double squared = (scan.samples.col(static_cast<Eigen::Index>(i)) - point).squaredNorm();
    if (i > 0 && scan.patch[i] == scan.patch[i - 1]) {
      order.back() = std::min(order.back(), {squared, i});
    } else {
      order.emplace_back(squared, i);
    }
  }
  std::sort(order.begin(), order.end());
  order.resize(std::min(order.size(), seeds[f.dofs()]));
  ClosestPoint best;
  best.distance = std::numeric_limits<double>::infinity();
  for (const auto& [squared, sample] : order) {
    const auto first = scan.q.begin() + static_cast<std::ptrdiff_t>(sample * f.dofs());
    const ClosestPoint found =
        NewtonDescent(f, point).from({first, first + static_cast<std::ptrdiff_t>(f.dofs())});
    if (found.distance < best.distance) best = found;
  }
  best.manifold = manifold;
  return best;
}

std::size_t ExhaustiveSearch::nearest_into(const Eigen::Ref<const Eigen::VectorXf>& point,
                                           std::span<ClosestPoint> results, double bound) const {
  if (point.size() != manifolds()[0].dimensions())
    throw std::invalid_argument("the manifolds have " + std::to_string(manifolds()[0].dimensions()) +
                                " dimensions, the point has " + std::to_string(point.size()));
  const Eigen::VectorXd exact = point.cast<double>();
  std::vector<ClosestPoint> all;
  for (std::size_t i = 0; i < scans_.size(); ++i) {
    all.push_back(scans_[i].closed_form ? closest_by_roots(i, exact) : closest_by_samples(i, exact));
    if (!(all.back().distance <= bound)) all.pop_back();
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const ClosestPoint& a, const ClosestPoint& b) { return a.distance < b.distance; });
  const std::size_t count = std::min(all.size(), results.size());
  std::copy_n(all.begin(), count, results.begin());
  return count;
}

std::size_t ExhaustiveSearch::memory() const {
  std::size_t bytes = scans_.capacity() * sizeof(Scan);
  for (const Scan& scan : scans_)
    bytes += scan.starts.capacity() * sizeof(double) +
             static_cast<std::size_t>(scan.terms.size()) * sizeof(double) +
             static_cast<std::size_t>(scan.samples.size()) * sizeof(double) +
             scan.q.capacity() * sizeof(double) + scan.patch.capacity() * sizeof(std::size_t);
  return bytes;
}

}  // namespace eigenpose
