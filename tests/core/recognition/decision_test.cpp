#include "core/recognition/decision.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/recognition/outcome.h"

namespace eigenpose {
namespace {

constexpr double none = -std::numeric_limits<double>::infinity();

TEST(Decision, EvidenceIsTheSumOfWeightedTerms) {
  EvidenceWeights weights;
  weights.whole = {1.0, 2.0, 3.0, 4.0, 5.0};
  weights.windows = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0};
  weights.occluded = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0};
  const WholeMatch whole{0.1, 0.02, 0.2};
  const WindowsMatch windows{0.7, 0.8, 0.4, 0.1};
  EXPECT_NEAR(evidence_of(weights, whole), 1.0 + 2.0 * std::log(0.1) + 3.0 * std::log(0.02), 1e-12);
  EXPECT_NEAR(evidence_of(weights, whole, windows),
              1.0 + 2.0 * std::log(0.1) + 3.0 * std::log(0.02) + 4.0 * std::log(0.2) + 5.0 * 0.7 + 6.0 * 0.8 +
                  7.0 * 0.4 + 8.0 * std::log(0.25),
              1e-12);
  const OccludedMatch occluded{windows, 0.3, 150.0, 0.1, 0.05};
  EXPECT_NEAR(evidence_of(weights, occluded),
              1.0 + 2.0 * 0.7 + 3.0 * 0.8 + 4.0 * 0.4 + 5.0 * std::log(0.25) + 6.0 * 0.3 + 7.0 * 1.5 +
                  8.0 * 0.2 + 9.0 * 0.05,
              1e-12);
  // Colours, where views have some.
  const ColorMatch color{0.2, 0.15};
  WholeMatch colored = whole;
  colored.color = color;
  EXPECT_NEAR(evidence_of(weights, colored) - evidence_of(weights, whole),
              4.0 * std::log(0.2) + 5.0 * std::log(0.15), 1e-12);
  EXPECT_NEAR(evidence_of(weights, colored, windows) - evidence_of(weights, whole, windows),
              9.0 * std::log(0.2) + 10.0 * std::log(0.15), 1e-12);
  OccludedMatch colored_part = occluded;
  colored_part.color = color;
  EXPECT_NEAR(evidence_of(weights, colored_part) - evidence_of(weights, occluded),
              10.0 * std::log(0.2) + 11.0 * std::log(0.15), 1e-12);
}

TEST(Decision, ColoursNearerThanNoiseAreAllTheSame) {
  const auto terms = [](double h) {
    return whole_terms({.distance = 0.1, .typical = 0.1, .color = ColorMatch{h, h}});
  };
  EXPECT_EQ(terms(0.0), terms(0.08));
  EXPECT_NE(terms(0.08), terms(0.09));
}

TEST(Decision, TermsStayFiniteAtTheEdgesOfWhatIsMeasured) {
  for (const double h : {0.0, 1.0})
    for (const double term : occluded_terms({{0.0, 0.0, 0.0, 0.0}, 0.0, 0.0, 0.0, 0.0, ColorMatch{h, h}}))
      EXPECT_TRUE(std::isfinite(term));
  for (const double term : windows_terms({0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}))
    EXPECT_TRUE(std::isfinite(term));
  for (const double term : windows_terms({2.0, 2.0, 2.0}, {1.0, 1.0, 1.0, std::nullopt}))
    EXPECT_TRUE(std::isfinite(term));
}

TEST(Decision, ObjectsFarAwayDoNotChangeTheEvidence) {
  const WindowsMatch windows{0.7, 0.8, 0.4, 0.1};
  EXPECT_EQ(windows_terms({0.1, 0.02, 0.4}, windows), windows_terms({0.1, 0.02, 1.9}, windows));
  EXPECT_NE(windows_terms({0.1, 0.02, 0.2}, windows), windows_terms({0.1, 0.02, 0.1}, windows));
}

TEST(Decision, ConfidenceIsThePosteriorOfTheBestBesideTheSecondAndAnUnknownObject) {
  EXPECT_DOUBLE_EQ(confidence_of(0.0, none), 0.5);
  EXPECT_DOUBLE_EQ(confidence_of(0.0, 0.0), 1.0 / 3.0);
  EXPECT_NEAR(confidence_of(3.0, 1.0), std::exp(3.0) / (std::exp(3.0) + std::exp(1.0) + 1.0), 1e-12);
  EXPECT_DOUBLE_EQ(confidence_of(1e4, none), 1.0);
  EXPECT_DOUBLE_EQ(confidence_of(-1e4, none), 0.0);
  EXPECT_DOUBLE_EQ(confidence_of(1e4, 1e4), 0.5);
}

TEST(Decision, TheVerdictFollowsTheRequiredEvidenceAndTheLeadOverTheSecond) {
  const auto verdict = [](double best, double second) { return verdict_of({best, second, 1.0}, {}); };
  EXPECT_EQ(verdict(0.99, none), Verdict::unknown);
  EXPECT_EQ(verdict(1.0, none), Verdict::recognized);
  EXPECT_EQ(verdict(5.0, 4.2), Verdict::ambiguous);
  EXPECT_EQ(verdict(5.0, 4.1), Verdict::recognized);
  EXPECT_EQ(verdict(1.2, 0.9), Verdict::recognized) << "the second would not be accepted itself";
}

TEST(Decision, AnOutcomeCarriesWhatDecidedIt) {
  Outcome outcome;
  outcome.decide({3.0, 1.0, -2.0}, {});
  EXPECT_EQ(outcome.verdict, Verdict::recognized);
  EXPECT_EQ(outcome.evidence, 3.0);
  EXPECT_EQ(outcome.required_evidence, -2.0);
  EXPECT_EQ(outcome.confidence, confidence_of(3.0, 1.0));
  outcome.decide({-3.0, none, -2.0}, {});
  EXPECT_EQ(outcome.verdict, Verdict::unknown);
}

}  // namespace
}  // namespace eigenpose
