#include "daemon/rig/frame_hub.h"

#include <future>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/daemon/fakes.h"

namespace eigenpose::frame_hub_test {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;

const cv::Mat picture(4, 4, CV_8UC1, cv::Scalar(7));

class FrameHubTest : public testing::Test {
 protected:
  std::unique_ptr<FrameHub> hub() {
    return std::make_unique<FrameHub>([this] { return std::make_unique<ScriptedCamera>(script_); }, clock_,
                                      heartbeat_,
                                      [this](const std::optional<std::string>& error) {
                                        const std::lock_guard lock(mutex_);
                                        changes_.push_back(error.value_or("found"));
                                      });
  }
  std::vector<std::string> changes() {
    const std::lock_guard lock(mutex_);
    return changes_;
  }

  ManualClock clock_{TimePoint(seconds(100))};
  Heartbeat heartbeat_{clock_};
  CameraScript script_;
  std::mutex mutex_;
  std::vector<std::string> changes_;  ///< guarded by mutex_
};

TEST_F(FrameHubTest, KeepsTheNewestFrameWithItsNumberAndAge) {
  const auto hub = this->hub();
  script_.frame(picture, clock_.now());
  script_.frame(picture, clock_.now() + seconds(1));
  script_.wait_until_used_up();
  clock_.advance(seconds(4));
  EXPECT_EQ(hub->latest()->sequence, 2U);
  const CameraStatus status = hub->status();
  EXPECT_EQ(status.frame_sequence, 2U);
  EXPECT_EQ(status.frame_age, seconds(3));
  EXPECT_EQ(status.info->name, "scripted");
}

TEST_F(FrameHubTest, SaysThatTheCameraWasFoundAndLostOnceEach) {
  const auto hub = this->hub();
  script_.frame(picture, clock_.now());
  script_.frame(picture, clock_.now());
  script_.failure("unplugged");
  script_.failure("unplugged");
  script_.frame(picture, clock_.now());
  eventually([&] {
    clock_.advance(seconds(1));  // it is tried again a second after each failure
    return script_.taken() == 5 && !hub->status().error;
  });
  EXPECT_THAT(changes(), ElementsAre("found", HasSubstr("unplugged"), "found"));
}

TEST_F(FrameHubTest, ACameraThatNeverComesIsReportedLostOnce) {
  FrameHub hub([]() -> std::unique_ptr<Camera> { throw DeviceLost("camera", "open", "not there"); }, clock_,
               heartbeat_,
               [this](const std::optional<std::string>& error) {
                 const std::lock_guard lock(mutex_);
                 changes_.push_back(error.value_or("found"));
               });
  eventually([&] { return !changes().empty(); });
  EXPECT_THAT(changes(), ElementsAre(HasSubstr("not there")));
  EXPECT_THAT(hub.status().error.value_or(""), HasSubstr("not there"));
  EXPECT_FALSE(hub.status().frame_age);
}

TEST_F(FrameHubTest, NextGivesEachFrameOnceAndTheNewestFirst) {
  const auto hub = this->hub();
  std::uint64_t cursor = 0;
  script_.frame(picture, clock_.now());
  script_.frame(picture, clock_.now());
  script_.wait_until_used_up();
  EXPECT_EQ(hub->next(cursor, {})->sequence, 2U);
  script_.frame(picture, clock_.now());
  EXPECT_EQ(hub->next(cursor, {})->sequence, 3U);
  EXPECT_FALSE(hub->next(cursor, {})) << "no new frame: it comes back after a second with nothing";
}

TEST_F(FrameHubTest, ExposedAfterTakesNoFrameThatIsOlder) {
  const auto hub = this->hub();
  script_.frame(picture, clock_.now() - seconds(1));
  script_.wait_until_used_up();
  auto frame = std::async(std::launch::async, [&] {
    return hub->exposed_after(clock_.now(), clock_.now() + seconds(10), {}).sequence;
  });
  script_.frame(picture, clock_.now() - std::chrono::milliseconds(1));
  script_.frame(picture, clock_.now());
  EXPECT_EQ(frame.get(), 3U);
}

TEST_F(FrameHubTest, ExposedAfterEndsAtItsDeadlineEvenIfTheCameraHangs) {
  const auto hub = this->hub();
  const TimePoint now = clock_.now();
  auto frame =
      std::async(std::launch::async, [&] { return hub->exposed_after(now, now + seconds(10), {}).sequence; });
  script_.wait_until_used_up();
  clock_.advance(seconds(11));
  EXPECT_THROW(frame.get(), DeviceTimeout);
}

TEST_F(FrameHubTest, ExposedAfterEndsInTheCamerasOwnErrorOnceTheDeadlineHasPassed) {
  const auto hub = this->hub();
  script_.failure("unplugged");
  eventually([&] { return hub->status().error.has_value(); });
  EXPECT_THROW((void)hub->exposed_after(clock_.now(), clock_.now(), {}), DeviceLost);
}

TEST_F(FrameHubTest, OnDemandTheCameraLooksOnlyForAFrameThatIsWanted) {
  const auto hub = this->hub();
  script_.wait_until_used_up();
  const FrameHub::OnDemand on_demand(*hub);
  for (int i = 0; i < 10; ++i) script_.frame(picture, clock_.now());
  // The frame under way when it began, and one each time that a newer one was wanted.
  EXPECT_EQ(hub->exposed_after(clock_.now(), clock_.now() + seconds(10), {}).sequence, 1U);
  clock_.advance(seconds(1));
  const TimePoint wanted = clock_.now();
  auto frame = std::async(std::launch::async,
                          [&] { return hub->exposed_after(wanted, wanted + seconds(10), {}).sequence; });
  script_.frame(picture, wanted);
  EXPECT_EQ(frame.get(), 11U) << "it looks as long as its frames are too old";
  for (int i = 0; i < 10; ++i) script_.frame(picture, wanted);
  EXPECT_EQ(hub->exposed_after(wanted, wanted + seconds(10), {}).sequence, 11U);
  EXPECT_EQ(script_.taken(), 11) << "and no longer";
}

TEST_F(FrameHubTest, ACameraThatHangsIsOverdueAndOneThatLooksIsNot) {
  const auto hub = this->hub();
  script_.wait_until_used_up();  // it hangs in next_frame, whose own deadline is far shorter
  EXPECT_TRUE(heartbeat_.overdue().empty());
  clock_.advance(seconds(71));
  EXPECT_THAT(heartbeat_.overdue(), ElementsAre("camera"));
  script_.frame(picture, clock_.now());
  script_.wait_until_used_up();
  EXPECT_TRUE(heartbeat_.overdue().empty());
}

}  // namespace
}  // namespace eigenpose::frame_hub_test
