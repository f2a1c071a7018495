#include "daemon/service/service.h"

#include <fstream>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/input_file.h"
#include "core/model/model_file.h"
#include "tests/daemon/event_keeper.h"
#include "tests/daemon/fakes.h"
#include "tests/support/learned_world.h"

namespace eigenpose::service_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const Dof table{"table", "deg", 0.0, 360.0, true};
constexpr milliseconds settle{2};

/// The fault and the words with which a call is refused; none when it is not.
template <typename Call>
std::optional<Failure> refusal(Call call) {
  try {
    call();
  } catch (...) {
    return failure_of(std::current_exception());
  }
  return std::nullopt;
}

class ServiceTest : public ::testing::Test {
 protected:
  ServiceTest() {
    const std::vector<Dof> dofs = {table};
    options_.plans = {make_plan({"default", {{"table", {}, Spacing{0, 360, 4}}}}, dofs)};
    options_.image_sets = folder_.path() / "sets";
    options_.model_file = folder_.path() / "model.h5";
    options_.watch.enabled = false;
    options_.learning = testing::small_learning();
    options_.learning.solver.components = 3;
    options_.learning.object_spaces = false;
  }
  Service& service() {
    if (!service_) {
      RigAxisOptions axis;
      axis.dof = table;
      axis.settle = settle;
      ServiceDevices devices;
      devices.axes = {{axis, [this] { return std::make_unique<FakeAxis>(table, axis_, clock_); }}};
      devices.camera = [this] { return std::make_unique<FakeCamera>(axis_, settle, clock_); };
      service_ = std::make_unique<Service>(options_, std::move(devices), events_, heartbeat_, clock_);
    }
    return *service_;
  }
  JobStatus ended(const JobStatus& job) {
    eventually([&] { return service_->jobs().find(job.id)->state != JobState::running; });
    return *service_->jobs().find(job.id);
  }
  void write_set(const std::string& object, int kind, bool color = true) {
    testing::SceneKnobs knobs;
    knobs.color = color;
    testing::write_turn(options_.image_sets, object, kind, 12, knobs);
  }
  /// Why learning is refused, or fails: what is kept of the sets may be a few seconds old.
  Failure failure_of_learning(const LearnRequest& request) {
    std::optional<Failure> failure;
    const auto refused = refusal([&] { failure = ended(service().learn(request)).failure; });
    return refused.value_or(failure.value_or(Failure{Fault::internal, "learned", ""}));
  }
  /// A complete set of views that all show the object at the picture's border.
  void write_cut_off(const std::string& object) {
    testing::SceneKnobs knobs;
    knobs.x = 0.0;
    testing::write_turn(options_.image_sets, object, 2, 12, knobs);
  }
  void copy_set(const std::string& from, const std::string& to) {
    std::filesystem::copy(options_.image_sets / from, options_.image_sets / to,
                          std::filesystem::copy_options::recursive);
  }
  /// An unfinished set of one view.
  void write_unfinished(const std::string& object, const Workspace& workspace) {
    ImageSetWriter writer(options_.image_sets, object, workspace, nlohmann::json::object());
    writer.add(cv::Mat(48, 64, CV_8UC1, cv::Scalar(1)), {0.0});
  }

  test::TemporaryFolder folder_;
  SteadyClock clock_;
  Heartbeat heartbeat_{clock_};
  EventKeeper events_;
  FakeAxisRecord axis_;
  ServiceOptions options_;
  std::unique_ptr<Service> service_;
};

TEST_F(ServiceTest, AcquiresByTheConfiguredPlanOrByOneInTheRequest) {
  const JobStatus first = ended(service().acquire("mug", "default"));
  ASSERT_EQ(first.state, JobState::done) << first.failure.value_or(Failure{}).what;
  EXPECT_EQ(std::get<AcquisitionResult>(first.result).views, 4U);
  const JobStatus second = ended(service().acquire("duck", PlanRequest{"mine", {{"table", {10, 20}, {}}}}));
  ASSERT_EQ(second.state, JobState::done) << second.failure.value_or(Failure{}).what;
  const std::vector<ObjectStatus> objects = service().objects();
  ASSERT_EQ(objects.size(), 2U) << "a set is listed as soon as its job is done";
  EXPECT_EQ(objects[0].name, "duck");
  EXPECT_EQ(objects[0].acquired->views, 2U);
  EXPECT_TRUE(objects[0].acquired->complete);
  EXPECT_FALSE(objects[0].learned_as);
}

