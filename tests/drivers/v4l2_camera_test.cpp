// V4l2Camera over the imitated kernel, in time that only the test moves.
#include "drivers/v4l2/v4l2_camera.h"

#include <gmock/gmock.h>
#include <linux/videodev2.h>

#include "core/base/error.h"
#include "tests/drivers/fake_video_system.h"

namespace eigenpose::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class V4l2CameraTest : public testing::Test {
 protected:
  V4l2CameraTest() { options_.mode.color = false; }

  V4l2Camera& open(FakeCamera fake = usual_camera()) {
    system_ = std::make_unique<FakeVideoSystem>(std::move(fake), clock_);
    options_.log = [this](const std::string& line) { log_ += line + "\n"; };
    camera_ = std::make_unique<V4l2Camera>(options_, *system_, clock_);
    return *camera_;
  }
  Frame next(Duration patience = 5s) { return camera_->next_frame(clock_.now() + patience, {}); }
  /// Calls until a frame comes; losses are passed over.
  Frame next_after_loss() {
    for (int i = 0; i < 100; ++i) {
      try {
        return next();
      } catch (const DeviceLost&) {
        continue;
      }
    }
    throw std::runtime_error("no frame after 100 calls");
  }

  ManualClock clock_{TimePoint(1h)};
  V4l2CameraOptions options_;
  std::unique_ptr<FakeVideoSystem> system_;
  std::unique_ptr<V4l2Camera> camera_;
  std::string log_;
};

constexpr Duration interval = 33333333ns;  // of the usual camera: 30 frames per second

TEST_F(V4l2CameraTest, SaysWhatWasAskedAndWhatWasGranted) {
  options_.mode.width = 800;
  open();
  EXPECT_EQ(camera_->info().width, 640);
  EXPECT_EQ(camera_->info().format, "YUYV");
  EXPECT_EQ(camera_->info().serial, "SERIAL1");
  EXPECT_DOUBLE_EQ(camera_->info().frames_per_second, 30.0);
  EXPECT_EQ(to_string(camera_->report().granted), "YUYV 640x480 at 30 fps");
  EXPECT_THAT(log_, HasSubstr("granted=\"YUYV 640x480 at 30 fps\""));
}

TEST_F(V4l2CameraTest, LocksEveryAutomaticAndRecordsTheValues) {
  options_.controls = {{"exposure_time_absolute", 100}, {"gain", 30}};
  open();
  EXPECT_EQ(system_->control_value(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(system_->control_value(V4L2_CID_AUTOGAIN), 0);
  EXPECT_EQ(system_->control_value(V4L2_CID_AUTO_WHITE_BALANCE), 0);
  EXPECT_EQ(system_->control_value(V4L2_CID_FOCUS_AUTO), 0);
  const auto& controls = camera_->info().controls;
  EXPECT_EQ(controls.at("exposure_time_absolute"), 100);
  EXPECT_EQ(controls.at("gain"), 30);
  EXPECT_EQ(controls.at("white_balance_temperature"), 4000);
  EXPECT_EQ(controls.at("auto_exposure"), V4L2_EXPOSURE_MANUAL);
}

TEST_F(V4l2CameraTest, RefusesAnUnknownControlByName) {
  options_.controls = {{"gian", 3}};
  try {
    open();
    FAIL() << "opened";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("gian"));
    EXPECT_THAT(error.what(), HasSubstr("no such control"));
  }
  EXPECT_EQ(system_->open_devices(), 0);
}

TEST_F(V4l2CameraTest, RefusesAControlOutOfRangeSayingTheRange) {
  options_.controls = {{"gain", 101}};
  try {
    open();
    FAIL() << "opened";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("0 to 100"));
  }
}

TEST_F(V4l2CameraTest, SetsEveryControlAgainAfterALoss) {
  options_.controls = {{"gain", 30}};
  open();
  next();
  system_->unplug();
  EXPECT_THROW(next(), DeviceLost);
  // What a camera does when it loses power: back to its presets.
  system_->set_control_value(V4L2_CID_AUTOGAIN, 1);
  system_->set_control_value(V4L2_CID_GAIN, 17);
  system_->set_control_value(V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY);
  system_->set_control_value(V4L2_CID_EXPOSURE_ABSOLUTE, 700);
  system_->plug_in();
  next_after_loss();
  EXPECT_EQ(system_->control_value(V4L2_CID_AUTOGAIN), 0);
  EXPECT_EQ(system_->control_value(V4L2_CID_GAIN), 30);
  EXPECT_EQ(system_->control_value(V4L2_CID_EXPOSURE_ABSOLUTE), 156);
  EXPECT_THAT(log_, HasSubstr("lost="));
  EXPECT_THAT(log_, HasSubstr("found=/dev/video0"));
}

