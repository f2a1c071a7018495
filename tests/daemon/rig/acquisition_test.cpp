#include "daemon/rig/acquisition.h"

#include <cmath>
#include <fstream>
#include <future>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "tests/daemon/fakes.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose::acquisition_test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

const Dof table{"table", "deg", 0.0, 360.0, true};
const Dof arm{"arm", "deg", -90.0, 90.0, false};
constexpr std::chrono::milliseconds settle{5};

RigAxis fake(const Dof& dof, FakeAxisRecord& record, const Clock& clock) {
  RigAxisOptions options;
  options.dof = dof;
  options.settle = settle;
  return {options, [&record, dof, &clock] { return std::make_unique<FakeAxis>(dof, record, clock); }};
}

class AcquisitionTest : public testing::Test {
 protected:
  AcquisitionRequest request(const std::string& object, std::vector<PlanAxisRequest> axes) {
    const std::vector<Dof> dofs = {table, arm};
    const Plan plan = make_plan({"test", std::move(axes)}, dofs);
    return {object, plan, plan_workspace(plan, dofs), folder_.path()};
  }
  AcquisitionRequest turn(const std::string& object) {
    return request(object, {{"table", {}, Spacing{0, 360, 6}}});
  }
  AcquisitionReport run(const AcquisitionRequest& what, const std::stop_token& stop = {}) {
    AcquisitionReport report;
    report_ = {};
    try {
      acquire(what, {rig_, camera_, clock_}, report, {}, stop);
    } catch (...) {
      report_ = report;
      throw;
    }
    return report;
  }

  test::TemporaryFolder folder_;
  SteadyClock clock_;
  FakeAxisRecord table_record_;
  FakeAxisRecord arm_record_;
  Heartbeat heartbeat_{clock_};
  FakeLampRecord lamp_record_;
  Rig rig_{{fake(table, table_record_, clock_), fake(arm, arm_record_, clock_)},
           {fake_lamp("key", 0.8, lamp_record_)},
           clock_,
           heartbeat_};
  FrameHub camera_{[this] { return std::make_unique<FakeCamera>(table_record_, settle, clock_); }, clock_,
                   heartbeat_};
  AcquisitionReport report_;

  /// What a run says that takes its first picture again twice, keeps none of the three, and gives up.
  std::string error_after_retakes() {
    AcquisitionRequest request = turn("mug");
    request.most_retakes = 2;
    std::string error;
    try {
      run(request);
    } catch (const DeviceError& failure) {
      error = failure.what();
    }
    EXPECT_EQ(report_.retaken, 2U);
    EXPECT_EQ(report_.taken, 0U) << "no picture of a wrong pose, or that may be dark, is kept";
    return error;
  }
};

TEST_F(AcquisitionTest, VisitsEveryPoseAndKeepsWhatTheCameraSawThere) {
  const AcquisitionReport report = run(turn("mug"));
  EXPECT_EQ(report.taken, 6U);
  const ImageSet set = ImageSet::open(folder_.path() / "mug");
  ASSERT_EQ(set.views().size(), 6U);
  EXPECT_TRUE(set.complete());
  EXPECT_EQ(set.workspace()[0], table);
  for (std::size_t i = 0; i < set.views().size(); ++i) {
    EXPECT_EQ(set.views()[i].q, std::vector<double>{60.0 * static_cast<double>(i)});
    // 255 would be a frame exposed before the table had come to rest; another number one of another pose.
    EXPECT_EQ(set.load(i).at<unsigned char>(0, 0), 6 * i);
  }
}

TEST_F(AcquisitionTest, ReturnsEachAxisToWhereItStoodBefore) {
  set(table_record_, &FakeAxisRecord::position, 45.0);
  set(arm_record_, &FakeAxisRecord::position, 10.0);
  run(request("mug", {{"arm", {-30}, {}}, {"table", {0, 120}, {}}}));
  EXPECT_THAT(table_record_.moves, ElementsAre(0, 120, 45));
  EXPECT_THAT(arm_record_.moves, ElementsAre(-30, 10));
}

