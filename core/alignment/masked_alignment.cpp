#include "core/alignment/masked_alignment.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/LU>

#include "core/base/statistics.h"
#include "core/manifold/pose_covariance.h"
#include "core/simd/dense_products.h"

namespace eigenpose {
namespace {

constexpr double free_gain = 1.0;   // an occluder changes the energy: 1 σ of the gain
constexpr int trusting_rounds = 2;  // weighted by trust
constexpr int robust_rounds = 3;    // weighted by residual
constexpr int steps = 15;           // samples each way within the reach
/// A pixel's variance, as a multiple of the noise that the splines leave spread over all pixels.
constexpr double variance_of_pixels = 6.0;
constexpr double robust_width = 3.0;      // σ at which a pixel's weight is a quarter
constexpr double most_unexplained = 4.5;  // ½·3²
/// Darker pixels do not enter the median residual: a third of a region's root mean square, 1/32.
constexpr float dark = 0.01F;
constexpr float trusted = 0.2F;
constexpr double deviation_of_median = 1.4826;  // σ over the median of |r|, for normal r

/// Step between the poses that a round compares, as a share of a DOF's range; it halves every round.
double step_of_round(int round, double reach) {
  const double least = 0.5 / 360.0;
  const double step = reach / (steps * (1 << round));
  return round == 0 ? step : std::max(step, least);
}

}  // namespace

MaskedAligner::MaskedAligner(const AlignmentOptions& options) : options_(options) {
  AlignmentPrior prior = options.prior;
  prior.gain = free_gain;
  precision_ = prior.precision();
}

void MaskedAligner::look(const PosePicture& picture, const AlignmentEigenspace& space,
                         std::span<const float> trust) {
  picture_ = &picture;
  space_ = &space;
  trust_ = trust;
  pixel_variance_ = variance_of_pixels * options_.noise / static_cast<double>(space.coarse().basis.rows());
  trusted_quadratic_known_ = false;
}

double MaskedAligner::first_gain() const {
  const auto region = warped_.col(0).array();
  const float own = (weights_.array() * region.square()).sum();
  const float both = (weights_.array() * region * rendered_.array()).sum();
  return std::clamp(static_cast<double>(both / std::max(own, 1e-9F)) - 1.0, -0.8, 4.0);
}

void MaskedAligner::weigh_by_residual() {
  residuals_.clear();
  for (Eigen::Index i = 0; i < rendered_.size(); ++i) {
    const float region = warped_(i, 0);
    if (trust_[static_cast<std::size_t>(i)] > trusted && (rendered_(i) > dark || region > dark))
      residuals_.push_back(std::fabs(rendered_(i) - region));
  }
  double variance = pixel_variance_;
  if (residuals_.size() > 20) {
    const double sigma = deviation_of_median * static_cast<double>(upper_median(residuals_));
    variance = std::max(variance, sigma * sigma);
  }
  const auto scale = static_cast<float>(1.0 / (robust_width * robust_width * variance));
  weights_ = (1.0F + scale * (rendered_ - warped_.col(0)).array().square()).square().inverse().matrix();
}

void MaskedAligner::weigh_basis() {
  const Eigen::MatrixXf& basis = space_->coarse().basis;
  const auto pixels = static_cast<int>(basis.rows());
  const auto dims = static_cast<int>(basis.cols());
  weighted_basis_ = basis.array().colwise() * weights_.array();
  // Its lower half, six columns at a time; the last ones again where D is no multiple of six.
  quadratic_.resize(dims, dims);
  if (dims < 6) {
    quadratic_.noalias() = basis.transpose() * weighted_basis_;
  } else {
    for (int first = 0; first < dims; first += 6) {
      const int from = std::min(first, dims - 6);
      multiply_transposed_six(basis.col(from).data(), pixels, dims - from, weighted_basis_.col(from).data(),
                              quadratic_.col(from).data() + from, dims);
    }
  }
}

void MaskedAligner::prepare(const Misalignment& misalignment, double first_gain) {
  const Eigen::MatrixXf& basis = space_->coarse().basis;
  const auto pixels = static_cast<int>(basis.rows());
  const auto dims = static_cast<int>(basis.cols());
  weighted_.resize(pixels, 6);
  weighted_.col(0) = weights_.cwiseProduct(space_->pixel_mean() - warped_.col(0));
  weighted_.rightCols(5) = warped_.rightCols(5).array().colwise() * weights_.array();
  linear_.resize(dims, 6);
  multiply_transposed_six(basis.data(), pixels, dims, weighted_.data(), linear_.data(), dims);
  const Eigen::VectorXf difference = space_->pixel_mean() - warped_.col(0);
  constant_ = static_cast<double>(weighted_.col(0).dot(difference));
  constant_products_ = (weighted_.rightCols(5).transpose() * difference).cast<double>();

  Vector5 undone;
  undone << misalignment.gain - first_gain, misalignment.dx, misalignment.dy, misalignment.scale,
      misalignment.rotation;
  prior_pull_ = options_.noise * precision_.cwiseProduct(undone);
  prior_cost_ = undone.dot(prior_pull_);
  Eigen::Matrix<double, 5, 5> normal =
      (weighted_.rightCols(5).transpose() * warped_.rightCols(5)).cast<double>();
  normal.diagonal() += options_.noise * precision_;
  inverse_ = normal.inverse();
}

double MaskedAligner::cost_at(std::span<const double> q, Vector5* x) {
  const Eigen::VectorXf point = space_->coarse_manifold().evaluate(q).cast<float>();
  product_.noalias() = quadratic_.selfadjointView<Eigen::Lower>() * point;
  const double squared = static_cast<double>(point.dot(product_ + 2.0F * linear_.col(0))) + constant_;
  const Vector5 b =
      (linear_.rightCols(5).transpose() * point).cast<double>() + constant_products_ - prior_pull_;
  const Vector5 best = inverse_ * b;
  if (x != nullptr) *x = best;
  return std::max(0.0, squared) + prior_cost_ - b.dot(best);
}

void MaskedAligner::move(MaskedPose& masked, double step_share) {
  AlignedPose& pose = masked.aligned;
  const auto axes = space_->coarse_manifold().axes();
  PoseVector q = pose.q;
  double lowest = cost_at(q, nullptr);
  for (std::size_t a = 0; a < axes.size(); ++a) {
    if (axes[a].samples.size() < 2) continue;
    const double step = step_share * axes[a].dof.period();
    const double centre = q[a];
    costs_.clear();
    for (int s = -steps; s <= steps; ++s) {
      q[a] = centre + s * step;
      costs_.push_back(cost_at(q, nullptr));
    }
    const auto best = std::min_element(costs_.begin(), costs_.end());
    const auto at = static_cast<int>(best - costs_.begin());
    double offset = 0.0;
    if (at > 0 && at < 2 * steps) {
      const double curvature = *(best - 1) - 2.0 * *best + *(best + 1);
      if (curvature > 0.0) {
        offset = 0.5 * (*(best - 1) - *(best + 1)) / curvature;
        pose.q_covariance[a * axes.size() + a] = step * step * 2.0 * std::max(*best, options_.noise) /
                                                 (curvature * static_cast<double>(quadratic_.cols()));
      }
    }
    q[a] = axes[a].dof.canonical(centre + (at - steps + offset) * step);
    lowest = std::min(lowest, *best);
  }
  pose.q = q;
  pose.cost = lowest;
  pose.fine_cost = lowest;
  Vector5 x;
  cost_at(pose.q, &x);
  const Vector5 limit = 3.0 * precision_.cwiseInverse().cwiseSqrt();
  const double gain = masked.first_gain;
  const Misalignment& p = pose.misalignment;
  Vector5 moved;
  moved << p.gain - gain + x(0), p.dx + x(1), p.dy + x(2), p.scale + x(3), p.rotation + x(4);
  moved = moved.cwiseMax(-limit).cwiseMin(limit);
  pose.misalignment = {std::clamp(moved(0) + gain, -0.8, 5.0), moved(1), moved(2), moved(3), moved(4)};
}

void MaskedAligner::relate(AlignedPose& pose) const {
  const Eigen::MatrixXd jacobian = space_->coarse_manifold().evaluate_with_jacobian(pose.q).jacobian;
  const Eigen::MatrixXf weighed = quadratic_.selfadjointView<Eigen::Lower>() * jacobian.cast<float>().eval();
  const Eigen::MatrixXd with_misalignment = linear_.rightCols(5).cast<double>().transpose() * jacobian;
  const double variance = std::max(pose.cost, options_.noise) / static_cast<double>(quadratic_.cols());
  set_covariance(jacobian.transpose() * weighed.cast<double>() -
                     with_misalignment.transpose() * inverse_ * with_misalignment,
                 variance, pose.q_covariance);
}

MaskedPose MaskedAligner::approach(std::span<const double> start, double reach) {
  if (picture_ == nullptr) throw std::logic_error("approach() needs a region: call look() first");
  MaskedPose masked;
  AlignedPose& pose = masked.aligned;
  pose.q.resize(start.size());
  std::copy(start.begin(), start.end(), pose.q.begin());
  pose.q_covariance.resize(start.size() * start.size());
  set_unseen(start.size(), pose.q_covariance);
  weights_ = Eigen::Map<const Eigen::VectorXf>(trust_.data(), static_cast<Eigen::Index>(trust_.size()));
  if (!trusted_quadratic_known_) {
    weigh_basis();
    trusted_quadratic_ = quadratic_;
    trusted_quadratic_known_ = true;
  } else {
    quadratic_ = trusted_quadratic_;
  }
  space_->coarse().warp(*picture_, {}, false, warped_);
  space_->render(start, rendered_);
  masked.first_gain = first_gain();
  pose.misalignment.gain = masked.first_gain;
  for (int round = 0; round < trusting_rounds; ++round) {
    space_->coarse().warp(*picture_, pose.misalignment, true, warped_);
    prepare(pose.misalignment, masked.first_gain);
    move(masked, step_of_round(round, reach));
  }
  return masked;
}

void MaskedAligner::refine(MaskedPose& masked, double reach) {
  if (picture_ == nullptr) throw std::logic_error("refine() needs a region: call look() first");
  AlignedPose& pose = masked.aligned;
  const PoseScale& scale = space_->coarse();
  for (int round = trusting_rounds; round < trusting_rounds + robust_rounds; ++round) {
    scale.warp(*picture_, pose.misalignment, true, warped_);
    space_->render(pose.q, rendered_);
    weigh_by_residual();
    weigh_basis();
    prepare(pose.misalignment, masked.first_gain);
    move(masked, step_of_round(round, reach));
  }
  if (pose.q.size() > 1) relate(pose);
  scale.warp(*picture_, pose.misalignment, false, warped_);
  space_->render(pose.q, rendered_);
  masked.unexplained = 0.0;
  const double half_precision = 0.5 / pixel_variance_;
  for (Eigen::Index i = 0; i < rendered_.size(); ++i) {
    const double difference = static_cast<double>(rendered_(i) - warped_(i, 0));
    masked.unexplained += std::min(half_precision * difference * difference, most_unexplained);
  }
}

}  // namespace eigenpose