TEST_F(V4l2CameraTest, FindsTheCameraBySerialAndSaysWhatElseIsThere) {
  options_.selector.serial = "OTHER";
  try {
    open();
    FAIL() << "opened";
  } catch (const DeviceLost& lost) {
    EXPECT_THAT(lost.what(), HasSubstr("serial 'OTHER'"));
    EXPECT_THAT(lost.what(), HasSubstr("SERIAL1"));
  }
  options_.selector.serial = "SERIAL1";
  EXPECT_NO_THROW(open());
}

TEST_F(V4l2CameraTest, FindsTheCameraUnderAnotherNodeAfterItsReturn) {
  options_.selector.bus_path = "usb-fake-1";
  FakeCamera fake = usual_camera();
  open(fake);
  next();
  EXPECT_EQ(camera_->report().node.path, "/dev/video0");
  system_->unplug();
  EXPECT_THROW(next(), DeviceLost);
  system_->rename_node("/dev/video4");
  system_->plug_in();
  next_after_loss();
  EXPECT_EQ(camera_->report().node.path, "/dev/video4");
}

TEST(FindCamera, OfTwoCamerasWantsToKnowWhich) {
  const std::vector<VideoNode> nodes{{"/dev/video0", "A", "uvcvideo", "usb-1", "1-1", "S1", true, 0},
                                     {"/dev/video1", "A", "uvcvideo", "usb-1", "1-1", "S1", false, 0},
                                     {"/dev/video2", "B", "uvcvideo", "usb-2", "1-2", "S2", true, 0}};
  EXPECT_THROW(find_camera(nodes, {}, "camera"), DeviceError);
  EXPECT_EQ(find_camera(nodes, {"S2", "", "", ""}, "camera").path, "/dev/video2");
  EXPECT_EQ(find_camera(nodes, {"", "1-1", "", ""}, "camera").path, "/dev/video0");
  EXPECT_EQ(find_camera(nodes, {"", "", "B", ""}, "camera").path, "/dev/video2");
}

TEST(FindCamera, MeansADeviceByEveryThingThatIsSaidOfIt) {
  const VideoNode node{"/dev/video0", "A", "uvcvideo", "usb-1", "1-1", "S1", true, 0};
  EXPECT_TRUE(is_meant(node, {}));
  EXPECT_TRUE(is_meant(node, {"S1", "usb-1", "A", "/dev/video0"}));
  EXPECT_TRUE(is_meant(node, {"S1", "1-1", "A", "/dev/video0"}));
  EXPECT_FALSE(is_meant(node, {"S2", "usb-1", "A", "/dev/video0"}));
  EXPECT_FALSE(is_meant(node, {"S1", "usb-2", "A", "/dev/video0"}));
  EXPECT_FALSE(is_meant(node, {"S1", "usb-1", "B", "/dev/video0"}));
  EXPECT_FALSE(is_meant(node, {"S1", "usb-1", "A", "/dev/video1"}));
  VideoNode forbidden = node;
  forbidden.open_error = EACCES;
  EXPECT_TRUE(is_meant(forbidden, {"S1", "usb-2", "", ""})) << "its bus is not known";
  EXPECT_FALSE(is_meant(forbidden, {"S2", "usb-2", "", ""}));
}

TEST(FindCamera, SaysWhichGroupIsMissing) {
  const std::vector<VideoNode> nodes{{"/dev/video0", "A", "", "", "1-1", "S1", false, EACCES}};
  try {
    find_camera(nodes, {"S1", "", "", ""}, "camera");
    FAIL();
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("group 'video'"));
  }
}

TEST_F(V4l2CameraTest, HandsOutTheNewestAndCountsTheOthers) {
  open();
  const Frame first = next();
  clock_.advance(2 * interval + 1ms);
  const Frame second = next();
  EXPECT_EQ(second.sequence, first.sequence + 2);
  EXPECT_EQ(camera_->statistics().frames_dropped, 1U);
  // The picture itself is the newest one: the imitation writes 16 + sequence as luma, which is spread to 0 …
  // 255.
  EXPECT_EQ(second.image.at<std::uint8_t>(0, 0), 2);
}

TEST_F(V4l2CameraTest, AfterALongPauseWaitsForAFreshFrameRatherThanHandOutAnOldOne) {
  open();
  next();
  clock_.advance(10s);
  const TimePoint asked = clock_.now();
  const Frame frame = next();
  EXPECT_LE(clock_.now() - asked, 2 * interval);
  EXPECT_GE(frame.exposure_start, asked - 3 * interval);
  EXPECT_EQ(camera_->statistics().frames_taken + camera_->statistics().frames_dropped, frame.sequence);
}

