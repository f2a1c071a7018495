#include "core/base/work_meter.h"

#include <string>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "tests/support/serial_progress.h"

namespace eigenpose {
namespace {

TEST(WorkMeter, ReportsOneCallAtATimeAndInOrder) {
  constexpr std::size_t units = 20000;
  test::SerialProgress heard;
  const Progress progress = heard.listener();
  WorkMeter meter(progress, {}, "counting", units);
  parallel_for(units, 4, [&](std::size_t) { meter.finished(1); });
  heard.expect_complete();
}

TEST(WorkMeter, AddsUnitsUp) {
  std::size_t done = 0;
  std::size_t total = 0;
  std::string stage;
  const Progress progress = [&](const ProgressUpdate& update) {
    done = update.done;
    total = update.total;
    stage = update.stage;
  };
  WorkMeter meter(progress, {}, "adding", 10);
  meter.finished(3);
  EXPECT_EQ(done, 3U);
  meter.finished(4);
  EXPECT_EQ(done, 7U);
  EXPECT_EQ(total, 10U);
  EXPECT_EQ(stage, "adding");
}

TEST(WorkMeter, StopsWorkAndSaysDuringWhat) {
  std::stop_source source;
  const Progress silent;
  WorkMeter meter(silent, source.get_token(), "adding", 2);
  meter.check_stop();
  meter.finished(1);
  source.request_stop();
  EXPECT_THROW(meter.check_stop(), Interrupted);
  try {
    meter.finished(1);
    FAIL() << "a stop was requested";
  } catch (const Interrupted& interrupted) {
    EXPECT_STREQ(interrupted.what(), "interrupted while adding");
  }
}

}  // namespace
}  // namespace eigenpose
