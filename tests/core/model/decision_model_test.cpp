#include "core/model/decision_model.h"

#include <cmath>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(DecisionModel, ADistanceHasTheEvidenceItWasAskedFor) {
  DecisionModel decision;
  decision.weights.whole = {-5.0, -7.0, 3.0};
  for (const double typical : {0.02, 1e-9})
    for (const double evidence : {-3.0, 0.0, 4.0}) {
      const double distance = decision.distance_of(evidence, typical);
      EXPECT_NEAR(-5.0 - 7.0 * std::log(distance) + 3.0 * std::log(std::max(typical, least_distance)),
                  evidence, 1e-9);
    }
  decision.weights.whole[1] = 0.0;
  EXPECT_TRUE(std::isinf(decision.distance_of(0.0, 0.02)));
}

TEST(DecisionModel, ADistanceIsThatOfARegionWithUsualColours) {
  DecisionModel decision;
  decision.weights.whole = {-5.0, -7.0, 3.0, -6.0, 5.0};
  for (const double color : {0.1, 1e-9}) {
    const double distance = decision.distance_of(1.0, 0.02, color);
    const double h = std::log(std::max(color, least_color_distance));
    EXPECT_NEAR(-5.0 - 7.0 * std::log(distance) + 3.0 * std::log(0.02) - 6.0 * h + 5.0 * h, 1.0, 1e-9);
  }
}

TEST(DecisionModel, BothRatesFollowTheThreshold) {
  DecisionModel decision;
  decision.known = {1.0, 2.0, 3.0, 4.0};
  decision.unknown = {-2.0, -1.0, 0.0, 3.5};
  EXPECT_EQ(rates_at(decision, 2.5), (DecisionRates{0.5, 0.25}));
  EXPECT_EQ(rates_at(decision, 3.5), (DecisionRates{0.75, 0.25})) << "as much evidence is enough";
  EXPECT_EQ(rates_at(decision, -9.0), (DecisionRates{0.0, 1.0}));
  EXPECT_EQ(rates_at({}, 0.0), (DecisionRates{0.0, 0.0}));
}

TEST(DecisionModel, GivesUpFalseRejectionWhereMoreAreExpectedThanWereSetAndThanTheViewsExplain) {
  DecisionModel decision;
  decision.known = {1.0, 2.0, 3.0, 4.0};
  decision.held_for_acceptance = true;
  EXPECT_DOUBLE_EQ(decision.smallest_rate(), 0.2);
  struct Case {
    double set;
    double expected;
    bool gives_up;
  };
  for (const Case& one : {Case{0.3, 0.25, false},
                          {0.3, 0.35, true},
                          {0.01, 0.19, false},
                          {0.01, 0.2, false},
                          {0.01, 0.21, true}}) {
    decision.set.false_rejection = one.set;
    decision.expected.false_rejection = one.expected;
    EXPECT_EQ(decision.gives_up_false_rejection(), one.gives_up) << one.set << ", " << one.expected;
  }
  decision.held_for_acceptance = false;
  EXPECT_FALSE(decision.gives_up_false_rejection()) << "the views alone fall short";
}

}  // namespace
}  // namespace eigenpose
