#include "daemon/service/watcher.h"

#include <future>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/event_keeper.h"
#include "tests/daemon/fakes.h"
#include "tests/support/learned_world.h"
#include "tests/support/parts_world.h"

namespace eigenpose::watcher_test {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using State = SceneResult::State;

/// A sink that holds up whoever publishes, until it is let go.
class HoldingSink final : public EventSink {
 public:
  void publish(const Event&) noexcept override {
    entered_.set_value();
    leave_.get_future().wait();
  }
  void wait_until_entered() { entered_.get_future().wait(); }
  void let_go() { leave_.set_value(); }

 private:
  std::promise<void> entered_, leave_;
};

class WatcherTest : public ::testing::Test {
 protected:
  WatcherTest() { options_.scene.settle = milliseconds(100); }

  void use_model() { models_.replace(testing::learned_world().model); }
  std::unique_ptr<Watcher> watcher(EventSink& events) {
    return std::make_unique<Watcher>(options_, camera_, models_, events, heartbeat_);
  }
  /// Gives the camera one frame and waits until it was looked at, or only taken while `unwatched`.
  void step(const Watcher& watcher, const cv::Mat& picture) {
    const std::uint64_t looked_at = watcher.status().frames;
    exposure_ += milliseconds(50);
    script_.frame(picture, exposure_);
    if (unwatched_)
      script_.wait_until_used_up();
    else
      eventually([&] { return watcher.status().frames > looked_at; });
  }
  /// Shows a picture for half a second, in ten frames.
  void show(const Watcher& watcher, const cv::Mat& picture) {
    for (int i = 0; i < 10; ++i) step(watcher, picture);
  }

  static cv::Mat object(int kind, double angle_deg) { return testing::scene_with(kind, angle_deg); }
  static cv::Mat empty() { return testing::empty_scene({}, 3); }

