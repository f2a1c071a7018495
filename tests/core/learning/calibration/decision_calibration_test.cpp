#include "core/learning/calibration/decision_calibration.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace eigenpose {
namespace {

/// Probes of the whole region alone: ln d normal about `apart`/2 below and above −3, with spread 1.
std::vector<Probe> drawn(std::size_t objects, std::size_t views, double apart) {
  SeededRandom random(11);
  const auto normal = [&] {
    double sum = 0.0;
    for (int i = 0; i < 12; ++i) sum += random.unit();
    return sum - 6.0;
  };
  std::vector<Probe> probes;
  for (std::size_t o = 0; o < objects; ++o)
    for (std::size_t v = 0; v < views; ++v)
      for (const bool known : {true, false}) {
        const std::size_t taken_for = known ? o : (o + 1) % objects;
        const double middle = -3.0 + (known ? -0.5 : 0.5) * apart;
        probes.push_back({o, taken_for, known, false, {std::exp(middle + normal()), 0.05, 0.3}, {}, {}});
      }
  return probes;
}

TEST(DecisionCalibration, TheThresholdRejectsTheShareOfKnownViewsThatWasSet) {
  const auto probes = drawn(20, 50, 8.0);
  for (const double rate : {0.05, 0.1, 0.3}) {
    const DecisionModel decision = calibrate_decision(probes, {rate, 1.0});
    EXPECT_NEAR(decision.expected.false_rejection, rate, 0.005) << rate;
    EXPECT_FALSE(decision.gives_up_false_rejection());
  }
}

TEST(DecisionCalibration, TheRateOfFalseAcceptancesWinsWhereBothCannotBeHeld) {
  const auto probes = drawn(20, 50, 2.0);
  for (const double rate : {0.06, 0.1, 0.3}) {
    const DecisionModel decision = calibrate_decision(probes, {0.001, rate});
    EXPECT_NEAR(decision.expected.false_acceptance, rate, 0.02) << rate;
    EXPECT_TRUE(decision.gives_up_false_rejection()) << rate;
  }
}

TEST(DecisionCalibration, RatesThatFewProbesShowFollowTheTail) {
  // Of log-normal distances one in a thousand lies 3.1 spreads off the middle.
  const auto probes = drawn(20, 50, 14.0);
  const DecisionModel decision = calibrate_decision(probes, {0.001, 1.0});
  const std::size_t below = static_cast<std::size_t>(
      std::ranges::lower_bound(decision.known, decision.required) - decision.known.begin());
  EXPECT_LE(below, 3U) << "of a thousand";
  const DecisionModel laxer = calibrate_decision(probes, {0.0001, 1.0});
  EXPECT_LT(laxer.required, decision.required) << "a smaller rate, though no probe shows it";
  EXPECT_TRUE(std::isfinite(laxer.required));
}

TEST(DecisionCalibration, OneObjectHasTheThresholdThatLogOddsMean) {
  std::vector<Probe> probes;
  for (int i = 0; i < 40; ++i) probes.push_back({0, 0, true, false, {0.001, 0.001, 0.3}, {}, {}});
  const DecisionModel decision = calibrate_decision(probes, {0.001, 0.01});
  EXPECT_GE(decision.required, 0.5 * std::log(100.0) - 1e-9);
  EXPECT_EQ(decision.weights, prior_weights(ViewColors::none)) << "there is nothing to learn them from";
  for (Probe& probe : probes) probe.whole.color = ColorMatch{0.05, 0.05};
  EXPECT_EQ(calibrate_decision(probes, {0.001, 0.01}).weights, prior_weights(ViewColors::some));
}

TEST(DecisionCalibration, ColoursTellKnownFromUnknownWhereDistancesDoNot) {
  auto probes = drawn(20, 40, 0.5);
  SeededRandom random(5);
  for (Probe& probe : probes)
    probe.whole.color = ColorMatch{(probe.known ? 0.12 : 0.66) * std::exp(0.4 * random.symmetric()), 0.12};
  const DecisionModel decision = calibrate_decision(probes, {0.01, 0.01});
  EXPECT_LE(decision.expected.false_rejection, 0.01);
  EXPECT_LE(decision.expected.false_acceptance, 0.01);
}

TEST(DecisionCalibration, AsksMoreWhereAFewObjectsCauseTheFalseAcceptancesThanWhereAllDo) {
  // The worst of a few is not among the others when it is left out.
  constexpr std::size_t objects = 30;
  auto few = drawn(objects, 40, 3.0);
  for (Probe& probe : few)
    if (!probe.known && probe.object < 4)
      probe.whole.distance *= std::exp(-0.4 * (1.0 + static_cast<double>(probe.object)));
  auto all = few;  // the same evidence, spread over all objects
  std::size_t next = 0;
  for (Probe& probe : all)
    if (!probe.known) {
      probe.object = next++ % objects;
      probe.taken_for = (probe.object + 1) % objects;
    }
  for (const double rate : {0.01, 0.02}) {
    const DecisionModel by_few = calibrate_decision(few, {0.0001, rate});
    const DecisionModel by_all = calibrate_decision(all, {0.0001, rate});
    EXPECT_EQ(by_few.weights, by_all.weights);
    EXPECT_GT(by_few.required, by_all.required + 0.1) << rate;
    EXPECT_LT(by_few.expected.false_acceptance, rate) << rate;
  }
}

TEST(DecisionCalibration, ForgetsTheObjectThatIsLeftOut) {
  auto probes = drawn(10, 30, 6.0);
  const DecisionModel rest = calibrate_decision(probes, {}, 3);
  std::erase_if(probes, [](const Probe& probe) { return probe.object == 3 || probe.taken_for == 3; });
  const DecisionModel never = calibrate_decision(probes, {});
  EXPECT_EQ(rest.required, never.required);
  EXPECT_EQ(rest.weights, never.weights);
  EXPECT_EQ(rest.known, never.known);
}

TEST(DecisionCalibration, AHigherRateOfFalseRejectionsIsNeverLaxer) {
  const auto probes = drawn(12, 40, 5.0);
  double before = -1e9;
  for (const double rate : {0.0001, 0.001, 0.01, 0.05, 0.2, 0.5}) {
    const double required = calibrate_decision(probes, {rate, 1.0}).required;
    EXPECT_GE(required, before) << rate;
    before = required;
  }
}

TEST(DecisionCalibration, SettlesWithNoLessThanTheRequiredEvidence) {
  for (const double apart : {1.0, 4.0, 10.0}) {
    const DecisionModel decision = calibrate_decision(drawn(12, 40, apart), {0.05, 0.01});
    EXPECT_GE(decision.settled, decision.required);
    EXPECT_TRUE(std::ranges::is_sorted(decision.known));
    EXPECT_TRUE(std::ranges::is_sorted(decision.unknown));
  }
}

TEST(DecisionCalibration, UnknownViewsReachTheThresholdOfOccludedOnesAtMostAtTheRateOfTheirKind) {
  // However many of them are taken for occluded ones.
  for (const double taken : {1.0, 0.4, 0.1, 0.03}) {
    auto probes = drawn(20, 30, 6.0);
    SeededRandom random(3);
    for (Probe& probe : probes) {
      probe.windows = WindowsProbe{probe.taken_for, probe.whole, {probe.known ? 0.8 : 0.4, 0.8, 0.3, 0.1}};
      const double votes = (probe.known ? 0.5 : 0.3) + 0.1 * random.symmetric();
      if (probe.known || random.unit() < taken)
        probe.occluded =
            OccludedProbe{probe.taken_for, {{votes, 0.8, votes - 0.2, 0.1}, 0.3, 20.0, 0.2, 0.05}};
    }
    std::vector<Probe> hidden = probes;
    for (Probe& probe : hidden) {
      probe.hidden = true;
      probe.windows.reset();
    }
    probes.insert(probes.end(), hidden.begin(), hidden.end());
    const DecisionModel decision = calibrate_decision(probes, {0.01, 0.1});
    const auto accepted = [&](bool known, bool part_hidden) {
      double weight = 0.0;
      double shown = 0.0;
      for (const Probe& probe : probes) {
        if (probe.known != known || probe.hidden != part_hidden) continue;
        shown += 1.0;
        if (probe.occluded &&
            evidence_of(decision.weights, probe.occluded->match) >= decision.required_occluded)
          weight += 1.0;
      }
      return weight / shown;
    };
    EXPECT_LE(accepted(false, false), 0.035) << taken << ": three tenths of the rate, others are visible";
    EXPECT_LE(accepted(false, true), 0.1) << taken;
    EXPECT_GE(accepted(true, true), 0.9) << taken;
  }
}

TEST(DecisionCalibration, IsFiniteAtEveryRateThatMayBeSet) {
  auto probes = drawn(20, 30, 6.0);
  for (Probe& probe : probes) {
    probe.windows = WindowsProbe{probe.taken_for, probe.whole, {probe.known ? 0.8 : 0.4, 0.8, 0.3, 0.1}};
    probe.occluded = OccludedProbe{probe.taken_for, {{0.5, 0.8, 0.3, 0.1}, 0.3, 20.0, 0.2, 0.05}};
  }
  for (const double rejection : {0.0, 0.5})
    for (const double acceptance : {0.0, 1.0})
      for (const std::size_t shown : {probes.size(), std::size_t{2}, std::size_t{1}}) {
        const DecisionRates rates{rejection, acceptance};
        const DecisionModel decision = calibrate_decision(std::span(probes).first(shown), rates);
        EXPECT_TRUE(std::isfinite(decision.required)) << rejection << " " << acceptance << " " << shown;
        EXPECT_TRUE(std::isfinite(decision.settled));
        for (const double weight : decision.weights.occluded) EXPECT_TRUE(std::isfinite(weight));
        EXPECT_EQ(decision.set, rates) << "what was set is kept as it was";
      }
}

TEST(DecisionCalibration, RefusesRatesThatAreNone) {
  EXPECT_THROW(calibrate_decision({}, {-0.1, 0.1}), std::invalid_argument);
  EXPECT_THROW(calibrate_decision({}, {0.6, 0.1}), std::invalid_argument);
  EXPECT_THROW(calibrate_decision({}, {0.1, 1.1}), std::invalid_argument);
  EXPECT_THROW(calibrate_decision({}, {std::nan(""), 0.1}), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