TEST_F(ServiceTest, WhatCannotBeAcquiredIsRefusedBeforeAJobIsMade) {
  write_set("done", 1);
  write_unfinished("other", Workspace({{"arm", "deg", 0.0, 360.0, true}}));
  const std::string escape = "evil\nlevel=error";
  EXPECT_EQ(refusal([&] { service().acquire("../etc", "default"); })->fault, Fault::invalid_request);
  EXPECT_EQ(refusal([&] { service().acquire(escape, "default"); })->fault, Fault::invalid_request);
  EXPECT_EQ(refusal([&] { service().acquire("", "default"); })->fault, Fault::invalid_request);
  EXPECT_EQ(refusal([&] { service().acquire("mug", "nonsense"); })->fault, Fault::not_found);
  EXPECT_THAT(refusal([&] { service().acquire("mug", "nonsense"); })->hint, HasSubstr("default"));
  EXPECT_EQ(refusal([&] {
              service().acquire("mug", PlanRequest{"p", {{"table", {400}, {}}}});
            })->fault,
            Fault::invalid_request);
  EXPECT_THAT(refusal([&] {
                service().acquire("mug", PlanRequest{"p", {{"slide", {4}, {}}}});
              })->what,
              HasSubstr("allowed: table"));
  const auto complete = refusal([&] { service().acquire("done", "default"); });
  EXPECT_EQ(complete->fault, Fault::conflict);
  EXPECT_THAT(complete->what, HasSubstr("\"done\" is complete already"));
  EXPECT_THAT(refusal([&] { service().acquire("other", "default"); })->what, HasSubstr("other axes"));
  EXPECT_TRUE(service().jobs().list().empty());
  EXPECT_FALSE(std::filesystem::exists(options_.image_sets / "mug"));
}

TEST_F(ServiceTest, AnUnfinishedSetOfTheSamePlanIsContinued) {
  const std::vector<Dof> dofs = {table};
  write_unfinished("mug", plan_workspace(options_.plans[0], dofs));
  const JobStatus job = ended(service().acquire("mug", "default"));
  ASSERT_EQ(job.state, JobState::done) << job.failure.value_or(Failure{}).what;
  EXPECT_EQ(std::get<AcquisitionResult>(job.result).kept, 1U);
}

TEST_F(ServiceTest, OneAcquisitionAtATimeAndItsStartIsSinceWhen) {
  set(axis_, &FakeAxisRecord::blocks, true);
  EXPECT_EQ(service().activity().state, ServiceState::idle);
  const JobStatus job = service().acquire("mug", "default");
  EXPECT_EQ(refusal([&] { service().acquire("duck", "default"); })->fault, Fault::busy);
  EXPECT_EQ(refusal([&] { service().acquire("mug", "default"); })->fault, Fault::busy);
  const ServiceActivity activity = service().activity();
  EXPECT_EQ(activity.state, ServiceState::acquiring);
  EXPECT_EQ(activity.since, job.started);
  EXPECT_NE(activity.since, service().started());
  service().jobs().cancel(job.id);
  EXPECT_EQ(ended(job).state, JobState::cancelled);
}

TEST_F(ServiceTest, StoppingMotionStopsTheAxisAndCancelsTheAcquisition) {
  set(axis_, &FakeAxisRecord::blocks, true);
  const JobStatus job = service().acquire("mug", "default");
  {
    std::unique_lock lock(axis_.mutex);
    axis_.changed.wait(lock, [&] { return axis_.moving; });
  }
  service().stop_motion();
  EXPECT_EQ(ended(job).state, JobState::cancelled);
  const std::lock_guard lock(axis_.mutex);
  EXPECT_GE(axis_.stops, 1);
  EXPECT_EQ(axis_.moves.size(), 1U);
}