TEST_F(AcquisitionTest, ReturnsAnAxisThatWasNotHomedToTheFirstPose) {
  set(table_record_, &FakeAxisRecord::homed, false);
  set(table_record_, &FakeAxisRecord::position, 77.0);
  run(request("mug", {{"table", {60, 120}, {}}}));
  EXPECT_THAT(table_record_.moves, ElementsAre(60, 120, 60));
}

TEST_F(AcquisitionTest, AFailedReturnMoveLeavesTheSetCompleteAndIsReported) {
  set(table_record_, &FakeAxisRecord::lost_from_move, 6);
  const AcquisitionReport report = run(turn("mug"));
  EXPECT_EQ(report.taken, 6U);
  EXPECT_THAT(report.not_returned.value_or(""), HasSubstr("table: move: connection closed"));
  EXPECT_TRUE(ImageSet::open(folder_.path() / "mug").complete());
}

TEST_F(AcquisitionTest, AnAxisReadBackALittleBeyondItsEndReturnsToItsEnd) {
  for (const double beyond : {-90.005, 90.005}) {
    const double end = std::round(beyond);
    set(arm_record_, &FakeAxisRecord::position, beyond);
    set(arm_record_, &FakeAxisRecord::moves, std::vector<double>());
    const std::string object = "mug" + std::to_string(static_cast<int>(end));
    const AcquisitionReport report = run(request(object, {{"arm", {-30, 30}, {}}}));
    EXPECT_FALSE(report.not_returned) << *report.not_returned;
    EXPECT_THAT(arm_record_.moves, ElementsAre(-30, 30, end));
    EXPECT_TRUE(ImageSet::open(folder_.path() / object).complete());
    EXPECT_FALSE(rig_.status().axes[1].error);
  }
}

TEST_F(AcquisitionTest, AReturnThatFailsInAnyWayLeavesTheSetComplete) {
  set(arm_record_, &FakeAxisRecord::position, 10.0);
  set(arm_record_, &FakeAxisRecord::before_move, [](double target) {
    if (target == 10.0) throw std::length_error("no device's own words");
  });
  const AcquisitionReport report = run(request("mug", {{"arm", {-30, 30}, {}}}));
  EXPECT_EQ(report.not_returned, "no device's own words");
  EXPECT_TRUE(ImageSet::open(folder_.path() / "mug").complete());
}

TEST_F(AcquisitionTest, AnAxisThatDoesNotReturnKeepsNoOtherFromReturning) {
  set(arm_record_, &FakeAxisRecord::position, 10.0);
  set(table_record_, &FakeAxisRecord::position, 45.0);
  set(arm_record_, &FakeAxisRecord::lost_from_move, 1);
  AcquisitionReport report = run(request("mug", {{"arm", {-30}, {}}, {"table", {0, 120}, {}}}));
  EXPECT_EQ(report.not_returned, "arm: move: connection closed");
  EXPECT_THAT(table_record_.moves, ElementsAre(0, 120, 45));

  set(arm_record_, &FakeAxisRecord::lost_from_move, 3);
  set(table_record_, &FakeAxisRecord::lost_from_move, 5);
  report = run(request("duck", {{"arm", {-30}, {}}, {"table", {0, 120}, {}}}));
  EXPECT_EQ(report.not_returned, "arm: move: connection closed; table: move: connection closed");
}

