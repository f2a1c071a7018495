#include "sim/camera/sim_camera.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/error.h"

namespace eigenpose::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

SimCameraOptions small_camera() {
  SimCameraOptions options;
  options.width = 160;
  options.height = 120;
  options.frames_per_second = 25.0;
  return options;
}

struct LabCamera : testing::Test {
  ManualClock clock{TimePoint(seconds(100))};
  SimLab lab{clock, {.seed = 5}};
  SimCamera camera{lab, small_camera()};

  Frame frame() { return camera.next_frame(clock.now(), {}); }
  Frame frame_after(Duration time) {
    clock.advance(time);
    return frame();
  }
};

TEST_F(LabCamera, GivesTheNewestFrameAndCountsWhatWasDropped) {
  const TimePoint opened = clock.now();
  const Frame first = frame_after(milliseconds(205));
  EXPECT_EQ(first.sequence,
            4U);  // frames start at 0, 40, 80, 120, 160 and 200 ms; the last one is still exposed
  EXPECT_EQ(first.exposure_start, opened + milliseconds(160));
  EXPECT_EQ(camera.statistics().frames_taken, 1U);
  EXPECT_EQ(camera.statistics().frames_dropped, 4U);
  EXPECT_THROW(frame(), DeviceTimeout);  // handed out once
  EXPECT_EQ(frame_after(milliseconds(5)).sequence, 5U);
}

TEST_F(LabCamera, AFrameShowsTheLabOfItsOwnExposure) {
  clock.advance(milliseconds(195));
  lab.place("mug");  // between the exposures at 160…170 ms and 200…210 ms
  const Frame before = frame();
  const Frame after = frame_after(milliseconds(20));
  EXPECT_LT(cv::mean(before.image)[2], 20.0);
  EXPECT_GT(cv::mean(after.image)[2], cv::mean(before.image)[2] + 8.0);
}

TEST_F(LabCamera, MotionDuringTheExposureBlurs) {
  lab.place("car");
  // Light adds up, values do not: back to light, nearly.
  const auto light_of = [](const cv::Mat& values) {
    cv::Mat light;
    values.reshape(1).convertTo(light, CV_32F, 1.0 / 255.0);
    cv::pow(light, 2.2, light);
    return light;
  };
  const auto still_at = [&](double angle_deg) {
    lab.set_axis_position(LabAxis::table, degrees(angle_deg));
    return light_of(frame_after(milliseconds(80)).image);
  };
  const cv::Mat middle = still_at(0.0);
  const cv::Mat mean = (still_at(-8.0) + still_at(8.0)) / 2.0;
  // During the 10 ms of the next frame it turns from −16° to +16°.
  const TimePoint start = TimePoint(seconds(100)) + milliseconds(280);
  ASSERT_LT(clock.now(), start);
  lab.set_axis_motion(
      LabAxis::table,
      Trajectory::standstill(-16.0, start - milliseconds(1)).run(1, {3200.0, 1e9, 1e9}, start));
  const cv::Mat blurred = light_of(frame_after(start + milliseconds(10) - clock.now()).image);
  const cv::Mat car = mean > 0.03;  // elsewhere is noise
  EXPECT_LT(cv::norm(blurred, mean, cv::NORM_L1, car), 0.7 * cv::norm(blurred, middle, cv::NORM_L1, car));
}

TEST_F(LabCamera, AStillSceneChangesInNoiseOnly) {
  lab.place("duck");
  const cv::Mat a = frame_after(milliseconds(50)).image.clone();
  const cv::Mat b = frame_after(milliseconds(50)).image.clone();
  EXPECT_GT(cv::norm(a, b, cv::NORM_INF), 0.0);
  EXPECT_LT(cv::norm(a, b, cv::NORM_L1) / (3.0 * static_cast<double>(a.total())), 4.0);
}