TEST_F(ServiceTest, WhatAnAcquisitionLeavesStandsAmongTheObjectsAsSoonAsItEnds) {
  const auto acquired = [&](const std::string& name) {
    for (const ObjectStatus& object : service().objects())
      if (object.name == name) return object.acquired;
    return std::optional<ObjectStatus::Acquired>();
  };
  EXPECT_EQ(ended(service().acquire("duck", "default")).state, JobState::done);
  ASSERT_TRUE(acquired("duck").has_value());
  EXPECT_EQ(acquired("duck")->views, 4U);
  EXPECT_TRUE(acquired("duck")->complete);
  {
    const std::lock_guard lock(axis_.mutex);
    axis_.lost_from_move = static_cast<int>(axis_.moves.size()) + 2;
  }
  EXPECT_EQ(ended(service().acquire("mug", "default")).state, JobState::failed);
  ASSERT_TRUE(acquired("mug").has_value());
  EXPECT_EQ(acquired("mug")->views, 2U);
  EXPECT_FALSE(acquired("mug")->complete);
}

TEST_F(ServiceTest, LearnsTheCompleteSetsAndNamesThoseItLeavesOut) {
  write_set("one", 1);
  write_set("two", 2);
  write_unfinished("half", turntable_workspace());
  std::filesystem::create_directories(options_.image_sets / "broken");
  std::ofstream(options_.image_sets / "broken" / "set.json") << "{";
  const JobStatus job = ended(service().learn({}));
  ASSERT_EQ(job.state, JobState::done) << job.failure.value_or(Failure{}).what;
  const auto& result = std::get<LearningResult>(job.result);
  EXPECT_EQ(result.objects, 2U);
  EXPECT_EQ(result.views, 24U);
  EXPECT_EQ(result.components, 3U);
  EXPECT_EQ(result.file, options_.model_file);
  EXPECT_THAT(result.left_out, ElementsAre("broken", "half"));
  ASSERT_TRUE(service().models().current());
  EXPECT_EQ(load_model(options_.model_file).objects.size(), 2U);
  const std::vector<ObjectStatus> objects = service().objects();
  ASSERT_EQ(objects.size(), 4U);
  EXPECT_THAT(objects[0].error.value_or(""), HasSubstr("set.json"));
  EXPECT_FALSE(objects[1].acquired->complete);
  EXPECT_EQ(objects[2].learned_as, 0U);
  EXPECT_EQ(objects[3].learned_as, 1U);
}

TEST_F(ServiceTest, AnObjectOfWhichNoViewCanBeUsedStandsInTheResultWithTheReason) {
  write_set("one", 1);
  write_cut_off("mug");
  const JobStatus job = ended(service().learn({}));
  ASSERT_EQ(job.state, JobState::done) << job.failure.value_or(Failure{}).what;
  const auto& result = std::get<LearningResult>(job.result);
  EXPECT_EQ(result.objects, 1U);
  EXPECT_THAT(result.left_out, ElementsAre("mug"));
  ASSERT_EQ(result.left_out_details.size(), 1U);
  EXPECT_EQ(result.left_out_details[0].object, "mug");
  EXPECT_TRUE(result.left_out_details[0].whole_object);
  EXPECT_EQ(result.left_out_details[0].views, 12U);
  EXPECT_THAT(result.left_out_details[0].reason, HasSubstr("cut off by the border"));
}

TEST_F(ServiceTest, AnObjectThatIsNamedAndCannotBeLearnedFailsTheJobAndKeepsTheFormerModel) {
  write_set("one", 1);
  ASSERT_EQ(ended(service().learn({})).state, JobState::done);
  const auto former = service().models().current();
  const auto bytes = read_file(options_.model_file);
  write_cut_off("mug");
  for (const std::vector<std::string>& wanted : {std::vector<std::string>{"one", "mug"}, {"mug"}}) {
    const JobStatus job = ended(service().learn({std::nullopt, wanted}));
    ASSERT_EQ(job.state, JobState::failed) << wanted.size();
    EXPECT_EQ(job.failure->fault, Fault::conflict);
    EXPECT_THAT(job.failure->what, HasSubstr("\"mug\""));
    EXPECT_THAT(job.failure->what, HasSubstr("cut off by the border"));
  }
  EXPECT_EQ(service().models().current(), former);
  EXPECT_EQ(read_file(options_.model_file), bytes);
}