TEST_F(AcquisitionTest, RecordsWhereEveryActuatorStoodAndThePoseReadBackOfEachView) {
  set(table_record_, &FakeAxisRecord::position, 45.0);
  set(table_record_, &FakeAxisRecord::on_frame, [](FakeAxisRecord& axis) {
    if (axis.moves.size() == 2) axis.position = 60.25;  // within the tolerance of 60
  });
  run(turn("mug"));
  std::ifstream index(folder_.path() / "mug" / "set.json");
  const nlohmann::json set = nlohmann::json::parse(index);
  const nlohmann::json& actuators = set.at("source").at("actuators");
  EXPECT_EQ(actuators.at("table_deg"), 45.0);
  EXPECT_EQ(actuators.at("arm_deg"), 0.0);
  EXPECT_EQ(actuators.at("key_level"), 0.8) << "it is lit before the record is made";
  std::ifstream journal(folder_.path() / "mug" / "views.jsonl");
  std::string line;
  std::getline(journal, line);
  std::getline(journal, line);
  const nlohmann::json second = nlohmann::json::parse(line);
  EXPECT_EQ(second.at("q"), nlohmann::json({60.0}));
  EXPECT_EQ(second.at("measured_q"), nlohmann::json({60.25}));
}

TEST_F(AcquisitionTest, AViewWhoseAxisMovedMeanwhileIsTakenAgain) {
  set(table_record_, &FakeAxisRecord::on_frame, [pushed = false](FakeAxisRecord& axis) mutable {
    if (axis.moves.size() != 3 || pushed) return;
    axis.position += 30.0;
    pushed = true;
  });
  const AcquisitionReport report = run(turn("mug"));
  EXPECT_EQ(report.retaken, 1U);
  EXPECT_EQ(report.taken, 6U);
  EXPECT_THAT(table_record_.moves, ElementsAre(0, 60, 120, 120, 180, 240, 300, 0));
  const ImageSet set = ImageSet::open(folder_.path() / "mug");
  ASSERT_EQ(set.views().size(), 6U);
  for (std::size_t i = 0; i < set.views().size(); ++i)
    EXPECT_EQ(set.load(i).at<unsigned char>(0, 0), 6 * i) << "view " << i;
}

TEST_F(AcquisitionTest, AViewWhoseAxisLostItsHomeOrStillMovedIsTakenAgain) {
  using Disturb = void (*)(FakeAxisRecord&);
  for (const Disturb disturb : {Disturb{[](FakeAxisRecord& axis) { axis.homed = false; }},
                                Disturb{[](FakeAxisRecord& axis) { axis.moving = true; }}}) {
    set(table_record_, &FakeAxisRecord::on_frame,
        [disturb, before = table_record_.moves.size(), done = false](FakeAxisRecord& axis) mutable {
          if (axis.moves.size() != before + 3 || done) return;
          disturb(axis);
          done = true;
        });
    const std::string object = "mug" + std::to_string(table_record_.moves.size());
    const AcquisitionReport report = run(turn(object));
    EXPECT_EQ(report.retaken, 1U);
    EXPECT_EQ(report.taken, 6U);
    const ImageSet views = ImageSet::open(folder_.path() / object);
    ASSERT_EQ(views.views().size(), 6U);
    for (std::size_t i = 0; i < views.views().size(); ++i)
      EXPECT_EQ(views.load(i).at<unsigned char>(0, 0), 6 * i) << "view " << i;
  }
  EXPECT_EQ(table_record_.homings, 1);
}

TEST_F(AcquisitionTest, AViewDuringWhichALampWasInterruptedIsTakenAgain) {
  int frames = 0;  // counted with the axis's lock held, at the third pose
  set(table_record_, &FakeAxisRecord::on_frame, [&](FakeAxisRecord& axis) {
    if (axis.moves.size() == 3 && ++frames == 1) ++lamp_record_.interruptions;
  });
  const AcquisitionReport report = run(turn("mug"));
  EXPECT_EQ(report.retaken, 1U);
  EXPECT_EQ(report.taken, 6U);
  EXPECT_EQ(frames, 2);
  EXPECT_THAT(table_record_.moves, ElementsAre(0, 60, 120, 180, 240, 300, 0)) << "no axis has moved";
}

