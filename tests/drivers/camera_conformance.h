#pragma once

/// What every Camera must do, whatever is behind it. Include it in a test program and instantiate it with a
/// bench:
///
///   INSTANTIATE_TEST_SUITE_P(Simulated, CameraConformance, testing::Values(CameraBenchMaker{"SimCamera", []
///   { … }}),
///                            [](const auto& instance) { return instance.param.name; });

#include <atomic>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "drivers/camera.h"

namespace eigenpose::test {

/// A camera and the hands around it. A fault the bench cannot make is answered with false; its tests are
/// skipped and say so.
class CameraBench {
 public:
  virtual ~CameraBench() = default;
  CameraBench(const CameraBench&) = delete;
  CameraBench& operator=(const CameraBench&) = delete;

  virtual Camera& camera() = 0;
  virtual void destroy_camera() = 0;
  virtual const Clock& clock() = 0;
  /// Lets time pass with nobody fetching frames.
  virtual void idle(Duration duration) { clock().sleep_for(duration); }
  /// No frames come and no error either, until `stall(false)`.
  virtual bool stall(bool stalled) = 0;
  virtual bool unplug() = 0;
  virtual void plug_in() {}
  /// The next frame of the device is marked as damaged.
  virtual bool damage_next_frame() = 0;
  /// How much slower than a real machine this one may be.
  virtual int patience() { return 1; }

 protected:
  CameraBench() = default;
};

struct CameraBenchMaker {
  std::string name;
  std::function<std::unique_ptr<CameraBench>()> make;
};

inline std::ostream& operator<<(std::ostream& stream, const CameraBenchMaker& maker) {
  return stream << maker.name;
}

class CameraConformance : public testing::TestWithParam<CameraBenchMaker> {
 protected:
  void SetUp() override { bench_ = GetParam().make(); }

  Camera& camera() { return bench_->camera(); }
  TimePoint in(Duration duration) { return bench_->clock().now() + duration * bench_->patience(); }
  Frame next() { return camera().next_frame(in(std::chrono::seconds(5)), {}); }
  Duration interval() {
    return std::chrono::duration_cast<Duration>(
        std::chrono::duration<double>(1.0 / camera().info().frames_per_second));
  }

  std::unique_ptr<CameraBench> bench_;
};

TEST_P(CameraConformance, InfoDescribesTheFrames) {
  const CameraInfo info = camera().info();
  EXPECT_FALSE(info.name.empty());
  EXPECT_FALSE(info.model.empty());
  EXPECT_FALSE(info.format.empty());
  EXPECT_GT(info.frames_per_second, 0.0);
  const Frame frame = next();
  EXPECT_EQ(frame.image.cols, info.width);
  EXPECT_EQ(frame.image.rows, info.height);
  EXPECT_TRUE(frame.image.type() == CV_8UC1 || frame.image.type() == CV_8UC3 ||
              frame.image.type() == CV_16UC1);
}

TEST_P(CameraConformance, FramesComeInOrderOfExposure) {
  Frame last = next();
  for (int i = 0; i < 10; ++i) {
    const Frame frame = next();
    EXPECT_GT(frame.sequence, last.sequence);
    EXPECT_GT(frame.exposure_start, last.exposure_start);
    EXPECT_LE(frame.exposure_start, bench_->clock().now());
    last = frame;
  }
}

TEST_P(CameraConformance, FrameIsNotWrittenToAfterItWasHandedOut) {
  const Frame first = next();
  const cv::Mat copy = first.image.clone();
  for (int i = 0; i < 10; ++i) next();
  EXPECT_EQ(cv::norm(first.image, copy, cv::NORM_INF), 0.0);
}

TEST_P(CameraConformance, FrameOutlivesTheCamera) {
  const Frame frame = next();
  const cv::Mat copy = frame.image.clone();
  bench_->destroy_camera();
  EXPECT_EQ(cv::norm(frame.image, copy, cv::NORM_INF), 0.0);
}

TEST_P(CameraConformance, FrameExposedAfterAMomentComesSoon) {
  next();
  const TimePoint settled = bench_->clock().now();
  int looked_at = 1;
  while (next().exposure_start < settled) ++looked_at;
  // Readout, exposure and what the camera holds: some intervals each at most, and the frame itself.
  EXPECT_LE(looked_at, 10);
}

TEST_P(CameraConformance, NewestFrameWinsAndTheOthersAreCounted) {
  const Frame before = next();
  const CameraStatistics counts = camera().statistics();
  bench_->idle(20 * interval());
  const TimePoint asked = bench_->clock().now();
  const Frame after = next();
  // As old as a fresh frame may be, with the bound that the test above allows.
  EXPECT_GE(after.exposure_start, asked - 10 * interval() * bench_->patience());
  EXPECT_GE(after.sequence, before.sequence + 10);
  const CameraStatistics now = camera().statistics();
  EXPECT_EQ(now.frames_taken, counts.frames_taken + 1);
  EXPECT_EQ(now.frames_dropped + now.frames_damaged - counts.frames_dropped - counts.frames_damaged,
            after.sequence - before.sequence - 1);
}

TEST_P(CameraConformance, StopBeforeTheCallEndsIt) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(camera().next_frame(in(std::chrono::seconds(5)), stop.get_token()), Interrupted);
  EXPECT_NO_THROW(next());
}

