#include "core/base/utc_text.h"

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

TEST(UtcText, WritesSecondsAndMillisecondsOfAPointInTime) {
  const system_clock::time_point time = system_clock::from_time_t(1'795'226'584) + milliseconds(67);
  EXPECT_EQ(utc_text(time, UtcDigits::seconds), "2026-11-21T02:03:04Z");
  EXPECT_EQ(utc_text(time, UtcDigits::milliseconds), "2026-11-21T02:03:04.067Z");
}

TEST(UtcText, CutsOffAndNeverRoundsUpAlsoBefore1970) {
  EXPECT_EQ(utc_text(system_clock::time_point(std::chrono::microseconds(999'999)), UtcDigits::milliseconds),
            "1970-01-01T00:00:00.999Z");
  EXPECT_EQ(utc_text(system_clock::time_point(milliseconds(-1)), UtcDigits::milliseconds),
            "1969-12-31T23:59:59.999Z");
}

}  // namespace
}  // namespace eigenpose