TEST_F(AcquisitionTest, ALampInterruptedWhileAnAxisWasPushedDoesNotHideIt) {
  set(table_record_, &FakeAxisRecord::on_frame, [this, done = false](FakeAxisRecord& axis) mutable {
    if (axis.moves.size() != 3 || done) return;
    ++lamp_record_.interruptions;
    axis.position += 30.0;
    done = true;
  });
  EXPECT_EQ(run(turn("mug")).retaken, 1U);
  const ImageSet views = ImageSet::open(folder_.path() / "mug");
  ASSERT_EQ(views.views().size(), 6U);
  for (std::size_t i = 0; i < views.views().size(); ++i)
    EXPECT_EQ(views.load(i).at<unsigned char>(0, 0), 6 * i) << "view " << i;
}

TEST_F(AcquisitionTest, ALampThatIsInterruptedAgainAndAgainEndsTheRun) {
  set(table_record_, &FakeAxisRecord::on_frame, [this](FakeAxisRecord&) { ++lamp_record_.interruptions; });
  EXPECT_THAT(error_after_retakes(),
              AllOf(HasSubstr("key: hold its level: may have been dark during the picture"),
                    HasSubstr("3 times: check its power and cable")));
}

TEST_F(AcquisitionTest, AnAxisThatNeverStaysEndsTheRunAfterAFewTries) {
  set(table_record_, &FakeAxisRecord::on_frame, [](FakeAxisRecord& axis) { axis.position += 30.0; });
  EXPECT_THAT(error_after_retakes(),
              AllOf(HasSubstr("table: hold its position: stood at 30 after the picture, not at 0"),
                    HasSubstr("3 times")));
}

TEST_F(AcquisitionTest, AnAlarmAfterThePictureEndsTheRunWithTheAlarm) {
  set(table_record_, &FakeAxisRecord::on_frame, [](FakeAxisRecord& axis) { axis.alarm = "overload"; });
  try {
    run(turn("mug"));
    FAIL() << "succeeded";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("overload"));
  }
  EXPECT_EQ(report_.taken, 0U);
}

TEST_F(AcquisitionTest, WithoutLightNothingMovesAndNothingIsTaken) {
  lamp_record_.answers = false;
  EXPECT_THROW(run(turn("mug")), DeviceTimeout);
  EXPECT_TRUE(table_record_.moves.empty());
  EXPECT_EQ(report_.taken, 0U);
}

TEST_F(AcquisitionTest, ALampThatFailsDuringTheRunEndsItAndTheViewInTheDarkIsNotKept) {
  set(table_record_, &FakeAxisRecord::on_frame, [this](FakeAxisRecord& axis) {
    if (axis.moves.size() == 3) lamp_record_.answers = false;
  });
  try {
    run(turn("mug"));
    FAIL() << "succeeded";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("key: set level: no answer"));
  }
  EXPECT_EQ(report_.taken, 2U);
  EXPECT_EQ(ImageSet::open(folder_.path() / "mug").views().size(), 2U);
}

TEST_F(AcquisitionTest, TheCameraDoesNotRunFreeMeanwhile) {
  int frames = 0;  // counted with the axis's lock held
  set(table_record_, &FakeAxisRecord::on_frame,
      [&](FakeAxisRecord& axis) { frames += axis.moves.empty() || axis.moves.size() > 6 ? 0 : 1; });
  run(turn("mug"));
  set(table_record_, &FakeAxisRecord::on_frame, nullptr);
  // One a view, and one that may have been under way when the run began.
  EXPECT_LE(frames, 7);
}

TEST(MissingPoses, AreThoseThatNoViewShowsInThePlansOrder) {
  const std::vector<Dof> dofs = {arm, table};
  const Plan plan = make_plan({"p", {{"arm", {-30, 30}, {}}, {"table", {0, 120, 240}, {}}}}, dofs);
  const Workspace workspace = plan_workspace(plan, dofs);
  const std::vector<ViewRecord> views = {{"0", {-30, 0}}, {"1", {30, 240}}, {"2", {-30, 120}}, {"3", {5, 5}}};
  EXPECT_THAT(missing_poses(plan, workspace, views),
              ElementsAre(ElementsAre(-30, 240), ElementsAre(30, 0), ElementsAre(30, 120)));
}

