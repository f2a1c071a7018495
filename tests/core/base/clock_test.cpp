#include "core/base/clock.h"

#include <atomic>
#include <thread>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

using std::chrono::hours;
using std::chrono::seconds;

TEST(SteadyClock, SleepEndsAtOnceWhenStopped) {
  std::stop_source stop;
  std::jthread stopper([&] { stop.request_stop(); });
  EXPECT_FALSE(SteadyClock().sleep_for(hours(1), stop.get_token()));
}

TEST(SteadyClock, SleepForThePastReturnsTrue) {
  EXPECT_TRUE(SteadyClock().sleep_for(seconds(-1)));
}

TEST(ManualClock, SleeperWakesWhenItsTimeHasCome) {
  ManualClock clock;
  std::atomic<bool> woke = false;
  const TimePoint when = clock.now() + seconds(10);
  std::jthread sleeper([&] { woke = clock.sleep_until(when, {}); });
  clock.advance(seconds(9));
  EXPECT_FALSE(woke);
  clock.advance(seconds(1));
  sleeper.join();
  EXPECT_TRUE(woke);
}

}  // namespace
}  // namespace eigenpose