TEST_F(V4l2CameraTest, AfterALongPauseWithAPassedDeadlineGivesTheNewestThereIs) {
  open();
  next();
  clock_.advance(10s);
  EXPECT_NO_THROW(camera_->next_frame(clock_.now(), {}));
}

TEST_F(V4l2CameraTest, DatesNoFrameLaterThanItsFirstPhoton) {
  options_.controls = {{"exposure_time_absolute", 100}};  // 10 ms
  options_.internal_frames = 0;
  open();
  const Frame frame = next();
  // Stamped now, at the end of the frame: readout takes an interval at most, exposure 10 ms before it.
  EXPECT_EQ(frame.exposure_start,
            std::chrono::floor<std::chrono::microseconds>(clock_.now()) - interval - 10ms);
}

TEST_F(V4l2CameraTest, DatesFramesEarlierByWhatTheCameraMayHold) {
  options_.controls = {{"exposure_time_absolute", 100}};  // 10 ms
  options_.internal_frames = 2;
  open();
  const Frame frame = next();
  EXPECT_EQ(frame.exposure_start,
            std::chrono::floor<std::chrono::microseconds>(clock_.now()) - 3 * interval - 10ms);
}

TEST_F(V4l2CameraTest, DatesFramesByTheirBufferWhenStampsAreNonsense) {
  FakeCamera fake = usual_camera();
  fake.stamp = FakeStamp::nonsense;
  open(fake);
  Frame last = next();
  for (int i = 0; i < 20; ++i) {
    const Frame frame = next();
    EXPECT_LT(frame.exposure_start, clock_.now());
    // The frame itself, its readout, its exposure, and one that the camera may hold.
    EXPECT_GE(frame.exposure_start, clock_.now() - 4 * interval);
    EXPECT_GT(frame.exposure_start, last.exposure_start);
    last = frame;
  }
}

TEST_F(V4l2CameraTest, FollowsSequenceNumbersThroughTheirWrap) {
  FakeCamera fake = usual_camera();
  fake.first_sequence = 0xfffffffeU;
  open(fake);
  std::uint64_t last = next().sequence;
  for (int i = 0; i < 5; ++i) EXPECT_EQ(next().sequence, ++last);
  EXPECT_EQ(camera_->statistics().frames_dropped, 0U);
}

TEST_F(V4l2CameraTest, CountsOnWhenADriverNeverCounts) {
  FakeCamera fake = usual_camera();
  fake.sequence_step = 0;
  open(fake);
  std::uint64_t last = next().sequence;
  for (int i = 0; i < 5; ++i) EXPECT_EQ(next().sequence, ++last);
}