  test::TemporaryFolder folder_;
  ManualClock clock_;
  Heartbeat heartbeat_{clock_};
  CameraScript script_;
  TimePoint exposure_{std::chrono::seconds(100)};
  FrameHub camera_{[this] { return std::make_unique<ScriptedCamera>(script_); }, clock_, heartbeat_};
  ModelStore models_{folder_.path() / "model.h5"};
  WatcherOptions options_;
  EventKeeper events_;
  bool unwatched_ = false;
};

TEST_F(WatcherTest, PublishesWhatStandsThereOnceItHasSettledAndOnlyOnce) {
  use_model();
  const auto watcher = this->watcher(events_);
  show(*watcher, object(1, 30.0));
  const std::vector<SceneResult> seen = events_.all<SceneResult>();
  ASSERT_EQ(seen.size(), 1U) << "ten still frames are one scene";
  EXPECT_EQ(seen[0].state, State::settled);
  ASSERT_EQ(seen[0].outcomes.size(), 1U);
  EXPECT_EQ(seen[0].outcomes[0].best->object, "one");
  EXPECT_NEAR(seen[0].outcomes[0].best->q[0], 30.0, 4.0);
  EXPECT_EQ(seen[0].model, testing::learned_world().model);
  EXPECT_GT(seen[0].frame.sequence, 0U);
  EXPECT_GT(seen[0].frame.exposure_start, TimePoint(std::chrono::seconds(100)));
  EXPECT_TRUE(seen[0].times);
  EXPECT_THAT(log_text(seen[0]), HasSubstr("verdict=recognized object=one"));
  EXPECT_EQ(watcher->status().recognitions, 1U);
}

TEST_F(WatcherTest, PublishesOnceThatTheSceneChangesAndThenWhatItHasBecome) {
  use_model();
  const auto watcher = this->watcher(events_);
  show(*watcher, object(1, 30.0));
  for (int i = 0; i < 4; ++i) step(*watcher, object(2, 40.0 * i));
  show(*watcher, object(2, 120.0));
  const std::vector<SceneResult> seen = events_.all<SceneResult>();
  ASSERT_EQ(seen.size(), 3U);
  EXPECT_EQ(seen[1].state, State::changing);
  EXPECT_TRUE(seen[1].outcomes.empty());
  EXPECT_FALSE(seen[1].model);
  EXPECT_EQ(seen[2].state, State::settled);
  EXPECT_EQ(seen[2].outcomes.at(0).best->object, "two");
}

TEST_F(WatcherTest, AnEmptyTableIsAResultWithoutOutcomes) {
  use_model();
  const auto watcher = this->watcher(events_);
  show(*watcher, empty());
  ASSERT_EQ(events_.all<SceneResult>().size(), 1U);
  EXPECT_TRUE(events_.all<SceneResult>()[0].outcomes.empty());
}

TEST_F(WatcherTest, WithoutAModelNothingIsPublishedAndANewOneLooksAtTheStandingScene) {
  const auto watcher = this->watcher(events_);
  show(*watcher, object(1, 30.0));
  EXPECT_TRUE(events_.all<SceneResult>().empty());
  use_model();
  show(*watcher, object(1, 30.0));
  ASSERT_EQ(events_.all<SceneResult>().size(), 1U);
  models_.replace(std::make_shared<const Model>(*testing::learned_world().model));
  show(*watcher, object(1, 30.0));
  EXPECT_EQ(events_.all<SceneResult>().size(), 2U) << "nothing moved, but another model looks";
  EXPECT_EQ(events_.all<SceneResult>()[1].model, models_.current());
}

TEST_F(WatcherTest, NothingIsPublishedWhilePausedAndTheSceneIsLookedAtAnewAfterwards) {
  use_model();
  const auto watcher = this->watcher(events_);
  show(*watcher, object(1, 30.0));
  {
    const Watcher::Pause pause(*watcher);
    const Watcher::Pause second(*watcher);
    unwatched_ = true;
    show(*watcher, object(2, 120.0));
  }
  unwatched_ = false;
  EXPECT_EQ(events_.all<SceneResult>().size(), 1U);
  show(*watcher, object(2, 120.0));
  const std::vector<SceneResult> seen = events_.all<SceneResult>();
  ASSERT_EQ(seen.size(), 2U);
  EXPECT_EQ(seen[1].outcomes.at(0).best->object, "two");
}

TEST_F(WatcherTest, APauseWaitsForTheLookInProgress) {
  use_model();
  HoldingSink sink;
  const auto watcher = this->watcher(sink);
  step(*watcher, empty());
  step(*watcher, empty());
  unwatched_ = true;  // the look at one of the next frames is held up
  step(*watcher, empty());
  step(*watcher, empty());
  sink.wait_until_entered();
  auto paused = std::async(std::launch::async, [&] { const Watcher::Pause pause(*watcher); });
  EXPECT_EQ(paused.wait_for(milliseconds(50)), std::future_status::timeout);
  sink.let_go();
  paused.get();
}

TEST_F(WatcherTest, AFailureOfRecognitionIsReportedOnceAndWatchingGoesOn) {
  use_model();  // of colour: it cannot take grey pictures
  const auto watcher = this->watcher(events_);
  cv::Mat grey;
  cv::extractChannel(object(1, 30.0), grey, 0);
  show(*watcher, grey);
  EXPECT_TRUE(watcher->status().error);
  EXPECT_EQ(watcher->status().recognitions, 0U);
  EXPECT_TRUE(events_.all<SceneResult>().empty());
  show(*watcher, object(1, 30.0));
  EXPECT_EQ(events_.all<SceneResult>().back().outcomes.at(0).best->object, "one");
  EXPECT_FALSE(watcher->status().error) << "it recognises again";
}

TEST_F(WatcherTest, ACameraThatFailsInBetweenDoesNotEndTheWatching) {
  use_model();
  const auto watcher = this->watcher(events_);
  show(*watcher, empty());
  script_.failure("unplugged");
  eventually([&] { return camera_.status().error.has_value(); });
  exposure_ += milliseconds(50);
  script_.frame(object(1, 30.0), exposure_);
  eventually([&] {
    clock_.advance(std::chrono::seconds(1));
    return !camera_.status().error;
  });
  show(*watcher, object(1, 30.0));
  EXPECT_EQ(events_.all<SceneResult>().back().outcomes.at(0).best->object, "one");
}

TEST_F(WatcherTest, TheLastResultIsCurrentFromItsPublicationOn) {
  use_model();
  const auto watcher = this->watcher(events_);
  EXPECT_FALSE(watcher->status().current_result) << "nothing was published yet";
  show(*watcher, object(1, 30.0));
  EXPECT_EQ(watcher->status().current_result, events_.all<SceneResult>().back().frame.sequence);
  for (int i = 0; i < 4; ++i) step(*watcher, object(2, 40.0 * i));
  ASSERT_EQ(events_.all<SceneResult>().back().state, State::changing);
  EXPECT_EQ(watcher->status().current_result, events_.all<SceneResult>().back().frame.sequence);
  show(*watcher, object(2, 120.0));
  ASSERT_EQ(events_.all<SceneResult>().size(), 3U);
  EXPECT_EQ(watcher->status().current_result, events_.all<SceneResult>().back().frame.sequence);
}

TEST_F(WatcherTest, NoResultIsCurrentWhilePausedNorUntilTheNextOne) {
  use_model();
  const auto watcher = this->watcher(events_);
  show(*watcher, object(1, 30.0));
  ASSERT_TRUE(watcher->status().current_result);
  {
    const Watcher::Pause pause(*watcher);
    EXPECT_TRUE(watcher->status().paused);
    EXPECT_FALSE(watcher->status().current_result);
    { const Watcher::Pause second(*watcher); }
    EXPECT_TRUE(watcher->status().paused) << "one pause is left";
  }
  EXPECT_FALSE(watcher->status().paused);
  EXPECT_FALSE(watcher->status().current_result) << "nobody has looked since";
  show(*watcher, object(1, 30.0));
  EXPECT_EQ(watcher->status().current_result, events_.all<SceneResult>().back().frame.sequence);
}

TEST_F(WatcherTest, AResultIsNotCurrentOnceWhatStandsThereCouldNotBeRecognised) {
  use_model();
  const auto watcher = this->watcher(events_);
  show(*watcher, object(1, 30.0));
  const std::uint64_t before = watcher->status().current_result.value();
  cv::Mat grey;
  cv::extractChannel(object(2, 30.0), grey, 0);
  show(*watcher, grey);
  ASSERT_TRUE(watcher->status().error);
  EXPECT_FALSE(watcher->status().current_result);
  show(*watcher, object(1, 30.0));
  EXPECT_GT(watcher->status().current_result.value_or(0), before);
}

TEST_F(WatcherTest, AFrameThatCannotBeLookedAtMakesTheSceneUnknownUntilItHasSettledAgain) {
  use_model();
  const auto watcher = this->watcher(events_);
  show(*watcher, object(1, 30.0));
  ASSERT_EQ(events_.all<SceneResult>().size(), 1U);
  exposure_ += milliseconds(50);
  script_.frame(cv::Mat(), exposure_);
  eventually([&] { return watcher->status().error.has_value(); });
  EXPECT_FALSE(watcher->status().current_result);
  show(*watcher, object(1, 30.0));
  ASSERT_EQ(events_.all<SceneResult>().size(), 2U) << "the same scene, looked at anew";
  EXPECT_TRUE(watcher->status().current_result);
}

TEST_F(WatcherTest, AFrameFullOfClutterIsLookedAtForALimitedTime) {
  testing::PartsWorld world;
  models_.replace(world.model);
  testing::SceneKnobs beside = testing::PartsWorld::knobs();
  cv::Mat touching;
  Segmenter segmenter(world.model->normalization.segmentation);
  for (beside.x += 160.0; touching.empty() || segmenter.segment(touching).size() > 1; beside.x -= 2.0) {
    touching = testing::scene_with(1, 55.0, testing::PartsWorld::knobs());
    testing::draw_object(touching, 2, 120.0, beside);
  }
  options_.region_time = std::chrono::hours(1);
  options_.frame_time = Duration::zero();
  const auto watcher = this->watcher(events_);
  show(*watcher, touching);
  const auto seen = events_.all<SceneResult>();
  ASSERT_EQ(seen.size(), 1U);
  ASSERT_EQ(seen[0].outcomes.size(), 1U) << "they touch";
  EXPECT_TRUE(seen[0].outcomes[0].unfinished);
}

TEST_F(WatcherTest, ThatIsTurnedOffLooksAtNothing) {
  use_model();
  options_.enabled = false;
  const auto watcher = this->watcher(events_);
  unwatched_ = true;
  show(*watcher, object(1, 30.0));
  EXPECT_EQ(watcher->status().frames, 0U);
  EXPECT_TRUE(events_.all<SceneResult>().empty());
}

}  // namespace
}  // namespace eigenpose::watcher_test
