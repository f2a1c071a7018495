#pragma once

/// Logistic regression with a prior on the weights.

#include <vector>

#include <Eigen/Core>

namespace eigenpose {

/// What a regression is made from.
struct LogisticSamples {
  Eigen::MatrixXd terms;       ///< one column a sample
  std::vector<bool> positive;  ///< one a sample
  double most_weight = 1e9;    ///< bound on the total weight of each class, in samples
};

/// The weights w of log-odds w·φ that are most probable where each is normal about its prior mean (maximum a
/// posteriori; Newton's method, Bishop 2006, section 4.5): both classes weigh the same. Without samples of
/// either class, the prior.
/// @param prior_sigma of each weight, positive. @throws std::invalid_argument for sizes that do not fit.
Eigen::VectorXd fit_log_odds(const LogisticSamples& samples, const Eigen::VectorXd& prior,
                             const Eigen::VectorXd& prior_sigma);

}  // namespace eigenpose
