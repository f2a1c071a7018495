#include "core/alignment/alignment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include <Eigen/LU>

#include "core/manifold/pose_covariance.h"
#include "core/simd/dense_kernels.h"

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

/// Index of the sample that is `steps` away from `t` along axis `a`, or −1 beyond an open end.
std::ptrdiff_t neighbour(const AlignmentEigenspace& space, std::size_t t, std::size_t a, int steps) {
  const auto& counts = space.sample_counts();
  std::size_t stride = 1;
  for (std::size_t i = counts.size(); i-- > a + 1;) {
    stride *= static_cast<std::size_t>(counts[i]);
  }
  const int count = counts[a];
  const int here = static_cast<int>(t / stride % static_cast<std::size_t>(count));
  int there = here + steps;
  if (space.coarse_manifold().axes()[a].dof.periodic) {
    there = ((there % count) + count) % count;
  } else if (there < 0 || there >= count) {
    return -1;
  }
  return static_cast<std::ptrdiff_t>(t) +
         static_cast<std::ptrdiff_t>(there - here) * static_cast<std::ptrdiff_t>(stride);
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

void PoseAligner::follow(const PosePicture& picture, const AlignmentEigenspace& space, std::size_t start,
                         AlignedPose& end) {
  const auto& counts = space.sample_counts();
  std::size_t here = start;
  Misalignment p;
  Vector5 x;
  double best = std::numeric_limits<double>::infinity();
  for (int round = 0; round < options_.rounds; ++round) {
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
    // Coordinate-wise descent over the grid within reach: exact for one DOF.
    std::size_t found = here;
    double lowest = cost_at(space.samples().col(static_cast<Eigen::Index>(here)).data(), nullptr);
    for (std::size_t a = 0; a < counts.size(); ++a) {
      const int reach = std::max(1, static_cast<int>(std::lround(options_.reach * counts[a])));
      const std::size_t centre = found;
      for (int s = -reach; s <= reach; ++s) {
        const std::ptrdiff_t t = neighbour(space, centre, a, s);
        if (t < 0) {
          continue;
        }
        const double cost = cost_at(space.samples().col(t).data(), nullptr);
        if (cost < lowest) {
          lowest = cost;
          found = static_cast<std::size_t>(t);
        }
      }
    }
    cost_at(space.samples().col(static_cast<Eigen::Index>(found)).data(), &x);
    const bool settled = found == here && round > 0 && lowest > best - 3e-2 * options_.noise - 3e-2 * best;
    here = found;
    best = lowest;
    Vector5 moved = as_vector(p) + x;
    const Vector5 limit = 4.0 * precision_.cwiseInverse().cwiseSqrt();
    moved = moved.cwiseMax(-limit).cwiseMin(limit);
    if (settled || round + 1 == options_.rounds) {
      end.misalignment = as_misalignment(moved);
      break;
    }
    p = as_misalignment(moved);
  }
  end.cost = best;
  end.fine_cost = best;
  const auto dofs = static_cast<std::size_t>(space.sample_poses().rows());
  end.q.resize(dofs);
  end.q_covariance.resize(dofs * dofs);
  set_unseen(dofs, end.q_covariance);
  const double variance = std::max(best, options_.noise) / static_cast<double>(dimensions_);
  for (std::size_t a = 0; a < dofs; ++a) {
    const double q = space.sample_poses()(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(here));
    end.q[a] = q;
    const std::ptrdiff_t before = neighbour(space, here, a, -1);
    const std::ptrdiff_t after = neighbour(space, here, a, 1);
    if (counts[a] < 3 || before < 0 || after < 0) {
      continue;
    }
    const double left = cost_at(space.samples().col(before).data(), nullptr);
    const double right = cost_at(space.samples().col(after).data(), nullptr);
    const double curvature = left - 2.0 * best + right;
    const Dof& dof = space.coarse_manifold().axes()[a].dof;
    const double step = dof.difference(space.sample_poses()(static_cast<Eigen::Index>(a), after), q);
    if (curvature > 0.0) {
      end.q[a] = dof.canonical(q + step * std::clamp(0.5 * (left - right) / curvature, -1.0, 1.0));
      // The cost is a squared distance whose expected value at the truth is D·variance; ½·curvature = 1/σ² ·
      // variance.
      end.q_covariance[a * dofs + a] = step * step * 2.0 * variance / curvature;
    }
  }
  if (dofs > 1) relate(space, variance, end);
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
  project(space, space.fine(), picture, pose.misalignment);
  const Dof& dof = space.fine_manifold().axes()[0].dof;
  double lowest = std::numeric_limits<double>::infinity();
  PoseNumbers q = pose.q;
  const double step = dof.period() / 360.0;
  for (int s = -5; s <= 5; ++s) {
    q[0] = pose.q[0] + s * step;
    space.fine_manifold().evaluate_into(q, fine_point_);
    fine_numbers_.assign(fine_point_.begin(), fine_point_.end());
    lowest = std::min(lowest, cost_at(fine_numbers_.data(), nullptr));
  }
  return lowest;
}

const std::vector<AlignedPose>& PoseAligner::align(const PosePicture& picture,
                                                   const AlignmentEigenspace& space) {
  project(space, space.coarse(), picture, {});
  unmoved_ = projected_;
  unmoved_inverse_ = inverse_;
  const auto total = static_cast<std::size_t>(space.samples().cols());
  costs_.resize(total);
  for (std::size_t t = 0; t < total; ++t) {
    costs_[t] = cost_at(space.samples().col(static_cast<Eigen::Index>(t)).data(), nullptr);
  }
  minima_.clear();
  for (std::size_t t = 0; t < total; ++t) {
    bool lowest = true;
    for (std::size_t a = 0; a < space.sample_counts().size() && lowest; ++a) {
      for (const int s : {-1, 1}) {
        const std::ptrdiff_t n = neighbour(space, t, a, s);
        lowest = lowest && (n < 0 || costs_[t] <= costs_[static_cast<std::size_t>(n)]);
      }
    }
    if (lowest) {
      minima_.push_back(t);
    }
  }
  const auto starts = std::min(minima_.size(), options_.starts);
  std::partial_sort(minima_.begin(), minima_.begin() + static_cast<std::ptrdiff_t>(starts), minima_.end(),
                    [this](std::size_t a, std::size_t b) { return costs_[a] < costs_[b]; });
  poses_.clear();
  for (std::size_t i = 0; i < starts; ++i) {
    // What begins this much worse does not end best.
    if (costs_[minima_[i]] > 2.0 * costs_[minima_[0]] + options_.hopeless * options_.noise) {
      break;
    }
    AlignedPose pose;
    follow(picture, space, minima_[i], pose);
    const bool known = std::any_of(poses_.begin(), poses_.end(), [&](const AlignedPose& other) {
      const auto axes = space.coarse_manifold().axes();
      for (std::size_t a = 0; a < axes.size(); ++a) {
        if (std::fabs(axes[a].dof.difference(pose.q[a], other.q[a])) > 0.01 * axes[a].dof.period()) {
          return false;
        }
      }
      return true;
    });
    if (!known) {
      poses_.push_back(pose);
    }
  }
  if (options_.fine && poses_.size() > 1) {
    sort_few(poses_, [](const AlignedPose& a, const AlignedPose& b) { return a.cost < b.cost; });
    AlignedPose& best = poses_.front();
    best.fine_cost = fine_cost(picture, space, best);
    const double finer = best.fine_cost - best.cost;
    for (AlignedPose& pose : std::span(poses_).subspan(1)) {
      const bool close = pose.cost < best.cost + options_.close * options_.noise;
      pose.fine_cost = close ? fine_cost(picture, space, pose) : pose.cost + finer;
    }
  }
  sort_few(poses_, [](const AlignedPose& a, const AlignedPose& b) { return a.fine_cost < b.fine_cost; });
  return poses_;
}

}  // namespace eigenpose