TEST(MissingPoses, FindAViewAcrossTheSeamOfATurnAndWithinRounding) {
  const std::vector<Dof> dofs = {table};
  const Plan plan = make_plan({"p", {{"table", {0, 90, 180}, {}}}}, dofs);
  const Workspace workspace = plan_workspace(plan, dofs);
  const std::vector<ViewRecord> views = {{"0", {359.9999999}}, {"1", {90.0000001}}, {"2", {179.99}}};
  EXPECT_THAT(missing_poses(plan, workspace, views), ElementsAre(ElementsAre(180)));
}

TEST(MissingPoses, OfTheLargestPlanAreFoundWithoutComparingAllWithAll) {
  const std::vector<Dof> dofs = {arm, table};
  const Plan plan =
      make_plan({"p", {{"arm", {}, Spacing{-90, 90, 100}}, {"table", {}, Spacing{0, 360, 1000}}}}, dofs);
  const Workspace workspace = plan_workspace(plan, dofs);
  std::vector<ViewRecord> views;
  for (std::size_t i = 0; i + 1 < plan.size(); ++i) views.push_back({"f", plan.at(i)});
  // All with all would be 5e9 comparisons.
  EXPECT_THAT(missing_poses(plan, workspace, views), ElementsAre(plan.at(plan.size() - 1)));
}

TEST_F(AcquisitionTest, CoversTheGridOfTwoAxesAndMovesOnlyWhatChanges) {
  run(request("mug", {{"arm", {-30, 30}, {}}, {"table", {0, 120, 240}, {}}}));
  const ImageSet set = ImageSet::open(folder_.path() / "mug");
  ASSERT_EQ(set.views().size(), 6U);
  EXPECT_THAT(set.views()[4].q, ElementsAre(30, 120));
  EXPECT_THAT(arm_record_.moves, ElementsAre(-30, 30, 0));
  EXPECT_THAT(table_record_.moves, ElementsAre(0, 120, 240, 0, 120, 240, 0));
}

TEST_F(AcquisitionTest, HomesAnAxisThatHasLostItsZero) {
  set(table_record_, &FakeAxisRecord::homed, false);
  run(turn("mug"));
  EXPECT_EQ(table_record_.homings, 1);
}

TEST_F(AcquisitionTest, ALostAxisEndsInItsErrorWithMotionStoppedAndViewsKept) {
  set(table_record_, &FakeAxisRecord::lost_from_move, 3);
  try {
    run(turn("mug"));
    FAIL() << "succeeded";
  } catch (const DeviceLost& error) {
    EXPECT_THAT(error.what(), HasSubstr("table: move: connection closed"));
  }
  EXPECT_EQ(report_.taken, 3U);
  EXPECT_GE(table_record_.stops, 1);
  EXPECT_GE(arm_record_.stops, 1) << "every axis is stopped, not only the one that failed";
  const ImageSet set = ImageSet::open(folder_.path() / "mug");
  EXPECT_EQ(set.views().size(), 3U);
  EXPECT_FALSE(set.complete());
}

TEST_F(AcquisitionTest, ContinuesWhereItWasBrokenOff) {
  set(table_record_, &FakeAxisRecord::lost_from_move, 3);
  EXPECT_THROW(run(turn("mug")), DeviceLost);
  set(table_record_, &FakeAxisRecord::lost_from_move, -1);
  set(table_record_, &FakeAxisRecord::moves, std::vector<double>());
  const AcquisitionReport report = run(turn("mug"));
  EXPECT_EQ(report.kept, 3U);
  EXPECT_EQ(report.taken, 3U);
  EXPECT_THAT(table_record_.moves, ElementsAre(180, 240, 300, 120)) << "it stood at 120 when the run began";
  EXPECT_EQ(ImageSet::open(folder_.path() / "mug").views().size(), 6U);
}

