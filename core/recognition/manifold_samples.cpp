#include "core/recognition/manifold_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/manifold/pose_covariance.h"

namespace eigenpose {
namespace {

/// Between two learned views of a turn the distance has at most one minimum; four samples a step find it.
std::vector<double> sample_positions(const SampleAxis& axis, int per_step) {
  std::vector<double> values;
  const auto& samples = axis.samples;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const bool last = i + 1 == samples.size();
    if (last && (!axis.dof.periodic || samples.size() == 1)) {
      values.push_back(samples[i]);
      break;
    }
    const double next = last ? samples[0] + axis.dof.period() : samples[i + 1];
    for (int s = 0; s < per_step; ++s)
      values.push_back(axis.dof.canonical(samples[i] + (next - samples[i]) * s / per_step));
  }
  std::sort(values.begin(), values.end());
  return values;
}

}  // namespace

ManifoldSamples::ManifoldSamples(const Manifold& manifold) {
  const int per_step = manifold.dofs() == 1 ? 4 : 1;
  for (const SampleAxis& axis : manifold.axes())
    axes_.push_back({axis.dof, sample_positions(axis, per_step), 1});
  std::size_t samples = 1;
  for (std::size_t d = axes_.size(); d-- > 0;) {
    axes_[d].stride = samples;
    samples *= axes_[d].values.size();
  }
  points_.resize(manifold.dimensions(), static_cast<Eigen::Index>(samples));
  const std::size_t m = axes_.size();
  covariance_.reserve(samples * m * m);
  std::vector<double> q(axes_.size());
  for (std::size_t s = 0; s < samples; ++s) {
    for (std::size_t d = 0; d < axes_.size(); ++d) q[d] = value(s, axes_[d]);
    const ManifoldPoint point = manifold.evaluate_with_jacobian(q);
    points_.col(static_cast<Eigen::Index>(s)) = point.value.cast<float>();
    covariance_.resize(covariance_.size() + m * m);
    set_covariance(point.jacobian.transpose() * point.jacobian, 1.0, std::span(covariance_).last(m * m));
  }
}

std::size_t ManifoldSamples::nearest_index(const Axis& axis, double value) const {
  std::size_t best = 0;
  for (std::size_t i = 1; i < axis.values.size(); ++i)
    if (std::abs(axis.dof.difference(axis.values[i], value)) <
        std::abs(axis.dof.difference(axis.values[best], value)))
      best = i;
  return best;
}

std::size_t ManifoldSamples::neighbour(std::size_t sample, const Axis& axis, int direction) const {
  const std::size_t n = axis.values.size();
  const std::size_t at = (sample / axis.stride) % n;
  const std::size_t begin = sample - at * axis.stride;
  if (direction < 0)
    return at > 0 ? sample - axis.stride : axis.dof.periodic ? begin + (n - 1) * axis.stride : sample;
  return at + 1 < n ? sample + axis.stride : axis.dof.periodic ? begin : sample;
}

bool ManifoldSamples::is_minimum(const Eigen::VectorXf& squared, std::size_t sample) const {
  const float here = squared[static_cast<Eigen::Index>(sample)];
  return std::all_of(axes_.begin(), axes_.end(), [&](const Axis& axis) {
    return squared[static_cast<Eigen::Index>(neighbour(sample, axis, -1))] >= here &&
           squared[static_cast<Eigen::Index>(neighbour(sample, axis, 1))] >= here;
  });
}

std::optional<ManifoldSamples::Fit> ManifoldSamples::other_minimum(
    const Eigen::Ref<const Eigen::VectorXf>& point, std::span<const double> q, double apart,
    std::span<double> other_q, Eigen::VectorXf& squared) const {
  squared.resize(points_.cols());
  for (Eigen::Index s = 0; s < squared.size(); ++s) squared[s] = (points_.col(s) - point).squaredNorm();
  std::optional<Fit> best;
  double best_squared = std::numeric_limits<double>::infinity();
  for (std::size_t s = 0; s < static_cast<std::size_t>(squared.size()); ++s) {
    const double here = squared[static_cast<Eigen::Index>(s)];
    if (here >= best_squared || !is_minimum(squared, s)) continue;
    bool far = false;
    for (std::size_t d = 0; d < axes_.size(); ++d)
      far =
          far || std::abs(axes_[d].dof.difference(value(s, axes_[d]), q[d])) > apart * axes_[d].dof.period();
    if (!far) continue;
    best = Fit{s, 0.0};
    best_squared = here;
  }
  if (!best) return best;
  for (std::size_t d = 0; d < axes_.size(); ++d) other_q[d] = value(best->sample, axes_[d]);
  if (axes_.size() == 1) {
    // The parabola through three samples.
    const double before = squared[static_cast<Eigen::Index>(neighbour(best->sample, axes_[0], -1))];
    const double after = squared[static_cast<Eigen::Index>(neighbour(best->sample, axes_[0], 1))];
    const double bend = before - 2.0 * best_squared + after;
    if (bend > 0.0) {
      const double step =
          axes_[0].dof.difference(value(neighbour(best->sample, axes_[0], 1), axes_[0]), other_q[0]);
      const double shift = 0.5 * (before - after) / bend;
      other_q[0] = axes_[0].dof.canonical(other_q[0] + shift * step);
      best_squared -= 0.25 * (before - after) * shift;
    }
  }
  best->distance = std::sqrt(std::max(0.0, best_squared));
  return best;
}

std::vector<double> ManifoldSamples::pose(std::size_t sample) const {
  std::vector<double> q;
  for (const Axis& axis : axes_) q.push_back(value(sample, axis));
  return q;
}

std::span<const double> ManifoldSamples::covariance(std::span<const double> q) const {
  std::size_t sample = 0;
  for (std::size_t d = 0; d < axes_.size(); ++d) sample += nearest_index(axes_[d], q[d]) * axes_[d].stride;
  const std::size_t m = axes_.size();
  return std::span(covariance_).subspan(sample * m * m, m * m);
}

}  // namespace eigenpose