TEST_F(ServiceTest, AFormerlyLearnedObjectWhoseViewsCannotBeUsedIsNotLost) {
  write_set("one", 1);
  write_set("mug", 2);
  ASSERT_EQ(ended(service().learn({})).state, JobState::done);
  const auto former = service().models().current();
  for (int i = 0; i < 12; ++i)
    std::filesystem::resize_file(options_.image_sets / "mug" / fmt::format("{:06}.png", i), 100);
  const JobStatus job = ended(service().learn({}));
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.failure->fault, Fault::conflict);
  EXPECT_THAT(job.failure->what, HasSubstr("\"mug\""));
  EXPECT_EQ(service().models().current(), former);
  EXPECT_EQ(ended(service().learn({std::nullopt, {"one"}})).state, JobState::done)
      << "what is left out by name may go";
  EXPECT_EQ(service().models().current()->objects.size(), 1U);
}

TEST_F(ServiceTest, AFormerlyLearnedObjectWhoseSetCannotBeReadIsNotLost) {
  write_set("one", 1);
  write_set("mug", 2);
  ASSERT_EQ(ended(service().learn({})).state, JobState::done);
  std::ofstream(options_.image_sets / "mug" / "set.json") << "{";
  const Failure refused = failure_of_learning({});
  EXPECT_EQ(refused.fault, Fault::conflict);
  EXPECT_THAT(refused.what, HasSubstr("would lose \"mug\""));
  std::filesystem::remove_all(options_.image_sets / "mug");
  const JobStatus job = ended(service().learn({}));
  ASSERT_EQ(job.state, JobState::done) << "whoever removes the set means it";
  EXPECT_THAT(std::get<LearningResult>(job.result).left_out, ElementsAre("mug"));
  EXPECT_THAT(std::get<LearningResult>(job.result).left_out_details[0].reason, HasSubstr("no image set"));
}

TEST_F(ServiceTest, SingleViewsThatCannotBeUsedAreCountedInTheResult) {
  write_set("one", 1);
  for (const char* name : {"000000.png", "000005.png"})
    std::filesystem::resize_file(options_.image_sets / "one" / name, 100);
  const JobStatus job = ended(service().learn({std::nullopt, {"one"}}));
  ASSERT_EQ(job.state, JobState::done) << job.failure.value_or(Failure{}).what;
  const auto& result = std::get<LearningResult>(job.result);
  EXPECT_EQ(result.views, 10U);
  EXPECT_TRUE(result.left_out.empty()) << "the object itself is in the model";
  ASSERT_EQ(result.left_out_details.size(), 1U);
  EXPECT_FALSE(result.left_out_details[0].whole_object);
  EXPECT_EQ(result.left_out_details[0].views, 2U);
  EXPECT_THAT(result.left_out_details[0].reason, HasSubstr("000000.png"));
}

TEST_F(ServiceTest, ViewsAndOptionsThatDoNotSuitEachOtherAreAConflictAndNoDefect) {
  write_cut_off("mug");
  const JobStatus job = ended(service().learn({}));
  ASSERT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.failure->fault, Fault::conflict) << job.failure->what;
}

TEST_F(ServiceTest, TwoSetsOfOneObjectAreLeftOutByNameAndNeitherIsShown) {
  write_set("one", 1);
  write_set("mug", 2);
  copy_set("mug", "mug2");
  const JobStatus job = ended(service().learn({}));
  ASSERT_EQ(job.state, JobState::done) << job.failure.value_or(Failure{}).what;
  EXPECT_EQ(std::get<LearningResult>(job.result).objects, 1U);
  EXPECT_THAT(std::get<LearningResult>(job.result).left_out, ElementsAre("mug"));
  EXPECT_THAT(std::get<LearningResult>(job.result).left_out_details.at(0).reason, HasSubstr("mug, mug2"));
  const std::vector<ObjectStatus> objects = service().objects();
  ASSERT_EQ(objects.size(), 2U);
  EXPECT_EQ(objects[0].name, "mug");
  EXPECT_FALSE(objects[0].acquired);
  EXPECT_THAT(objects[0].error.value_or(""), HasSubstr("mug, mug2"));
  EXPECT_FALSE(objects[1].error);
}

