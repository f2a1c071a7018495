#include "core/search/sample_cloud.h"

#include <cmath>

namespace eigenpose {

namespace {

/// Samples per patch and axis, by the number of axes that are not constant.
constexpr std::array<int, max_manifold_dofs + 1> cloud_samples = {1, 10, 4, 3, 2};

/// Rows of Bernstein blossoms: the Bézier points of the piece [a, b] of a curve of degree p, from those of
/// the whole.
std::vector<double> restriction(int p, double a, double b) {
  const auto count = static_cast<std::size_t>(p + 1);
  std::vector<double> matrix(count * count);
  for (int j = 0; j <= p; ++j)
    for (int unit = 0; unit <= p; ++unit) {
      std::array<double, max_spline_degree + 1> d{};
      d[unit] = 1.0;
      for (int level = 0; level < p; ++level) {
        const double t = level < j ? b : a;
        for (int i = 0; i < p - level; ++i) d[i] += t * (d[i + 1] - d[i]);
      }
      matrix[static_cast<std::size_t>(j) * count + static_cast<std::size_t>(unit)] = d[0];
    }
  return matrix;
}

/// All rows of a net restricted along one axis.
Eigen::MatrixXd restricted(const bernstein::Shape& shape, const Eigen::MatrixXd& net, int axis, double a,
                           double b) {
  const int p = shape.degree[axis];
  const std::vector<double> matrix = restriction(p, a, b);
  const std::size_t step = shape.stride(axis);
  const auto count = static_cast<std::size_t>(p + 1);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(net.rows(), net.cols());
  for (std::size_t i = 0; i < shape.size(); ++i) {
    const std::size_t row = i / step % count;
    for (std::size_t c = 0; c < count; ++c)
      result.col(static_cast<Eigen::Index>(i)) +=
          matrix[row * count + c] * net.col(static_cast<Eigen::Index>(i + (c - row) * step));
  }
  return result;
}

}  // namespace

SampleCloud::SampleCloud(const PatchSet& patches) : dimensions_(patches.dimensions()) {
  for (std::size_t patch = 0; patch < patches.size(); ++patch) {
    const bernstein::Shape& shape = patches.shape(patch);
    const Eigen::MatrixXd whole = patches.bezier(patch);
    const int per_axis = cloud_samples[static_cast<std::size_t>(shape.axes)];
    int cells = 1;
    for (int a = 0; a < shape.axes; ++a) cells *= per_axis;
    for (int cell = 0; cell < cells; ++cell) {
      Eigen::MatrixXd net = whole;
      Eigen::MatrixXd middle = whole;
      int rest = cell;
      for (int a = 0; a < shape.axes; ++a) {
        const double begin = static_cast<double>(rest % per_axis) / per_axis;
        const double end = begin + 1.0 / per_axis;
        rest /= per_axis;
        net = restricted(shape, net, a, begin, end);
        const double centre = 0.5 * (begin + end);
        middle = restricted(shape, middle, a, centre, centre);
      }
      const Eigen::VectorXf point = middle.col(0).cast<float>();
      const double reach = (net.colwise() - point.cast<double>()).colwise().norm().maxCoeff();
      // Distances in float between coordinates near 1 carry an error of about 1e-7 of their size.
      const double rounding = 1e-6 * (1.0 + point.cast<double>().norm());
      points_.insert(points_.end(), point.data(), point.data() + point.size());
      patch_.push_back(static_cast<std::uint32_t>(patch));
      reach_.push_back(static_cast<float>(reach + rounding));
      largest_reach_ = std::max(largest_reach_, static_cast<double>(reach_.back()));
    }
  }
}

std::size_t SampleCloud::memory() const {
  return points_.capacity() * sizeof(float) + patch_.capacity() * sizeof(std::uint32_t) +
         reach_.capacity() * sizeof(float);
}

}  // namespace eigenpose