TEST_P(CameraConformance, DeadlinePassesWhenNothingComes) {
  next();
  if (!bench_->stall(true)) GTEST_SKIP() << "this bench cannot stall";
  bench_->idle(2 * interval() * bench_->patience());
  // A frame taken just before the stall may still be there.
  const TimePoint deadline = in(std::chrono::milliseconds(300));
  bool timed_out = false;
  for (int i = 0; i < 8 && !timed_out; ++i) {
    try {
      camera().next_frame(deadline, {});
    } catch (const DeviceTimeout& timeout) {
      timed_out = true;
      EXPECT_FALSE(timeout.device().empty());
    }
  }
  EXPECT_TRUE(timed_out);
  EXPECT_GE(bench_->clock().now(), deadline);
  bench_->stall(false);
  EXPECT_NO_THROW(next());
}

TEST_P(CameraConformance, StopFromAnotherThreadEndsAWait) {
  next();
  if (!bench_->stall(true)) GTEST_SKIP() << "this bench cannot stall";
  std::stop_source stop;
  std::thread other([&] {
    bench_->clock().sleep_for(std::chrono::milliseconds(50));
    stop.request_stop();
  });
  const TimePoint begin = bench_->clock().now();
  EXPECT_THROW(
      {
        for (;;) camera().next_frame(in(std::chrono::seconds(1)), stop.get_token());
      },
      Interrupted);
  other.join();
  EXPECT_LT(bench_->clock().now() - begin, bench_->patience() * std::chrono::milliseconds(900));
  bench_->stall(false);
  EXPECT_NO_THROW(next());
}

TEST_P(CameraConformance, DamagedFramesAreCountedAndNeverHandedOut) {
  next();
  const std::uint64_t before = camera().statistics().frames_damaged;
  if (!bench_->damage_next_frame()) GTEST_SKIP() << "this bench cannot damage frames";
  for (int i = 0; i < 8; ++i) EXPECT_NO_THROW(next());
  EXPECT_EQ(camera().statistics().frames_damaged, before + 1);
}

TEST_P(CameraConformance, LossIsSaidOnceAndTheCameraComesBackAsItWas) {
  const Frame before = next();
  const CameraInfo info = camera().info();
  if (!bench_->unplug()) GTEST_SKIP() << "this bench cannot unplug";
  bool lost = false;
  for (int i = 0; i < 16 && !lost; ++i) {  // frames taken before the loss may still be handed out
    try {
      camera().next_frame(in(std::chrono::seconds(3)), {});
    } catch (const DeviceLost&) {
      lost = true;
    }
  }
  ASSERT_TRUE(lost);
  EXPECT_EQ(camera().statistics().times_lost, 1U);
  // Away is away, however often one asks, and it is one loss.
  for (int i = 0; i < 3; ++i) {
    EXPECT_THROW(camera().next_frame(in(std::chrono::milliseconds(30)), {}), DeviceLost);
  }
  EXPECT_EQ(camera().statistics().times_lost, 1U);

  bench_->plug_in();
  const TimePoint returned = bench_->clock().now();
  Frame after;
  while (after.image.empty() &&
         bench_->clock().now() < returned + std::chrono::seconds(2) * bench_->patience()) {
    try {
      after = camera().next_frame(in(std::chrono::milliseconds(500)), {});
    } catch (const DeviceLost&) {
      continue;
    }
  }
  ASSERT_FALSE(after.image.empty()) << "not recovered within 2 s";
  EXPECT_GT(after.sequence, before.sequence);
  EXPECT_GE(after.exposure_start, before.exposure_start);
  EXPECT_EQ(camera().info().width, info.width);
  EXPECT_EQ(camera().info().height, info.height);
  EXPECT_EQ(camera().info().format, info.format);
  EXPECT_EQ(camera().statistics().times_lost, 1U);
}

TEST_P(CameraConformance, StopEndsTheWaitForALostCamera) {
  next();
  if (!bench_->unplug()) GTEST_SKIP() << "this bench cannot unplug";
  std::stop_source stop;
  std::thread other([&] {
    bench_->clock().sleep_for(std::chrono::milliseconds(50));
    stop.request_stop();
  });
  EXPECT_THROW(
      {
        for (;;) {
          try {
            camera().next_frame(in(std::chrono::seconds(1)), stop.get_token());
          } catch (const DeviceLost&) {
            continue;
          }
        }
      },
      Interrupted);
  other.join();
}

TEST_P(CameraConformance, StatisticsMayBeReadWhileFramesAreFetched) {
  std::atomic<bool> done = false;
  std::uint64_t most = 0;
  std::thread reader([&] {
    while (!done) most = std::max(most, camera().statistics().frames_taken);
  });
  for (int i = 0; i < 5; ++i) next();
  done = true;
  reader.join();
  EXPECT_LE(most, 5U);
  EXPECT_EQ(camera().statistics().frames_taken, 5U);
}

}  // namespace eigenpose::test