TEST_F(ServiceTest, TwoSetsOfAnObjectThatIsNamedOrLearnedAreAConflict) {
  write_set("one", 1);
  write_set("mug", 2);
  ASSERT_EQ(ended(service().learn({std::nullopt, {"one"}})).state, JobState::done);
  copy_set("mug", "mug2");
  const Failure named = failure_of_learning({std::nullopt, {"one", "mug"}});
  EXPECT_EQ(named.fault, Fault::conflict);
  EXPECT_THAT(named.what, HasSubstr("mug, mug2"));
  copy_set("one", "another");
  const Failure learned = failure_of_learning({});
  EXPECT_EQ(learned.fault, Fault::conflict);
  EXPECT_THAT(learned.what, HasSubstr("would lose \"one\""));
}

TEST_F(ServiceTest, AnObjectThatAnotherFolderHoldsIsNotAcquiredASecondTime) {
  write_set("mug", 2);
  std::filesystem::rename(options_.image_sets / "mug", options_.image_sets / "old");
  const auto refused = refusal([&] { service().acquire("mug", "default"); });
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->fault, Fault::conflict);
  EXPECT_THAT(refused->what, HasSubstr("\"old\""));
}

TEST_F(ServiceTest, WhatCannotBeLearnedIsRefusedBeforeAJobIsMade) {
  EXPECT_EQ(refusal([&] { service().learn({}); })->fault, Fault::conflict);
  EXPECT_THAT(refusal([&] { service().learn({}); })->hint, HasSubstr("acquire an object first"));
  write_set("one", 1);
  write_unfinished("half", turntable_workspace());
  EXPECT_EQ(refusal([&] { service().learn({std::nullopt, {"nobody"}}); })->fault, Fault::not_found);
  EXPECT_THAT(refusal([&] {
                service().learn({std::nullopt, {"one", "half"}});
              })->what,
              HasSubstr("\"half\" is incomplete"));
  EXPECT_EQ(refusal([&] { service().learn({0, {}}); })->fault, Fault::invalid_request);
  EXPECT_EQ(refusal([&] { service().learn({1025, {}}); })->fault, Fault::invalid_request);
  EXPECT_TRUE(service().jobs().list().empty());
}

TEST_F(ServiceTest, LearnsTheNamedObjectsWithTheGivenComponents) {
  write_set("one", 1);
  write_set("two", 2);
  const JobStatus job = ended(service().learn({2, {"two"}}));
  ASSERT_EQ(job.state, JobState::done) << job.failure.value_or(Failure{}).what;
  EXPECT_EQ(std::get<LearningResult>(job.result).components, 2U);
  ASSERT_EQ(service().models().current()->objects.size(), 1U);
  EXPECT_EQ(service().models().current()->objects[0].name, "two");
}

TEST_F(ServiceTest, GreyViewsAreLearnedGreyWhateverTheDefaultSays) {
  options_.learning.normalization.color = true;
  write_set("one", 1, false);
  write_set("two", 2, false);
  const JobStatus job = ended(service().learn({}));
  ASSERT_EQ(job.state, JobState::done) << job.failure.value_or(Failure{}).what;
  EXPECT_FALSE(service().models().current()->normalization.color);
}

TEST_F(ServiceTest, ColourViewsAreLearnedInColour) {
  write_set("one", 1);
  ASSERT_EQ(ended(service().learn({})).state, JobState::done);
  EXPECT_TRUE(service().models().current()->normalization.color);
}

TEST_F(ServiceTest, AModelThatCannotBeSavedIsNotUsed) {
  write_set("one", 1);
  options_.model_file = folder_.path() / "no such folder" / "model.h5";
  const JobStatus job = ended(service().learn({}));
  EXPECT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.failure->fault, Fault::file);
  EXPECT_EQ(service().models().current(), nullptr);
}

TEST(ModelStoreTest, KeepsTheFormerModelInUseWhenTheNewOneCannotBeSaved) {
  test::TemporaryFolder folder;
  std::filesystem::create_directory(folder.path() / "in");
  ModelStore store(folder.path() / "in" / "model.h5");
  const auto former = testing::learned_world().model;
  store.replace(former);
  std::filesystem::remove_all(folder.path() / "in");
  EXPECT_THROW(store.replace(std::make_shared<const Model>(*former)), FileError);
  EXPECT_EQ(store.current(), former);
}