/// A set that was broken off after three views, with the arm at −30.
class BrokenOff : public AcquisitionTest {
 protected:
  void SetUp() override {
    set(arm_record_, &FakeAxisRecord::position, -30.0);
    set(table_record_, &FakeAxisRecord::lost_from_move, 3);
    EXPECT_THROW(run(turn("mug")), DeviceLost);
    set(table_record_, &FakeAxisRecord::lost_from_move, -1);
    set(table_record_, &FakeAxisRecord::moves, std::vector<double>());
  }
  /// Why the set is not continued on `rig`; empty when it was.
  std::string refusal(Rig& rig) {
    AcquisitionReport report;
    try {
      acquire(turn("mug"), {rig, camera_, clock_}, report, {}, {});
    } catch (const FileError& error) {
      EXPECT_TRUE(table_record_.moves.empty()) << "nothing moves before it is refused";
      EXPECT_EQ(ImageSet::open(folder_.path() / "mug").views().size(), 3U);
      return error.what();
    }
    return "";
  }
  nlohmann::json recorded() const {
    std::ifstream index(folder_.path() / "mug" / "set.json");
    return nlohmann::json::parse(index).at("source").at("actuators");
  }
};

TEST_F(BrokenOff, IsNotContinuedWhereAnAxisOutsideThePlanStandsElsewhere) {
  set(arm_record_, &FakeAxisRecord::position, 30.0);
  const std::string text = refusal(rig_);
  EXPECT_THAT(text, HasSubstr("arm stood at -30 deg and stands at 30 deg now"));
  EXPECT_THAT(text, HasSubstr("'eigenpose jog'"));
  EXPECT_THAT(text, HasSubstr("or remove the set"));
  set(arm_record_, &FakeAxisRecord::position, -31.01);
  EXPECT_NE(refusal(rig_), "") << "beyond twice the tolerance of 0.5";
  set(arm_record_, &FakeAxisRecord::position, -30.99);
  EXPECT_EQ(refusal(rig_), "");
  EXPECT_EQ(recorded().at("arm_deg"), -30.0) << "the record is of the first run";
  EXPECT_EQ(recorded().at("table_deg"), 0.0);
}

TEST_F(BrokenOff, IsNotContinuedWhereAnAxisOutsideThePlanHasLostItsPosition) {
  set(arm_record_, &FakeAxisRecord::homed, false);
  EXPECT_THAT(refusal(rig_),
              HasSubstr("arm stood at -30 deg and stands at a position that is not known now"));
  set(arm_record_, &FakeAxisRecord::homed, true);
  EXPECT_EQ(refusal(rig_), "");
}

TEST_F(BrokenOff, IsNotContinuedInAnotherLight) {
  Rig dimmer({fake(table, table_record_, clock_), fake(arm, arm_record_, clock_)},
             {fake_lamp("key", 0.5, lamp_record_)}, clock_, heartbeat_);
  EXPECT_THAT(refusal(dimmer), HasSubstr("key stood at 0.8 level and stands at 0.5 level now"));
  Rig unlit({fake(table, table_record_, clock_), fake(arm, arm_record_, clock_)}, {}, clock_, heartbeat_);
  EXPECT_THAT(refusal(unlit), HasSubstr("key_level stood at 0.8 and is not configured now"));
  FakeLampRecord fill;
  Rig brighter({fake(table, table_record_, clock_), fake(arm, arm_record_, clock_)},
               {fake_lamp("key", 0.8, lamp_record_), fake_lamp("fill", 0.3, fill)}, clock_, heartbeat_);
  EXPECT_THAT(refusal(brighter), HasSubstr("fill stood at a position that is not known and stands at 0.3"));
}

