#include "core/learning/calibration/logistic_fit.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace eigenpose {
namespace {

/// Samples whose log-odds are `weights`·(1, x), x uniform in ±3.
LogisticSamples drawn(int count, const Eigen::Vector2d& weights) {
  SeededRandom random(7);
  LogisticSamples samples;
  samples.terms.resize(2, count);
  for (int i = 0; i < count; ++i) {
    samples.terms.col(i) << 1.0, 3.0 * random.symmetric();
    samples.positive.push_back(random.unit() < 1.0 / (1.0 + std::exp(-weights.dot(samples.terms.col(i)))));
  }
  return samples;
}

const Eigen::VectorXd wide = Eigen::VectorXd::Constant(2, 100.0);

TEST(LogisticFit, FindsTheWeightsThatTheSamplesWereDrawnWith) {
  const Eigen::VectorXd found = fit_log_odds(drawn(20000, {0.0, 1.5}), Eigen::VectorXd::Zero(2), wide);
  EXPECT_NEAR(found(0), 0.0, 0.1);
  EXPECT_NEAR(found(1), 1.5, 0.1);
}

TEST(LogisticFit, IsAtAMaximumOfThePosterior) {
  const LogisticSamples samples = drawn(300, {0.0, 1.0});
  const Eigen::VectorXd prior = Eigen::Vector2d(0.5, -1.0);
  const Eigen::VectorXd sigma = Eigen::Vector2d(0.7, 0.2);
  const Eigen::VectorXd found = fit_log_odds(samples, prior, sigma);
  // The gradient by differences of the posterior, written out.
  double positives = 0.0;
  for (const bool positive : samples.positive) positives += positive ? 1.0 : 0.0;
  const double negatives = 300.0 - positives;
  const auto loss = [&](const Eigen::VectorXd& w) {
    double sum = 0.5 * (w - prior).cwiseQuotient(sigma).squaredNorm();
    for (int i = 0; i < 300; ++i) {
      const bool positive = samples.positive[static_cast<std::size_t>(i)];
      const double odds = (positive ? -1.0 : 1.0) * w.dot(samples.terms.col(i));
      sum += std::min(positives, negatives) / (positive ? positives : negatives) * std::log1p(std::exp(odds));
    }
    return sum;
  };
  for (int k = 0; k < 2; ++k) {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(2);
    step(k) = 1e-3;
    EXPECT_LT(loss(found), loss(found + step));
    EXPECT_LT(loss(found), loss(found - step));
  }
}

TEST(LogisticFit, BothClassesWeighTheSameHoweverManyThereAre) {
  LogisticSamples few = drawn(400, {0.0, 1.0});
  LogisticSamples more = few;
  // Every positive sample ten times over.
  for (int i = 0; i < 400; ++i)
    if (few.positive[static_cast<std::size_t>(i)])
      for (int copy = 0; copy < 9; ++copy) {
        more.terms.conservativeResize(2, more.terms.cols() + 1);
        more.terms.rightCols(1) = few.terms.col(i);
        more.positive.push_back(true);
      }
  const auto a = fit_log_odds(few, Eigen::VectorXd::Zero(2), wide);
  const auto b = fit_log_odds(more, Eigen::VectorXd::Zero(2), wide);
  EXPECT_NEAR((a - b).norm(), 0.0, 1e-3);
}

TEST(LogisticFit, IsThePriorWithoutSamplesOfEitherClassAndNearItWithLittleWeight) {
  const Eigen::VectorXd prior = Eigen::Vector2d(2.0, -3.0);
  EXPECT_EQ(fit_log_odds({Eigen::MatrixXd(2, 0), {}}, prior, wide), prior);
  LogisticSamples one_class = drawn(50, {0.0, 1.0});
  one_class.positive.assign(50, true);
  EXPECT_EQ(fit_log_odds(one_class, prior, wide), prior);
  LogisticSamples samples = drawn(500, {0.0, 1.0});
  samples.most_weight = 1e-6;
  EXPECT_NEAR((fit_log_odds(samples, prior, Eigen::VectorXd::Ones(2)) - prior).norm(), 0.0, 1e-3);
}

TEST(LogisticFit, StaysFiniteWhereTheClassesAreSeparate) {
  LogisticSamples samples;
  samples.terms.resize(2, 4);
  samples.terms << 1, 1, 1, 1, -2, -1, 1, 2;
  samples.positive = {false, false, true, true};
  const auto found = fit_log_odds(samples, Eigen::VectorXd::Zero(2), wide);
  EXPECT_TRUE(found.allFinite());
  EXPECT_GT(found(1), 1.0);
}

TEST(LogisticFit, RefusesSizesThatDoNotFit) {
  const LogisticSamples samples = drawn(10, {0.0, 1.0});
  EXPECT_THROW(fit_log_odds(samples, Eigen::VectorXd::Zero(3), Eigen::VectorXd::Ones(3)),
               std::invalid_argument);
  EXPECT_THROW(fit_log_odds(samples, Eigen::VectorXd::Zero(2), Eigen::VectorXd::Ones(1)),
               std::invalid_argument);
  LogisticSamples short_one = samples;
  short_one.positive.pop_back();
  EXPECT_THROW(fit_log_odds(short_one, Eigen::VectorXd::Zero(2), wide), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
