#include "core/learning/calibration/logistic_fit.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/base/linear_algebra.h"

namespace eigenpose {
namespace {

constexpr int most_rounds = 50;
constexpr double converged = 1e-9;

/// ln(1 + eˣ) without overflow.
double softplus(double x) {
  return std::max(x, 0.0) + std::log1p(std::exp(-std::abs(x)));
}

}  // namespace

Eigen::VectorXd fit_log_odds(const LogisticSamples& samples, const Eigen::VectorXd& prior,
                             const Eigen::VectorXd& prior_sigma) {
  const Eigen::Index count = samples.terms.cols();
  if (samples.positive.size() != static_cast<std::size_t>(count) || prior_sigma.size() != prior.size() ||
      (count > 0 && samples.terms.rows() != prior.size()))
    throw std::invalid_argument("the samples of a logistic regression do not fit its weights");
  const auto positives = static_cast<double>(std::ranges::count(samples.positive, true));
  const double negatives = static_cast<double>(count) - positives;
  if (positives == 0.0 || negatives == 0.0) return prior;
  const double weight = std::min({positives, negatives, samples.most_weight});
  const Eigen::VectorXd precision = prior_sigma.cwiseAbs2().cwiseInverse();
  const auto sign = [&](Eigen::Index i) {
    return samples.positive[static_cast<std::size_t>(i)] ? 1.0 : -1.0;
  };
  const auto share = [&](Eigen::Index i) { return weight / (sign(i) > 0.0 ? positives : negatives); };
  const auto loss_at = [&](const Eigen::VectorXd& w) {
    double loss = 0.5 * precision.dot((w - prior).cwiseAbs2());
    for (Eigen::Index i = 0; i < count; ++i)
      loss += share(i) * softplus(-sign(i) * w.dot(samples.terms.col(i)));
    return loss;
  };
  Eigen::VectorXd w = prior;
  double loss = loss_at(w);
  for (int round = 0; round < most_rounds; ++round) {
    Eigen::VectorXd gradient = precision.cwiseProduct(w - prior);
    Eigen::MatrixXd curvature = precision.asDiagonal();
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto term = samples.terms.col(i);
      const double miss = 1.0 / (1.0 + std::exp(sign(i) * w.dot(term)));
      gradient -= share(i) * sign(i) * miss * term;
      curvature += share(i) * miss * (1.0 - miss) * term * term.transpose();
    }
    const auto solved = solve_positive_definite_in_place(curvature, gradient);
    if (!solved) break;
    const Eigen::VectorXd step = *solved;
    double length = 1.0;
    while (length > 1e-6 && loss_at(w - length * step) > loss) length *= 0.5;
    const double next = loss_at(w - length * step);
    if (!(next < loss)) break;
    w -= length * step;
    if (loss - next < converged * (1.0 + loss)) break;
    loss = next;
  }
  return w;
}

}  // namespace eigenpose