TEST_F(AcquisitionTest, AnAxisThatWasNotHomedAtTheBeginningMustNotBeAtTheContinuation) {
  set(arm_record_, &FakeAxisRecord::homed, false);
  for (const int lost_from : {3, 5}) {
    set(table_record_, &FakeAxisRecord::lost_from_move, lost_from);
    EXPECT_THROW(run(turn("mug")), DeviceLost) << "where it stands is as unknown as before";
  }
  set(arm_record_, &FakeAxisRecord::homed, true);
  EXPECT_THROW(run(turn("mug")), FileError) << "it was moved to be homed";
}

TEST_F(AcquisitionTest, ASetBegunWithoutAViewIsBegunAnewWhereverTheRigStands) {
  set(table_record_, &FakeAxisRecord::lost_from_move, 0);
  EXPECT_THROW(run(turn("mug")), DeviceLost);
  set(table_record_, &FakeAxisRecord::lost_from_move, -1);
  set(arm_record_, &FakeAxisRecord::position, 30.0);
  EXPECT_EQ(run(turn("mug")).taken, 6U);
  std::ifstream index(folder_.path() / "mug" / "set.json");
  EXPECT_EQ(nlohmann::json::parse(index).at("source").at("actuators").at("arm_deg"), 30.0);
}

TEST_F(AcquisitionTest, AnUnfinishedSetThatNoAcquisitionHasBegunIsNotContinued) {
  const AcquisitionRequest request = turn("mug");
  ImageSetWriter(request.image_sets, "mug", request.workspace, {{"imported_from", "photographs"}})
      .add(cv::Mat(8, 8, CV_8UC1, cv::Scalar(9)), {0.0});
  EXPECT_THROW(run(request), FileError);
  EXPECT_TRUE(table_record_.moves.empty());
}

TEST_F(AcquisitionTest, AnUnfinishedSetThatSaysNothingOfTheRigIsContinued) {
  const AcquisitionRequest request = turn("mug");
  ImageSetWriter(request.image_sets, "mug", request.workspace, nlohmann::json::object())
      .add(cv::Mat(48, 64, CV_8UC1, cv::Scalar(0)), {0.0});
  EXPECT_EQ(run(request).kept, 1U);
}

TEST_F(AcquisitionTest, ACompleteSetIsRefusedBeforeAnythingMoves) {
  run(turn("mug"));
  set(table_record_, &FakeAxisRecord::moves, std::vector<double>());
  EXPECT_THROW(run(turn("mug")), FileError);
  EXPECT_TRUE(table_record_.moves.empty());
}

TEST_F(AcquisitionTest, ABadObjectNameIsRefusedBeforeAnythingMoves) {
  EXPECT_THROW(run(turn("../etc")), std::invalid_argument);
  EXPECT_TRUE(table_record_.moves.empty());
}

TEST_F(AcquisitionTest, AStopReachesTheAxisInTheMiddleOfAMove) {
  set(table_record_, &FakeAxisRecord::blocks, true);
  std::stop_source source;
  auto acquisition = std::async(std::launch::async, [&] { run(turn("mug"), source.get_token()); });
  {
    std::unique_lock lock(table_record_.mutex);
    table_record_.changed.wait(lock, [&] { return table_record_.moving; });
  }
  source.request_stop();
  EXPECT_THROW(acquisition.get(), Interrupted);
  EXPECT_GE(table_record_.stops, 1);
  EXPECT_FALSE(table_record_.moving);
}

TEST_F(AcquisitionTest, WithoutACameraNothingIsTakenAndTheErrorSaysWhatToDo) {
  FrameHub none(FrameHub::OpenCamera{}, clock_, heartbeat_);
  AcquisitionReport report;
  try {
    acquire(turn("mug"), {rig_, none, clock_}, report, {}, {});
    FAIL() << "succeeded";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("add [camera]"));
  }
  EXPECT_EQ(report.taken, 0U);
}

}  // namespace
}  // namespace eigenpose::acquisition_test