TEST_F(V4l2CameraTest, DoesNotBelieveALeapOrAStepBack) {
  open();
  const std::uint64_t first = next().sequence;
  system_->set_sequence(3'000'000'000U);
  EXPECT_EQ(next().sequence, first + 1);
  system_->set_sequence(5);
  EXPECT_EQ(next().sequence, first + 2);
  system_->set_sequence(5 + 46);  // a true gap: 45 frames went missing
  EXPECT_EQ(next().sequence, first + 2 + 46);
  EXPECT_EQ(camera_->statistics().frames_dropped, 45U);
}

TEST_F(V4l2CameraTest, PassesOverFramesCutShort) {
  open();
  system_->truncate(2);
  const Frame frame = next();
  EXPECT_EQ(frame.sequence, 3U);
  EXPECT_EQ(camera_->statistics().frames_damaged, 2U);
  EXPECT_EQ(camera_->statistics().damaged_by.at(static_cast<std::size_t>(FrameFault::too_short)), 2U);
}

TEST_F(V4l2CameraTest, SaysWhyNoFrameThatCameCouldBeUsed) {
  open();
  system_->truncate(1000);
  try {
    next(1s);
    FAIL() << "a frame came";
  } catch (const DeviceTimeout& late) {
    EXPECT_THAT(late.what(),
                testing::ContainsRegex("none that could be used came in time \\([0-9]+ too short\\)"));
  }
  const CameraStatistics counts = camera_->statistics();
  EXPECT_GT(counts.frames_damaged, 10U);
  std::uint64_t sum = 0;
  for (const std::uint64_t count : counts.damaged_by) sum += count;
  EXPECT_EQ(sum, counts.frames_damaged);
  system_->truncate(0);
  EXPECT_NO_THROW(next());
}

TEST_F(V4l2CameraTest, OffersABufferAgainThatTheDriverRefused) {
  open();
  next();
  for (int i = 0; i < 6; ++i) {  // more often than there are buffers
    system_->fail(VIDIOC_QBUF, EINVAL);
    EXPECT_NO_THROW(next());
    EXPECT_NO_THROW(next());
  }
  EXPECT_EQ(camera_->statistics().times_lost, 0U);
}

TEST_F(V4l2CameraTest, OpensABrokenStreamAnewWithinTheCall) {
  open();
  const std::uint64_t before = next().sequence;
  system_->break_stream();
  EXPECT_GT(next().sequence, before);
  EXPECT_EQ(camera_->statistics().times_lost, 0U);
  EXPECT_THAT(log_, HasSubstr("broken="));
  EXPECT_EQ(system_->open_devices(), 1);
}

TEST_F(V4l2CameraTest, ClosesAStalledCameraAndOpensItAnew) {
  open();
  next();
  system_->stall(true);
  EXPECT_THROW(next(1s), DeviceTimeout);
  try {
    next(5s);
    FAIL() << "a frame came";
  } catch (const DeviceLost& lost) {
    EXPECT_THAT(lost.what(), HasSubstr("stalled"));
  }
  EXPECT_EQ(system_->open_devices(), 0);
  EXPECT_EQ(system_->mapped_buffers(), 0);
  system_->stall(false);
  EXPECT_NO_THROW(next_after_loss());
  EXPECT_EQ(camera_->statistics().times_lost, 1U);
}

TEST_F(V4l2CameraTest, ACameraIsNotStalledWhileFramesComeHoweverLongItIsWaitedForInAll) {
  open();
  // Every frame comes after a wait; together they are far longer than a stall.
  const TimePoint start = clock_.now();
  while (clock_.now() - start < 10 * options_.stall_after) ASSERT_NO_THROW(next());
  EXPECT_EQ(camera_->statistics().times_lost, 0U);
  // Damaged frames are frames, too: the stream goes on.
  system_->truncate(1000);
  EXPECT_THROW(next(2 * options_.stall_after), DeviceTimeout);
  EXPECT_EQ(camera_->statistics().times_lost, 0U);
}

TEST_F(V4l2CameraTest, WaitsInsideTheCallForTheCamerasReturn) {
  open();
  next();
  system_->unplug();
  EXPECT_THROW(next(), DeviceLost);
  system_->at(clock_.now() + 3s, [this] { system_->plug_in(); });
  const TimePoint returned = clock_.now() + 3s;
  EXPECT_NO_THROW(next(10s));
  EXPECT_LE(clock_.now() - returned, 2s);
}

TEST_F(V4l2CameraTest, SurvivesEveryCallFailingAtOpening) {
  open();
  next();
  for (const unsigned long request :
       {VIDIOC_S_FMT, VIDIOC_REQBUFS, VIDIOC_QUERYBUF, VIDIOC_QBUF, VIDIOC_STREAMON}) {
    system_->unplug();
    EXPECT_THROW(next(), DeviceLost);
    system_->plug_in();
    system_->fail(request, EINVAL);
    EXPECT_NO_THROW(next_after_loss());
    EXPECT_EQ(system_->open_devices(), 1);
  }
}

TEST_F(V4l2CameraTest, LeaksNothingOverAHundredUnpluggings) {
  open();
  next();
  const int buffers = system_->mapped_buffers();
  for (int cycle = 1; cycle <= 100; ++cycle) {
    system_->unplug();
    EXPECT_THROW(next(), DeviceLost);
    EXPECT_EQ(system_->open_devices(), 0);
    EXPECT_EQ(system_->mapped_buffers(), 0);
    system_->plug_in();
    const TimePoint returned = clock_.now();
    next_after_loss();
    EXPECT_LE(clock_.now() - returned, 2s);
    EXPECT_EQ(system_->mapped_buffers(), buffers);
    EXPECT_EQ(camera_->statistics().times_lost, static_cast<std::uint64_t>(cycle));
  }
}

TEST_F(V4l2CameraTest, AnotherCameraOnTheSamePathIsNotTakenForTheOldOne) {
  options_.selector.bus_path = "usb-fake-1";
  open();
  next();
  system_->unplug();
  EXPECT_THROW(next(), DeviceLost);
  system_->replace_modes({{V4L2_PIX_FMT_YUYV, 320, 240, {30}}});
  system_->plug_in();
  try {
    next(1s);
    FAIL() << "a frame of another size came";
  } catch (const DeviceLost& lost) {
    EXPECT_THAT(lost.what(), HasSubstr("another camera"));
  }
}

TEST_F(V4l2CameraTest, AGreyCameraIsRefusedWhereColourIsAsked) {
  FakeCamera fake = usual_camera();
  fake.modes = {{V4L2_PIX_FMT_GREY, 640, 480, {30}}};
  options_.mode.color = true;
  EXPECT_THROW(open(fake), DeviceError);
  options_.mode.color = false;
  open(fake);
  EXPECT_EQ(next().image.type(), CV_8UC1);
}

}  // namespace
}  // namespace eigenpose::test
