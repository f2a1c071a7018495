#include "core/learning/calibration/match_calibration.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/alignment/misalignment.h"

namespace eigenpose {
namespace {

/// Objects whose left-out views missed 0.05, 0.1 … 5 times what was expected, and that are `apart` from each
/// other.
std::vector<MatchEvidence> even_evidence(std::size_t objects, double scale, double apart) {
  std::vector<MatchEvidence> evidence(objects);
  for (MatchEvidence& own : evidence) {
    own.scale = scale;
    own.typical_distance = scale;
    own.growth = 4.0;
    own.views = 100;
    own.missed = 4.0 * scale * scale;
    for (int i = 1; i <= 100; ++i) {
      own.learned.push_back(1e-6 * i);
      own.factors.push_back(0.05 * i);
      own.others.push_back(apart);
    }
  }
  return evidence;
}

MatchCalibrationOptions at_rate(double rate) {
  MatchCalibrationOptions options;
  options.rate = rate;
  return options;
}

TEST(MatchThresholds, HoldTheRateThatIsAskedFor) {
  auto evidence = even_evidence(10, 0.02, 9.0);
  evidence[3].missed *= 4.0;  // one whose views are worth less
  for (const double rate : {0.01, 0.05, 0.2}) {
    const MatchThresholds found = match_thresholds(evidence, at_rate(rate));
    for (std::size_t o = 0; o < evidence.size(); ++o) {
      std::size_t beyond = 0;
      for (const double learned : evidence[o].learned)
        for (const double factor : evidence[o].factors)
          if (std::sqrt(learned + factor * evidence[o].missed / 4.0) > found.rejection_distance[o]) ++beyond;
      EXPECT_LE(static_cast<double>(beyond) / 10000.0, rate);
      EXPECT_GE(static_cast<double>(beyond) / 10000.0, rate - 0.02) << "laxer than was asked for";
    }
  }
}

TEST(MatchThresholds, SayTheSmallestRateThatTheViewsSupport) {
  const auto evidence = even_evidence(3, 0.02, 9.0);
  const MatchThresholds found = match_thresholds(evidence, at_rate(0.0));
  EXPECT_DOUBLE_EQ(found.smallest_rate, 1.0 / 301.0);
  EXPECT_DOUBLE_EQ(found.rejection_distance[0],
                   match_thresholds(evidence, at_rate(1.0 / 301.0)).rejection_distance[0]);
}

TEST(MatchThresholds, LeaveRoomToObjectsOfOneView) {
  // Of a single view it is not known what the spline misses.
  std::vector<MatchEvidence> evidence(2);
  for (MatchEvidence& own : evidence) {
    own.views = 1;
    own.scale = 0.02;
    own.missed = 4e-4;
    own.learned = {4e-4};
    own.others = {1.0};
  }
  EXPECT_NEAR(match_thresholds(evidence, at_rate(0.001)).rejection_distance[0], std::sqrt(8e-4), 1e-6);
}

TEST(MatchThresholds, StayBelowTheDistanceOfOtherObjects) {
  const MatchThresholds found = match_thresholds(even_evidence(3, 0.02, 0.03), at_rate(0.001));
  for (const double distance : found.rejection_distance) EXPECT_DOUBLE_EQ(distance, 0.03);
  // However near the others are, what its own views need on average is left to an object.
  EXPECT_DOUBLE_EQ(match_thresholds(even_evidence(3, 0.02, 0.001), at_rate(0.001)).rejection_distance[0],
                   0.02);
}

TEST(MatchThresholds, UseNothingOfAnObjectThatIsLeftOut) {
  auto evidence = even_evidence(3, 0.02, 0.5);
  evidence[1].others.assign(100, 0.03);
  evidence[1].factors.assign(100, 50.0);
  evidence[1].false_lead = 0.01;
  const MatchThresholds without = match_thresholds(evidence, at_rate(0.001), 1);
  evidence.erase(evidence.begin() + 1);
  const MatchThresholds never = match_thresholds(evidence, at_rate(0.001));
  EXPECT_DOUBLE_EQ(without.rejection_distance[0], never.rejection_distance[0]);
  EXPECT_DOUBLE_EQ(without.rejection_distance[2], never.rejection_distance[1]);
  EXPECT_DOUBLE_EQ(without.sure_ratio, never.sure_ratio);
}

TEST(MatchThresholds, CountNoLeadThatAWrongObjectHasHad) {
  auto evidence = even_evidence(2, 0.02, 0.5);
  const double before = match_thresholds(evidence, at_rate(0.001)).sure_ratio;
  evidence[0].false_lead = 0.1;
  EXPECT_LT(match_thresholds(evidence, at_rate(0.001)).sure_ratio, std::min(before, 0.1));
}

TEST(Misalignment, UndoneIsThePictureItself) {
  // A smooth picture, so that resampling twice loses little.
  constexpr int side = 64;
  const auto at = [](double x, double y) {
    return std::exp(-((x - 30) * (x - 30) / 150 + (y - 34) * (y - 34) / 90));
  };
  const Misalignment m{0.0, 0.03, -0.02, 0.04, 0.05};
  std::vector<float> moved(side * side);
  std::vector<float> undone(side * side);
  const double middle = 0.5 * (side - 1);
  const double cosine = std::cos(m.rotation);
  const double sine = std::sin(m.rotation);
  for (int r = 0; r < side; ++r)
    for (int c = 0; c < side; ++c) {
      // Where a pixel of the moved picture comes from.
      const double u = (c - middle - side * m.dx) / (1.0 + m.scale);
      const double v = (r - middle - side * m.dy) / (1.0 + m.scale);
      moved[static_cast<std::size_t>(r * side + c)] =
          static_cast<float>(at(middle + cosine * u + sine * v, middle - sine * u + cosine * v));
    }
  const float energy = undo_misalignment(moved, side, 1, m, undone);
  double squared = 0.0;
  double total = 0.0;
  for (int r = 0; r < side; ++r)
    for (int c = 0; c < side; ++c) {
      const double expected = at(c, r);
      squared += std::pow(undone[static_cast<std::size_t>(r * side + c)] - expected, 2);
      total += expected * expected;
    }
  EXPECT_LT(std::sqrt(squared / total), 0.01) << "bilinear interpolation costs less than 1 %";
  EXPECT_NEAR(energy, std::sqrt(total), 0.01 * std::sqrt(total));
}

}  // namespace
}  // namespace eigenpose
