#include "core/search/patch_set.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

namespace eigenpose {

namespace {

/// Rounding error of the coefficients of D, relative to ‖e‖² + size².
constexpr double relative_rounding = 1e-15;

/// (2p+1) × (p+1): coefficients of degree p written with degree 2p.
const std::array<double, 28>& elevation(int p) {
  static const auto table = [] {
    std::array<std::array<double, 28>, 4> t{};
    for (int degree = 1; degree <= 3; ++degree)
      for (int i = 0; i <= 2 * degree; ++i)
        for (int j = 0; j <= degree; ++j) {
          const int rest = i - j;
          t[degree][static_cast<std::size_t>(i * (degree + 1) + j)] =
              rest < 0 || rest > degree ? 0.0
                                        : bernstein::binomial(degree, j) * bernstein::binomial(degree, rest) /
                                              bernstein::binomial(2 * degree, i);
        }
    return t;
  }();
  return table[static_cast<std::size_t>(p)];
}

/// Two doubles at a time, in the baseline instructions of every x86-64: the same sums on every machine.
using Pair = double __attribute__((vector_size(16)));

Pair load(const double* p) {
  Pair v;
  std::memcpy(&v, p, sizeof v);
  return v;
}

struct Scratch {
  std::vector<double> a;
  std::vector<double> b;
  bernstein::MinimizeScratch minimize;
};

/// Memory of a thread; grows to the largest patch it has seen.
Scratch& scratch() {
  thread_local Scratch memory;
  return memory;
}

}  // namespace

PatchSet::PatchSet(std::span<const Manifold> manifolds) : manifolds_(manifolds) {
  if (manifolds.empty()) throw std::invalid_argument("a search needs at least one manifold, got 0");
  dimensions_ = static_cast<std::size_t>(manifolds[0].dimensions());
  for (std::size_t i = 0; i < manifolds.size(); ++i)
    if (static_cast<std::size_t>(manifolds[i].dimensions()) != dimensions_)
      throw std::invalid_argument("manifold " + std::to_string(i) + " has " +
                                  std::to_string(manifolds[i].dimensions()) +
                                  " dimensions, the first one has " + std::to_string(dimensions_));
  for (const Manifold& manifold : manifolds) add_family(manifold);
}

void PatchSet::add_family(const Manifold& manifold) {
  Family family;
  std::size_t patches = 1;
  for (std::size_t a = 0; a < manifold.dofs(); ++a) {
    const AxisBasis& basis = manifold.bases()[a];
    patches *= basis.segments();
    if (basis.degree() == 0) continue;
    const int axis = family.shape.axes++;
    family.squared.axes = family.shape.axes;
    family.axis[axis] = a;
    family.shape.degree[axis] = basis.degree();
    family.squared.degree[axis] = 2 * basis.degree();
    family.middle =
        family.middle * static_cast<std::size_t>(basis.degree() + 1) + (basis.degree() >= 2 ? 1 : 0);
  }
  family.points = family.shape.size();
  family.norms = family.squared.size();
  family.first_patch = manifold_of_.size();
  family.first_column = columns_.size();
  family.first_norm = norms_.size();
  families_.push_back(family);
  for (std::size_t local = 0; local < patches; ++local) {
    manifold_of_.push_back(static_cast<std::uint32_t>(families_.size() - 1));
    add_patch(manifold, manifold_of_.size() - 1);
  }
}

PatchSet::Segments PatchSet::segments_of(std::size_t patch) const {
  const std::uint32_t owner = manifold_of_[patch];
  std::size_t rest = patch - families_[owner].first_patch;
  Segments segments{};
  const auto bases = manifolds_[owner].bases();
  for (std::size_t a = bases.size(); a-- > 0;) {
    segments[a] = rest % bases[a].segments();
    rest /= bases[a].segments();
  }
  return segments;
}

void PatchSet::add_patch(const Manifold& manifold, std::size_t patch) {
  const Family& family = families_.back();
  const auto segments = segments_of(patch);
  const bernstein::Shape& shape = family.shape;
  for (std::size_t point = 0; point < family.points; ++point) {
    std::array<std::size_t, max_manifold_dofs> k{};
    for (int a = 0; a < shape.axes; ++a)
      k[family.axis[a]] = point / shape.stride(a) % static_cast<std::size_t>(shape.degree[a] + 1);
    std::size_t column = 0;
    for (std::size_t a = 0; a < manifold.dofs(); ++a) {
      const AxisBasis& basis = manifold.bases()[a];
      column = column * basis.coefficients() + basis.coefficient(segments[a], static_cast<int>(k[a]));
    }
    columns_.push_back(static_cast<std::uint32_t>(column));
  }
  // Bernstein coefficients of ‖f − C‖²: products of the Bézier points, C(p,j)C(p,k)/C(2p,j+k) each axis.
  Eigen::MatrixXd points = bezier(patch);
  const std::uint32_t middle = columns_[columns_.size() - family.points + family.middle];
  points.colwise() -= manifold.coefficients().col(middle);
  const Eigen::MatrixXd products = points.transpose() * points;
  const std::size_t first = norms_.size();
  norms_.resize(first + family.norms, 0.0);
  // Where the product of points x and y of one axis goes, and with what weight.
  std::array<std::array<double, 16>, max_manifold_dofs> share{};
  for (int a = 0; a < shape.axes; ++a) {
    const int p = shape.degree[a];
    for (int x = 0; x <= p; ++x)
      for (int y = 0; y <= p; ++y)
        share[a][4 * x + y] =
            bernstein::binomial(p, x) * bernstein::binomial(p, y) / bernstein::binomial(2 * p, x + y);
  }
  for (std::size_t i = 0; i < family.points; ++i)
    for (std::size_t j = 0; j < family.points; ++j) {
      std::size_t at = 0;
      double weight = 1.0;
      std::size_t rest_i = i;
      std::size_t rest_j = j;
      std::size_t stride = 1;
      for (int a = shape.axes; a-- > 0;) {
        const auto width = static_cast<std::size_t>(shape.degree[a] + 1);
        const std::size_t x = rest_i % width;
        const std::size_t y = rest_j % width;
        rest_i /= width;
        rest_j /= width;
        at += (x + y) * stride;
        stride *= 2 * width - 1;
        weight *= share[a][4 * x + y];
      }
      norms_[first + at] += weight * products(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
}

std::size_t PatchSet::memory() const {
  return families_.capacity() * sizeof(Family) + manifold_of_.capacity() * sizeof(std::uint32_t) +
         columns_.capacity() * sizeof(std::uint32_t) + norms_.capacity() * sizeof(double);
}

Eigen::MatrixXd PatchSet::bezier(std::size_t patch) const {
  const Family& family = families_[manifold_of_[patch]];
  const Manifold& manifold = manifolds_[manifold_of_[patch]];
  const auto segments = segments_of(patch);
  const auto count = static_cast<Eigen::Index>(family.points);
  // Rows of the transposed net are tensors of numbers, one per dimension.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> net(manifold.dimensions(), count);
  const std::size_t local = patch - family.first_patch;
  for (Eigen::Index i = 0; i < count; ++i)
    net.col(i) = manifold.coefficients().col(
        columns_[family.first_column + local * family.points + static_cast<std::size_t>(i)]);
  std::vector<double> out(family.points);
  for (Eigen::Index k = 0; k < net.rows(); ++k)
    for (int a = 0; a < family.shape.axes; ++a) {
      const auto matrix = manifold.bases()[family.axis[a]].extraction(segments[family.axis[a]]);
      bernstein::apply(family.shape, a, matrix, family.shape.degree[a] + 1, net.row(k).data(), out.data());
      std::copy(out.begin(), out.end(), net.row(k).data());
    }
  return net;
}

bool PatchSet::closest_on_quadratic_curve(const Family& family, std::size_t local, const double* point,
                                          double cut, PatchPoint& result) const {
  const Manifold& manifold = manifolds_[result.manifold];
  const std::uint32_t* columns = columns_.data() + family.first_column + 3 * local;
  const double* coefficients = manifold.coefficients().data();
  const double* before = coefficients + columns[0] * dimensions_;
  const double* centre = coefficients + columns[1] * dimensions_;
  const double* after = coefficients + columns[2] * dimensions_;
  Pair sum_ee{};
  Pair sum_before{};
  Pair sum_after{};
  std::size_t i = 0;
  for (; i + 2 <= dimensions_; i += 2) {
    const Pair c = load(centre + i);
    const Pair e = load(point + i) - c;
    sum_ee += e * e;
    sum_before += e * (load(before + i) - c);
    sum_after += e * (load(after + i) - c);
  }
  double ee = sum_ee[0] + sum_ee[1];
  double g0 = sum_before[0] + sum_before[1];
  double g2 = sum_after[0] + sum_after[1];
  for (; i < dimensions_; ++i) {
    const double e = point[i] - centre[i];
    ee += e * e;
    g0 += e * (before[i] - centre[i]);
    g2 += e * (after[i] - centre[i]);
  }
  const double* x = manifold.bases()[family.axis[0]].extraction(local).data();
  const double p0 = x[0] * g0 + x[2] * g2;
  const double p1 = x[3] * g0 + x[5] * g2;
  const double p2 = x[6] * g0 + x[8] * g2;
  const double* n = norms_.data() + family.first_norm + 5 * local;
  const double d[5] = {ee - 2.0 * p0 + n[0], ee - (p0 + p1) + n[1], ee - (p0 + 4.0 * p1 + p2) / 3.0 + n[2],
                       ee - (p1 + p2) + n[3], ee - 2.0 * p2 + n[4]};
  if (std::min({d[0], d[1], d[2], d[3], d[4]}) > cut) return false;
  const double rounding = relative_rounding * (ee + n[0] + n[4]);
  const bernstein::Minimum minimum = bernstein::minimize_curve(4, d, cut, rounding);
  if (!minimum.found) return false;
  result.u = {};
  result.u[family.axis[0]] = minimum.u[0];
  result.squared_distance = std::max(minimum.value, 0.0);
  return true;
}

bool PatchSet::closest(std::size_t patch, const double* point, double cut, PatchPoint& result) const {
  const std::uint32_t owner = manifold_of_[patch];
  const Family& family = families_[owner];
  const std::size_t local = patch - family.first_patch;
  result.manifold = owner;
  result.patch = static_cast<std::uint32_t>(patch);
  const bernstein::Shape& shape = family.shape;
  const Manifold& manifold = manifolds_[owner];
  if (shape.axes == 1 && shape.degree[0] == 2)
    return closest_on_quadratic_curve(family, local, point, cut, result);

  Scratch& memory = scratch();
  if (memory.a.size() < family.norms) {
    memory.a.resize(family.norms);
    memory.b.resize(family.norms);
  }
  const std::uint32_t* columns = columns_.data() + family.first_column + local * family.points;
  const auto segments = segments_of(patch);
  const double ee = products_with_net(manifold, columns, family, point, memory.a.data());
  elevate(manifold, family, segments, memory.a.data(), memory.b.data());
  const double* norms = norms_.data() + family.first_norm + local * family.norms;
  double lowest = std::numeric_limits<double>::infinity();
  double largest = 0.0;
  for (std::size_t i = 0; i < family.norms; ++i) {
    memory.a[i] = ee - 2.0 * memory.a[i] + norms[i];
    lowest = std::min(lowest, memory.a[i]);
    largest = std::max(largest, norms[i]);
  }
  if (lowest > cut) return false;
  const double rounding = relative_rounding * (ee + largest);
  bernstein::Minimum minimum;
  if (shape.axes == 0) {
    minimum.found = memory.a[0] <= cut;
    minimum.value = memory.a[0];
  } else if (shape.axes == 1) {
    minimum = bernstein::minimize_curve(family.squared.degree[0], memory.a.data(), cut, rounding);
  } else {
    minimum = bernstein::minimize(family.squared, memory.a.data(), cut, {rounding, patch_distance_tolerance},
                                  joints_of(manifold, family, segments), memory.minimize);
  }
  if (!minimum.found) return false;
  result.u = {};
  for (int a = 0; a < shape.axes; ++a) result.u[family.axis[a]] = minimum.u[a];
  result.squared_distance = std::max(minimum.value, 0.0);
  return true;
}

double PatchSet::products_with_net(const Manifold& manifold, const std::uint32_t* columns,
                                   const Family& family, const double* point, double* products) const {
  const double* coefficients = manifold.coefficients().data();
  const double* centre = coefficients + columns[family.middle] * dimensions_;
  double ee = 0.0;
  for (std::size_t i = 0; i < dimensions_; ++i) ee += (point[i] - centre[i]) * (point[i] - centre[i]);
  for (std::size_t k = 0; k < family.points; ++k) {
    const double* c = coefficients + columns[k] * dimensions_;
    Pair sum{};
    std::size_t i = 0;
    for (; i + 2 <= dimensions_; i += 2)
      sum += (load(point + i) - load(centre + i)) * (load(c + i) - load(centre + i));
    double g = sum[0] + sum[1];
    for (; i < dimensions_; ++i) g += (point[i] - centre[i]) * (c[i] - centre[i]);
    products[k] = g;
  }
  return ee;
}

void PatchSet::elevate(const Manifold& manifold, const Family& family, const Segments& segments, double* net,
                       double* work) {
  bernstein::Shape now = family.shape;
  for (int a = 0; a < family.shape.axes; ++a) {
    const int p = family.shape.degree[a];
    const auto extraction = manifold.bases()[family.axis[a]].extraction(segments[family.axis[a]]);
    bernstein::apply(now, a, extraction, p + 1, net, work);
    bernstein::apply(now, a, elevation(p), 2 * p + 1, work, net);
    now.degree[a] = 2 * p;
  }
}

bernstein::Joints PatchSet::joints_of(const Manifold& manifold, const Family& family,
                                      const Segments& segments) {
  // Splines of degree 2 and more join with equal derivatives, around the seam of a closed axis too.
  bernstein::Joints joints;
  for (int a = 0; a < family.shape.axes; ++a) {
    const std::size_t axis = family.axis[a];
    const bool smooth = family.shape.degree[a] >= 2;
    const bool closed = manifold.axes()[axis].dof.periodic;
    joints.low[a] = smooth && (closed || segments[axis] > 0);
    joints.high[a] = smooth && (closed || segments[axis] + 1 < manifold.bases()[axis].segments());
  }
  return joints;
}

std::array<double, max_manifold_dofs> PatchSet::position(const PatchPoint& point) const {
  const auto segments = segments_of(point.patch);
  const auto bases = manifolds_[point.manifold].bases();
  std::array<double, max_manifold_dofs> q{};
  for (std::size_t a = 0; a < bases.size(); ++a) q[a] = bases[a].position({segments[a], point.u[a]});
  return q;
}

double PatchSet::distance(const PatchPoint& place, const double* point) const {
  const Family& family = families_[place.manifold];
  const Manifold& manifold = manifolds_[place.manifold];
  const auto segments = segments_of(place.patch);
  const bernstein::Shape& shape = family.shape;
  std::array<std::array<double, max_spline_degree + 1>, max_manifold_dofs> w{};
  for (int a = 0; a < shape.axes; ++a)
    manifold.bases()[family.axis[a]].weights({segments[family.axis[a]], place.u[family.axis[a]]}, 0, w[a]);
  const std::uint32_t* columns =
      columns_.data() + family.first_column + (place.patch - family.first_patch) * family.points;
  std::array<double, 256> weights;  // (max_spline_degree + 1)^max_manifold_dofs
  for (std::size_t k = 0; k < family.points; ++k) {
    weights[k] = 1.0;
    for (int a = 0; a < shape.axes; ++a)
      weights[k] *= w[a][k / shape.stride(a) % static_cast<std::size_t>(shape.degree[a] + 1)];
  }
  // The weights sum to 1, so the difference may be taken coefficient by coefficient.
  double sum = 0.0;
  for (std::size_t i = 0; i < dimensions_; ++i) {
    double difference = 0.0;
    for (std::size_t k = 0; k < family.points; ++k)
      difference += weights[k] * (point[i] - manifold.coefficients().data()[columns[k] * dimensions_ + i]);
    sum += difference * difference;
  }
  return std::sqrt(sum);
}

}  // namespace eigenpose