TEST_F(LabCamera, TheSameSeedGivesTheSameFrames) {
  lab.place("duck");
  SimLab other(clock, {.seed = 5});
  SimLab third(clock, {.seed = 6});
  other.place("duck");
  third.place("duck");
  SimCamera same(other, small_camera());
  SimCamera different(third, small_camera());
  clock.advance(milliseconds(90));
  const Frame a = frame();
  const Frame b = same.next_frame(clock.now(), {});
  const Frame c = different.next_frame(clock.now(), {});
  EXPECT_EQ(cv::norm(a.image, b.image, cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(a.image, c.image, cv::NORM_INF), 0.0);
}

TEST_F(LabCamera, StallsAndGoesOnWithoutTheFramesOfThatTime) {
  lab.set_camera_faults({.stalled = true});
  clock.advance(seconds(1));
  EXPECT_THROW(frame(), DeviceTimeout);
  lab.set_camera_faults({});
  EXPECT_THROW(frame(), DeviceTimeout);
  const Frame later = frame_after(milliseconds(40));
  EXPECT_EQ(later.exposure_start, TimePoint(seconds(101)));
}

TEST_F(LabCamera, IsLostOnceAndComesBack) {
  frame_after(milliseconds(50));
  lab.set_camera_faults({.lost = true});
  EXPECT_THROW(frame_after(milliseconds(50)), DeviceLost);
  EXPECT_THROW(frame_after(milliseconds(50)), DeviceLost);
  EXPECT_EQ(camera.statistics().times_lost, 1U);
  lab.set_camera_faults({});
  EXPECT_THROW(frame_after(milliseconds(50)),
               DeviceTimeout);  // what it would have taken meanwhile it never took
  EXPECT_EQ(frame_after(milliseconds(15)).exposure_start, TimePoint(seconds(100)) + milliseconds(200));
  EXPECT_EQ(camera.statistics().times_lost, 1U);
}

TEST_F(LabCamera, DamagedFramesAreCountedAndNeverHandedOut) {
  lab.set_camera_faults({.damaged_fraction = 1.0});
  clock.advance(milliseconds(200));
  EXPECT_THROW(frame(), DeviceTimeout);
  EXPECT_EQ(camera.statistics().frames_damaged, 5U);
  lab.set_camera_faults({.damaged_fraction = 0.5});
  for (int i = 0; i < 200; ++i) {
    clock.advance(milliseconds(40));
    try {
      frame();
    } catch (const DeviceTimeout&) {
      continue;
    }
  }
  // Half of 200, four standard deviations.
  EXPECT_NEAR(static_cast<double>(camera.statistics().frames_damaged), 105.0, 28.0);
}

TEST_F(LabCamera, AWaitEndsOnRequest) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(camera.next_frame(TimePoint::max(), stop.get_token()), Interrupted);
}

TEST(Sensor, NoiseIsThatOfPhotonsAndReading) {
  const Sensor sensor({.blur_sigma = 0.0, .vignetting = 0.0});
  for (const double level : {0.01, 0.1, 0.4, 0.8}) {
    const cv::Mat light(200, 200, CV_32FC3, cv::Scalar::all(level));
    const cv::Mat electrons = sensor.expose(light, 1.0);
    const cv::Mat values = sensor.read(electrons, 3);
    cv::Mat back(values.size(), CV_64FC3);
    for (int y = 0; y < values.rows; ++y) {
      for (int x = 0; x < values.cols; ++x) {
        for (int c = 0; c < 3; ++c)
          back.at<cv::Vec3d>(y, x)[c] = sensor.electrons_of(values.at<cv::Vec3b>(y, x)[c]);
      }
    }
    cv::Scalar mean;
    cv::Scalar deviation;
    cv::meanStdDev(back.reshape(1), mean, deviation);
    const double signal = level * sensor.options().full_well;
    // Numbers of 8 bits are coarse: a step is as large as this many electrons, and rounding spreads over it
    // evenly.
    const double value = std::round(255.0 * (1.055 * std::pow(level, 1.0 / 2.4) - 0.055));
    const double step = sensor.electrons_of(value + 0.5) - sensor.electrons_of(value - 0.5);
    const double expected = std::sqrt(signal + std::pow(sensor.options().read_noise, 2) + step * step / 12.0);
    EXPECT_NEAR(mean[0], signal, 0.01 * signal + 3.0) << level;
    EXPECT_NEAR(deviation[0], expected, 0.12 * expected) << level;
  }
}

TEST(Sensor, SaturatesAndDarkensTowardsTheCorners) {
  const Sensor sensor({.blur_sigma = 0.0, .vignetting = 0.1});
  const cv::Mat electrons = sensor.expose(cv::Mat(101, 101, CV_32FC3, cv::Scalar::all(0.5)), 1.0);
  EXPECT_NEAR(electrons.at<cv::Vec3w>(0, 0)[0], 0.9 * 6000, 2);
  EXPECT_NEAR(electrons.at<cv::Vec3w>(50, 50)[0], 6000, 2);
  const cv::Mat bright = sensor.expose(cv::Mat(8, 8, CV_32FC3, cv::Scalar::all(5.0)), 1.0);
  EXPECT_EQ(bright.at<cv::Vec3w>(4, 4)[1], 12000);
}

}  // namespace
}  // namespace eigenpose::sim