TEST(ModelStoreTest, ADamagedModelIsReportedAndLeftWhereItIs) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "model.h5";
  std::ofstream(file) << "not a model";
  ModelStore store(file);
  store.load();
  EXPECT_EQ(store.current(), nullptr);
  EXPECT_THAT(store.error().value_or(""), HasSubstr(file.string()));
  EXPECT_EQ(std::filesystem::file_size(file), 11U);
}

TEST(ModelStoreTest, TheTroubleWithAFormerFileEndsWithANewModel) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "model.h5";
  std::ofstream(file) << "not a model";
  ModelStore store(file);
  store.load();
  ASSERT_TRUE(store.error().has_value());
  store.replace(testing::learned_world().model);
  EXPECT_EQ(store.error(), std::nullopt);
  ModelStore next(file);
  next.load();
  EXPECT_EQ(next.error(), std::nullopt);
  EXPECT_NE(next.current(), nullptr);
}

/// A service of a camera alone, whose frames the test gives.
class ServiceCameraTest : public ::testing::Test {
 protected:
  ServiceCameraTest() { start(); }
  void start() {
    ServiceOptions options;
    options.image_sets = folder_.path() / "sets";
    options.model_file = folder_.path() / "model.h5";
    options.stale_frame = seconds(10);
    ServiceDevices devices;
    devices.camera = [this] { return std::make_unique<ScriptedCamera>(script_); };
    service_ = std::make_unique<Service>(options, std::move(devices), events_, heartbeat_, clock_);
  }

  test::TemporaryFolder folder_;
  ManualClock clock_{TimePoint(seconds(100))};
  Heartbeat heartbeat_{clock_};
  EventKeeper events_;
  CameraScript script_;
  std::unique_ptr<Service> service_;
};

TEST_F(ServiceCameraTest, TheNewestFrameComesWithItsAgeAndAnOldOneIsAnError) {
  EXPECT_EQ(refusal([&] { (void)service_->newest_frame(); })->fault, Fault::unavailable);
  script_.frame(cv::Mat(4, 4, CV_8UC1, cv::Scalar(7)), clock_.now());
  script_.wait_until_used_up();
  clock_.advance(seconds(10));
  const NewestFrame newest = service_->newest_frame();
  EXPECT_EQ(newest.frame.sequence, 1U);
  EXPECT_EQ(newest.age, seconds(10));
  clock_.advance(milliseconds(1));
  const auto stale = refusal([&] { (void)service_->newest_frame(); });
  EXPECT_EQ(stale->fault, Fault::unavailable);
  EXPECT_THAT(stale->what, HasSubstr("10 s old"));
}

TEST_F(ServiceCameraTest, AResultIsNotCurrentWhileTheCameraIsLost) {
  service_.reset();
  save_model(*testing::learned_world().model, folder_.path() / "model.h5");
  start();
  const cv::Mat scene = testing::scene_with(1, 30.0);
  const auto show = [&] {
    for (int i = 0; i < 10; ++i) {
      clock_.advance(milliseconds(50));
      const std::uint64_t looked_at = service_->watcher().status().frames;
      script_.frame(scene, clock_.now());
      eventually([&] { return service_->watcher().status().frames > looked_at; });
    }
  };
  show();
  const auto results = events_.first<SceneResult>(1);
  const std::uint64_t frame = results.back().frame.sequence;
  eventually([&] { return service_->watcher().status().current_result.has_value(); });
  EXPECT_TRUE(service_->is_current(frame));
  EXPECT_FALSE(service_->is_current(frame + 1));
  script_.failure("unplugged");
  eventually([&] { return service_->camera().status().error.has_value(); });
  EXPECT_FALSE(service_->is_current(frame));
}

TEST_F(ServiceCameraTest, ThatTheCameraWasFoundAndLostAreEvents) {
  script_.frame(cv::Mat(4, 4, CV_8UC1, cv::Scalar(7)), clock_.now());
  events_.first<CameraFound>(1);
  EXPECT_TRUE(events_.all<CameraLost>().empty());
  script_.failure("unplugged");
  EXPECT_THAT(events_.first<CameraLost>(1)[0].error, HasSubstr("unplugged"));
}

}  // namespace
}  // namespace eigenpose::service_test
