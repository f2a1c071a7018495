#include "core/parts/masked_alignment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>

namespace eigenpose {
namespace {

using Vector5 = Eigen::Matrix<double, 5, 1>;

constexpr double free_gain = 1.0;  // a cover changes the energy: 1 σ of the gain
constexpr int rounds = 5;
constexpr int steps = 15;  // samples each way within the reach

}  // namespace

AlignedPose align_masked(const PosePicture& picture, const PoseSpace& space, const AlignmentOptions& options,
                         const std::vector<float>& weights, const std::vector<double>& start, double reach) {
  const PoseScale& scale = space.coarse();
  const Eigen::VectorXf weight = Eigen::Map<const Eigen::VectorXf>(weights.data(), scale.basis.rows());
  AlignmentPrior prior = options.prior;
  prior.gain = free_gain;
  const Vector5 precision = prior.precision();
  AlignedPose end;
  end.q = start;
  end.q_sigma.assign(start.size(), std::numeric_limits<double>::infinity());
  const auto axes = space.coarse_manifold().axes();
  Eigen::MatrixXf warped;
  const auto template_at = [&](const std::vector<double>& q) -> Eigen::VectorXf {
    return space.pixel_mean() + scale.basis * space.coarse_manifold().evaluate(q).cast<float>();
  };

  // The gain that makes the trusted pixels agree is where the search begins.
  scale.warp(picture, {}, false, warped);
  {
    const Eigen::VectorXf model = template_at(start);
    const float own = (weight.array() * warped.col(0).array().square()).sum();
    const float both = (weight.array() * warped.col(0).array() * model.array()).sum();
    end.misalignment.gain = std::clamp(static_cast<double>(both / std::max(own, 1e-9F)) - 1.0, -0.8, 4.0);
  }
  const double first_gain = end.misalignment.gain;
  double step_share = reach / steps;
  for (int round = 0; round < rounds; ++round) {
    scale.warp(picture, end.misalignment, true, warped);
    const Eigen::MatrixXf tangents = warped.rightCols(5);
    const Eigen::MatrixXf weighted = tangents.array().colwise() * weight.array();
    Eigen::Matrix<double, 5, 5> normal = (weighted.transpose() * tangents).cast<double>();
    normal.diagonal() += options.noise * precision;
    const Eigen::Matrix<double, 5, 5> inverse = normal.inverse();
    Vector5 undone;
    undone << end.misalignment.gain - first_gain, end.misalignment.dx, end.misalignment.dy,
        end.misalignment.scale, end.misalignment.rotation;
    const Vector5 pull = options.noise * precision.cwiseProduct(undone);
    const auto cost = [&](const std::vector<double>& q, Vector5* x) {
      const Eigen::VectorXf residual = template_at(q) - warped.col(0);
      const Vector5 b = (weighted.transpose() * residual).cast<double>() - pull;
      const Vector5 best = inverse * b;
      if (x != nullptr) {
        *x = best;
      }
      return static_cast<double>((weight.array() * residual.array().square()).sum()) + undone.dot(pull) -
             b.dot(best);
    };
    std::vector<double> here = end.q;
    double lowest = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < axes.size(); ++a) {
      if (axes[a].samples.size() < 2) {
        continue;
      }
      const double step = step_share * axes[a].dof.period();
      std::vector<double> costs;
      const double centre = here[a];
      std::vector<double> q = here;
      for (int s = -steps; s <= steps; ++s) {
        q[a] = centre + s * step;
        costs.push_back(cost(q, nullptr));
      }
      const auto best = std::min_element(costs.begin(), costs.end());
      const auto at = static_cast<int>(best - costs.begin());
      double offset = 0.0;
      if (at > 0 && at < 2 * steps) {
        const double curvature =
            costs[static_cast<std::size_t>(at - 1)] - 2.0 * *best + costs[static_cast<std::size_t>(at + 1)];
        if (curvature > 0.0) {
          offset = 0.5 * (costs[static_cast<std::size_t>(at - 1)] - costs[static_cast<std::size_t>(at + 1)]) /
                   curvature;
          end.q_sigma[a] = step * std::sqrt(2.0 * std::max(*best, options.noise) /
                                            (curvature * static_cast<double>(scale.basis.cols())));
        }
      }
      here[a] = axes[a].dof.canonical(centre + (at - steps + offset) * step);
      lowest = std::min(lowest, *best);
    }
    end.q = here;
    Vector5 x;
    cost(end.q, &x);
    const Vector5 limit = 3.0 * precision.cwiseInverse().cwiseSqrt();
    Vector5 moved = undone + x;
    moved = moved.cwiseMax(-limit).cwiseMin(limit);
    end.misalignment = {std::clamp(moved(0) + first_gain, -0.8, 5.0), moved(1), moved(2), moved(3), moved(4)};
    end.cost = lowest;
    step_share = std::max(step_share * 0.5, 0.5 / 360.0);
  }
  end.fine_cost = end.cost;
  return end;
}

}  // namespace eigenpose
