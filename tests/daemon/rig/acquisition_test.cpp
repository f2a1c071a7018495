#include "daemon/rig/acquisition.h"

#include <future>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "tests/daemon/fakes.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const Dof table{"table", "deg", 0.0, 360.0, true};
const Dof arm{"arm", "deg", -90.0, 90.0, false};
constexpr std::chrono::milliseconds settle{15};

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
  AcquisitionReport run(const AcquisitionRequest& what, std::stop_token stop = {}) {
    AcquisitionReport report;
    report_ = {};
    try {
      acquire(what, rig_, camera_, clock_, report, {}, std::move(stop));
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
  Rig rig_{{fake(table, table_record_, clock_), fake(arm, arm_record_, clock_)}, {}, clock_};
  FrameHub camera_{[this] { return std::make_unique<FakeCamera>(table_record_, settle, clock_); }, clock_};
  AcquisitionReport report_;
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

TEST_F(AcquisitionTest, ReturnsToTheFirstPoseAtTheEnd) {
  run(turn("mug"));
  EXPECT_THAT(table_record_.moves, ElementsAre(0, 60, 120, 180, 240, 300, 0));
}

TEST_F(AcquisitionTest, CoversTheGridOfTwoAxesAndMovesOnlyWhatChanges) {
  run(request("mug", {{"arm", {-30, 30}, {}}, {"table", {0, 120, 240}, {}}}));
  const ImageSet set = ImageSet::open(folder_.path() / "mug");
  ASSERT_EQ(set.views().size(), 6U);
  EXPECT_THAT(set.views()[4].q, ElementsAre(30, 120));
  EXPECT_THAT(arm_record_.moves, ElementsAre(-30, 30, -30));
  EXPECT_THAT(table_record_.moves, ElementsAre(0, 120, 240, 0, 120, 240, 0));
}

TEST_F(AcquisitionTest, HomesAnAxisThatHasLostItsZero) {
  table_record_.homed = false;
  run(turn("mug"));
  EXPECT_EQ(table_record_.homings, 1);
}

TEST_F(AcquisitionTest, ALostAxisEndsInItsErrorWithMotionStoppedAndViewsKept) {
  table_record_.lost_from_move = 3;
  try {
    run(turn("mug"));
    FAIL() << "succeeded";
  } catch (const DeviceLost& error) {
    EXPECT_THAT(error.what(), HasSubstr("table: move: connection closed"));
  }
  EXPECT_EQ(report_.taken, 3U);
  EXPECT_GE(table_record_.stops, 1);
  EXPECT_GE(arm_record_.stops, 0);
  const ImageSet set = ImageSet::open(folder_.path() / "mug");
  EXPECT_EQ(set.views().size(), 3U);
  EXPECT_FALSE(set.complete());
}

TEST_F(AcquisitionTest, ContinuesWhereItWasBrokenOff) {
  table_record_.lost_from_move = 3;
  EXPECT_THROW(run(turn("mug")), DeviceLost);
  table_record_.lost_from_move = -1;
  table_record_.moves.clear();
  const AcquisitionReport report = run(turn("mug"));
  EXPECT_EQ(report.kept, 3U);
  EXPECT_EQ(report.taken, 3U);
  EXPECT_THAT(table_record_.moves, ElementsAre(180, 240, 300, 0));
  EXPECT_EQ(ImageSet::open(folder_.path() / "mug").views().size(), 6U);
}

TEST_F(AcquisitionTest, ACompleteSetIsRefusedBeforeAnythingMoves) {
  run(turn("mug"));
  table_record_.moves.clear();
  EXPECT_THROW(run(turn("mug")), FileError);
  EXPECT_TRUE(table_record_.moves.empty());
}

TEST_F(AcquisitionTest, ABadObjectNameIsRefusedBeforeAnythingMoves) {
  EXPECT_THROW(run(turn("../etc")), std::invalid_argument);
  EXPECT_TRUE(table_record_.moves.empty());
}

TEST_F(AcquisitionTest, AStopReachesTheAxisInTheMiddleOfAMove) {
  table_record_.blocks = true;
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
  FrameHub none(FrameHub::OpenCamera{}, clock_);
  AcquisitionReport report;
  try {
    acquire(turn("mug"), rig_, none, clock_, report, {}, {});
    FAIL() << "succeeded";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("add [camera]"));
  }
  EXPECT_EQ(report.taken, 0U);
}

TEST(RigTest, AnAxisThatCannotBeOpenedIsToldAndDoesNotStopTheOthers) {
  SteadyClock clock;
  FakeAxisRecord record;
  RigAxisOptions broken;
  broken.dof = arm;
  Rig rig({{broken, []() -> std::unique_ptr<Axis> { throw DeviceLost("arm", "open", "not there"); }},
           fake(table, record, clock)},
          {}, clock);
  EXPECT_THROW(rig.run([](Rig::Control& axes) { axes.move_to("arm", 0, {}); }), DeviceLost);
  EXPECT_NO_THROW(rig.run([](Rig::Control& axes) { axes.move_to("table", 30, {}); }));
  const std::vector<AxisStatus> status = rig.status();
  EXPECT_THAT(status[0].error.value_or(""), HasSubstr("arm: open: not there"));
  EXPECT_EQ(status[1].state->position, 30.0);
}

TEST(RigTest, EndingItEndsAMotionUnderWay) {
  SteadyClock clock;
  FakeAxisRecord record;
  record.blocks = true;
  auto rig = std::make_unique<Rig>(std::vector{fake(table, record, clock)}, std::vector<RigLamp>{}, clock);
  auto work = std::async(std::launch::async, [&rig = *rig] {
    rig.run([](Rig::Control& axes) { axes.move_to("table", 90, {}); });
  });
  {
    std::unique_lock lock(record.mutex);
    record.changed.wait(lock, [&] { return record.moving; });
  }
  rig.reset();
  EXPECT_THROW(work.get(), Interrupted);
  EXPECT_FALSE(record.moving);
}

}  // namespace
}  // namespace eigenpose
