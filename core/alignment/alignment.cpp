#include "core/alignment/alignment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include <Eigen/LU>

#include "core/base/insertion_sort.h"
#include "core/manifold/pose_covariance.h"
#include "core/simd/dense_products.h"

namespace eigenpose {
namespace {

/// Rounds after which the tangents stay as they are.
constexpr int tangent_rounds = 2;

using Vector5 = Eigen::Matrix<double, 5, 1>;

Vector5 as_vector(const Misalignment& m) {
  Vector5 v;
  v << m.gain, m.dx, m.dy, m.scale, m.rotation;
  return v;
}

Misalignment as_misalignment(const Vector5& v) {
  return {v(0), v(1), v(2), v(3), v(4)};
}

/// Two poses that differ by less than this share of every DOF's range are the same.
constexpr double same_pose = 0.01;

bool same(std::span<const SampleAxis> axes, const PoseVector& a, const PoseVector& b) {
  for (std::size_t d = 0; d < axes.size(); ++d)
    if (std::fabs(axes[d].dof.difference(a[d], b[d])) > same_pose * axes[d].dof.period()) return false;
  return true;
}

}  // namespace

Vector5 AlignmentPrior::precision() const {
  Vector5 sigma;
  sigma << gain, shift, shift, scale, rotation;
  return sigma.cwiseAbs2().cwiseInverse();
}

void PoseAligner::project(const AlignmentEigenspace& space, const PoseScale& scale,
                          const PosePicture& picture, const Misalignment& p) {
  Eigen::MatrixXf& warped = &scale == &space.coarse() ? coarse_warped_ : fine_warped_;
  scale.warp(picture, p, true, warped);
  dimensions_ = scale.basis.cols();
  const auto columns = static_cast<std::size_t>(warped.cols());
  projected_.resize(static_cast<std::size_t>(dimensions_) * columns);
  multiply_transposed_six(scale.basis.data(), static_cast<int>(scale.basis.rows()),
                          static_cast<int>(dimensions_), warped.data(), projected_.data(),
                          static_cast<int>(dimensions_));
  Eigen::Map<Eigen::VectorXf>(projected_.data(), dimensions_) -= scale.mean;
  prepare();
  set_prior(p);
}

void PoseAligner::project_picture(const AlignmentEigenspace& space, const PosePicture& picture,
                                  const Misalignment& p) {
  const PoseScale& scale = space.coarse();
  scale.warp(picture, p, false, coarse_warped_);
  multiply_transposed(scale.basis.data(), static_cast<int>(scale.basis.rows()), static_cast<int>(dimensions_),
                      coarse_warped_.data(), projected_.data());
  Eigen::Map<Eigen::VectorXf>(projected_.data(), dimensions_) -= scale.mean;
  set_prior(p);
}

void PoseAligner::prepare() {
  Eigen::Matrix<double, 5, 5> normal;
  const auto columns = tangents();
  for (Eigen::Index i = 0; i < normal.rows(); ++i)
    for (Eigen::Index j = 0; j <= i; ++j)
      normal(i, j) = normal(j, i) = columns.col(i).cast<double>().dot(columns.col(j).cast<double>());
  normal.diagonal() += options_.noise * precision_;
  inverse_ = normal.inverse();
}

void PoseAligner::set_prior(const Misalignment& p) {
  const Vector5 undone = as_vector(p);
  prior_pull_ = options_.noise * precision_.cwiseProduct(undone);
  prior_cost_ = undone.dot(prior_pull_);
}

double PoseAligner::cost_at(const float* point, Vector5* x) const {
  const auto dims = static_cast<int>(dimensions_);
  float squared = 0.0F;
  float products[5] = {};
  residual_products(point, projected_.data(), dims, squared, products);
  Vector5 b;
  for (int i = 0; i < 5; ++i) {
    b(i) = static_cast<double>(products[i]) - prior_pull_(i);
  }
  const Vector5 best = inverse_ * b;
  if (x != nullptr) {
    *x = best;
  }
  return static_cast<double>(squared) + prior_cost_ - b.dot(best);
}

void PoseAligner::begin_round(const PosePicture& picture, const AlignmentEigenspace& space, int round,
                              const Misalignment& p) {
  if (round == 0) {
    projected_ = unmoved_;
    dimensions_ = space.coarse().basis.cols();
    inverse_ = unmoved_inverse_;
    set_prior(p);
  } else if (round < tangent_rounds) {
    project(space, space.coarse(), picture, p);
  } else {
    project_picture(space, picture, p);
  }
}

std::size_t PoseAligner::best_within_reach(const AlignmentEigenspace& space, std::size_t here,
                                           double& lowest) const {
  const Grid& grid = space.sample_grid();
  std::size_t found = here;
  lowest = cost_at(space.sample(here), nullptr);
  for (std::size_t a = 0; a < grid.axes(); ++a) {
    const long reach = std::max(1L, std::lround(options_.reach * static_cast<double>(grid.count(a))));
    const std::size_t centre = found;
    for (long s = -reach; s <= reach; ++s) {
      const auto t = grid.neighbour(centre, a, s, space.ends(a));
      if (!t) continue;
      const double cost = cost_at(space.sample(*t), nullptr);
      if (cost < lowest) {
        lowest = cost;
        found = *t;
      }
    }
  }
  return found;
}

AlignedPose PoseAligner::follow(const PosePicture& picture, const AlignmentEigenspace& space,
                                std::size_t start) {
  AlignedPose end;
  std::size_t here = start;
  Misalignment p;
  double best = std::numeric_limits<double>::infinity();
  const Vector5 limit = 4.0 * precision_.cwiseInverse().cwiseSqrt();
  for (int round = 0; round < options_.rounds; ++round) {
    begin_round(picture, space, round, p);
    double lowest = 0.0;
    const std::size_t found = best_within_reach(space, here, lowest);
    Vector5 x;
    cost_at(space.sample(found), &x);
    const bool settled = found == here && round > 0 && lowest > best - 3e-2 * options_.noise - 3e-2 * best;
    here = found;
    best = lowest;
    p = as_misalignment((as_vector(p) + x).cwiseMax(-limit).cwiseMin(limit));
    if (settled) break;
  }
  end.misalignment = p;
  end.cost = best;
  end.fine_cost = best;
  interpolate(space, here, end);
  return end;
}

void PoseAligner::interpolate(const AlignmentEigenspace& space, std::size_t sample, AlignedPose& pose) const {
  const Grid& grid = space.sample_grid();
  const std::size_t dofs = grid.axes();
  pose.q.resize(dofs);
  pose.q_covariance.resize(dofs * dofs);
  set_unseen(dofs, pose.q_covariance);
  const double variance = std::max(pose.cost, options_.noise) / static_cast<double>(dimensions_);
  for (std::size_t a = 0; a < dofs; ++a) {
    const auto pose_of = [&](std::size_t t) {
      return space.sample_poses()(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(t));
    };
    pose.q[a] = pose_of(sample);
    const auto before = grid.neighbour(sample, a, -1, space.ends(a));
    const auto after = grid.neighbour(sample, a, 1, space.ends(a));
    if (grid.count(a) < 3 || !before || !after) continue;
    const double left = cost_at(space.sample(*before), nullptr);
    const double right = cost_at(space.sample(*after), nullptr);
    const double curvature = left - 2.0 * pose.cost + right;
    const Dof& dof = space.coarse_manifold().axes()[a].dof;
    const double step = dof.difference(pose_of(*after), pose.q[a]);
    if (curvature > 0.0) {
      pose.q[a] = dof.canonical(pose.q[a] + step * std::clamp(0.5 * (left - right) / curvature, -1.0, 1.0));
      // At the truth the squared distance has the expected value D·variance, and ½·curvature = variance/σ².
      pose.q_covariance[a * dofs + a] = step * step * 2.0 * variance / curvature;
    }
  }
  if (dofs > 1) relate(space, variance, pose);
}

void PoseAligner::relate(const AlignmentEigenspace& space, double variance, AlignedPose& pose) const {
  const Eigen::MatrixXd jacobian = space.coarse_manifold().evaluate_with_jacobian(pose.q).jacobian;
  const Eigen::MatrixXd with_misalignment = tangents().cast<double>().transpose() * jacobian;
  set_covariance(
      jacobian.transpose() * jacobian - with_misalignment.transpose() * inverse_ * with_misalignment,
      variance, pose.q_covariance);
}

double PoseAligner::fine_cost(const PosePicture& picture, const AlignmentEigenspace& space,
                              const AlignedPose& pose) {
  constexpr int steps = 5;
  project(space, space.fine(), picture, pose.misalignment);
  const auto axes = space.fine_manifold().axes();
  const auto cost_of = [&](const PoseVector& q) {
    space.fine_manifold().evaluate_into(q, fine_point_);
    fine_coordinates_.assign(fine_point_.begin(), fine_point_.end());
    return cost_at(fine_coordinates_.data(), nullptr);
  };
  PoseVector best = pose.q;
  double lowest = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < axes.size(); ++a) {
    if (a > 0 && axes[a].samples.size() < 2) continue;
    const double step = axes[a].dof.period() / 360.0;
    PoseVector q = best;
    const double centre = q[a];
    for (int s = -steps; s <= steps; ++s) {
      q[a] = centre + s * step;
      const double cost = cost_of(q);
      if (cost >= lowest) continue;
      lowest = cost;
      best = q;
    }
  }
  return lowest;
}

