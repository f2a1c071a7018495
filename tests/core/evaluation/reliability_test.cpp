#include "core/evaluation/reliability.h"

#include <limits>

#include <gmock/gmock.h>

#include "tests/core/evaluation/made_records.h"

namespace eigenpose {
namespace {

using testing::made_record;
using testing::nothing_found;
using testing::unknown_object;

RegionRecord with_confidence(double confidence, bool right, Verdict verdict = Verdict::recognized) {
  RegionRecord record = made_record(0, right ? 0 : 1, verdict);
  record.confidence = confidence;
  return record;
}

TEST(Reliability, ExpectedCalibrationErrorIsThatComputedByHand) {
  // Bin 9: confidences 0.9, 1.0, 0.95 and 0.95, three of four right: |0.75 - 0.95| = 0.2.
  // Bin 2: 0.25 and 0.25, one right: |0.5 - 0.25| = 0.25. ECE = 4/6 0.2 + 2/6 0.25.
  const Reliability result = reliability(
      std::vector{with_confidence(0.9, true), with_confidence(1.0, true), with_confidence(0.95, true),
                  with_confidence(0.95, false), with_confidence(0.25, true, Verdict::unknown),
                  unknown_object(with_confidence(0.25, true, Verdict::ambiguous))});
  EXPECT_EQ(result.regions, 6U);
  EXPECT_EQ(result.unknown, 1U);
  EXPECT_EQ(result.bins[9].regions, 4U);
  EXPECT_EQ(result.bins[9].right, 3U);
  EXPECT_DOUBLE_EQ(result.bins[9].right_share(), 0.75);
  EXPECT_DOUBLE_EQ(result.bins[9].mean_confidence, 0.95);
  EXPECT_EQ(result.bins[2].regions, 2U);
  EXPECT_EQ(result.bins[2].right, 1U) << "an unknown object is never right";
  EXPECT_EQ(result.bins[5].regions, 0U);
  EXPECT_NEAR(result.expected_calibration_error, 0.8 / 6.0 + 0.5 / 6.0, 1e-12);
}

TEST(Reliability, CountsMatchedRegionsAlone) {
  const Reliability result =
      reliability(std::vector{nothing_found(0), with_confidence(0.5, true, Verdict::touches_border)});
  EXPECT_EQ(result.regions, 0U);
  EXPECT_EQ(result.expected_calibration_error, 0.0);
}

TEST(Reliability, ABinBeginsWithItsLowerBound) {
  const Reliability result = reliability(std::vector{with_confidence(0.5, true), with_confidence(0.0, true)});
  EXPECT_EQ(result.bins[5].regions, 1U);
  EXPECT_EQ(result.bins[4].regions, 0U);
  EXPECT_EQ(result.bins[0].regions, 1U);
}

TEST(Reliability, TakesAConfidenceOutsideItsRangeAsTheNearestInside) {
  const Reliability result =
      reliability(std::vector{with_confidence(1.5, true), with_confidence(-0.5, false),
                              with_confidence(std::numeric_limits<double>::quiet_NaN(), false)});
  EXPECT_EQ(result.bins[9].regions, 1U);
  EXPECT_EQ(result.bins[9].mean_confidence, 1.0);
  EXPECT_EQ(result.bins[0].regions, 2U);
  EXPECT_EQ(result.expected_calibration_error, 0.0);
}

}  // namespace
}  // namespace eigenpose
