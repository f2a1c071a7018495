// Numbers and moments of frames, from what drivers say of them.

#include "drivers/v4l2/frame_ledger.h"

#include <gtest/gtest.h>

namespace eigenpose::test {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

constexpr milliseconds frame_interval(40);
const TimePoint filled_at = TimePoint{} + hours(10);

FrameLedger ledger_of(std::optional<Duration> exposure, int internal_frames) {
  FrameLedger ledger;
  ledger.restart({frame_interval, exposure, internal_frames}, filled_at);
  return ledger;
}

/// Filled at `filled_at`, known to be empty `frame_interval` before.
FilledBuffer stamped(TimePoint stamp, bool monotonic = true, bool of_start = false) {
  FilledBuffer buffer;
  buffer.stamp = stamp;
  buffer.stamp_is_monotonic = monotonic;
  buffer.stamp_is_start = of_start;
  buffer.not_before = filled_at - frame_interval;
  return buffer;
}

TEST(FrameLedger, TakesReadoutExposureAndHeldFramesFromAStampOfTheEnd) {
  for (const int held : {0, 1, 2, 3})
    EXPECT_EQ(
        ledger_of(milliseconds(7), held).exposure_start(stamped(filled_at - milliseconds(5)), filled_at),
        filled_at - milliseconds(5) - frame_interval - milliseconds(7) - held * frame_interval)
        << held;
}

TEST(FrameLedger, AStampOfTheStartHasNoReadoutBeforeIt) {
  EXPECT_EQ(ledger_of(milliseconds(7), 2)
                .exposure_start(stamped(filled_at - milliseconds(5), true, true), filled_at),
            filled_at - milliseconds(5) - milliseconds(7) - 2 * frame_interval);
}

TEST(FrameLedger, AnExposureThatIsNotKnownMayTakeTheWholeInterval) {
  EXPECT_EQ(ledger_of(std::nullopt, 0).exposure_start(stamped(filled_at), filled_at),
            filled_at - frame_interval - frame_interval);
}

TEST(FrameLedger, AStampThatCannotBeTrustedIsReplacedByWhenTheBufferWasEmpty) {
  const TimePoint pessimistic =
      filled_at - frame_interval - frame_interval - milliseconds(7) - frame_interval;
  const FrameLedger ledger = ledger_of(milliseconds(7), 1);
  EXPECT_EQ(ledger.exposure_start(stamped(filled_at, false), filled_at), pessimistic) << "another clock";
  EXPECT_EQ(ledger.exposure_start(stamped(filled_at - hours(1)), filled_at), pessimistic) << "an hour old";
  EXPECT_EQ(ledger.exposure_start(stamped(filled_at + hours(1)), filled_at), pessimistic) << "an hour ahead";
  EXPECT_EQ(ledger.exposure_start(stamped(TimePoint{}), filled_at), pessimistic) << "zero";
  EXPECT_EQ(ledger.exposure_start(stamped(filled_at - hours(1), true, true), filled_at), pessimistic)
      << "of the start, as it claims";
}

TEST(FrameLedger, NumbersGoOnAcrossRestartsAndWraps) {
  FrameLedger ledger = ledger_of(std::nullopt, 0);
  EXPECT_EQ(ledger.number(4'294'967'294U, filled_at), 1U);
  EXPECT_EQ(ledger.number(4'294'967'295U, filled_at), 2U);
  EXPECT_EQ(ledger.number(0, filled_at), 3U);
  EXPECT_EQ(ledger.number(3, filled_at), 6U) << "two were missed";
  ledger.restart({frame_interval, std::nullopt, 0}, filled_at);
  EXPECT_EQ(ledger.number(0, filled_at), 7U);
}

TEST(FrameLedger, ALeapBeyondWhatTimeAllowsIsOneFrame) {
  FrameLedger ledger = ledger_of(std::nullopt, 0);
  ledger.number(0, filled_at);
  EXPECT_EQ(ledger.number(100, filled_at), 101U) << "a burst";
  EXPECT_EQ(ledger.number(201, filled_at), 102U);
  EXPECT_EQ(ledger.number(201 + 300, filled_at + 100 * frame_interval), 402U)
      << "twice 100 intervals and 100";
  EXPECT_EQ(ledger.number(501 + 301, filled_at + 200 * frame_interval), 403U);
  EXPECT_EQ(ledger.number(802, filled_at + 201 * frame_interval), 404U) << "a number that stands still";
  EXPECT_EQ(ledger.number(800, filled_at + 202 * frame_interval), 405U) << "one that goes back";
}

}  // namespace
}  // namespace eigenpose::test