void PoseAligner::find_minima(const AlignmentEigenspace& space) {
  const Grid& grid = space.sample_grid();
  minima_.clear();
  for (std::size_t t = 0; t < grid.size(); ++t) {
    bool lowest = true;
    for (std::size_t a = 0; a < grid.axes() && lowest; ++a)
      for (const int s : {-1, 1}) {
        const auto n = grid.neighbour(t, a, s, space.ends(a));
        lowest = lowest && (!n || costs_[t] <= costs_[*n]);
      }
    if (lowest) minima_.push_back(t);
  }
}

void PoseAligner::compare_fine(const PosePicture& picture, const AlignmentEigenspace& space) {
  insertion_sort(poses_, [](const AlignedPose& a, const AlignedPose& b) { return a.cost < b.cost; });
  AlignedPose& best = poses_.front();
  best.fine_cost = fine_cost(picture, space, best);
  const double finer = best.fine_cost - best.cost;
  for (AlignedPose& pose : std::span(poses_).subspan(1)) {
    const bool close = pose.cost < best.cost + options_.close * options_.noise;
    pose.fine_cost = close ? fine_cost(picture, space, pose) : pose.cost + finer;
  }
}

const std::vector<AlignedPose>& PoseAligner::align(const PosePicture& picture,
                                                   const AlignmentEigenspace& space) {
  project(space, space.coarse(), picture, {});
  unmoved_ = projected_;
  unmoved_inverse_ = inverse_;
  costs_.resize(space.sample_grid().size());
  for (std::size_t t = 0; t < costs_.size(); ++t) costs_[t] = cost_at(space.sample(t), nullptr);
  find_minima(space);
  const auto starts = std::min(minima_.size(), options_.starts);
  std::partial_sort(minima_.begin(), minima_.begin() + static_cast<std::ptrdiff_t>(starts), minima_.end(),
                    [this](std::size_t a, std::size_t b) { return costs_[a] < costs_[b]; });
  poses_.clear();
  for (std::size_t i = 0; i < starts; ++i) {
    if (costs_[minima_[i]] > 2.0 * costs_[minima_[0]] + options_.hopeless * options_.noise) break;
    const AlignedPose pose = follow(picture, space, minima_[i]);
    const bool known = std::any_of(poses_.begin(), poses_.end(), [&](const AlignedPose& other) {
      return same(space.coarse_manifold().axes(), pose.q, other.q);
    });
    if (!known) poses_.push_back(pose);
  }
  if (options_.fine && poses_.size() > 1) compare_fine(picture, space);
  insertion_sort(poses_,
                 [](const AlignedPose& a, const AlignedPose& b) { return a.fine_cost < b.fine_cost; });
  return poses_;
}

}  // namespace eigenpose
