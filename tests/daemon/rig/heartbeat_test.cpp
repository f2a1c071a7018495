#include "daemon/rig/heartbeat.h"

#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eigenpose::heartbeat_test {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

class HeartbeatTest : public testing::Test {
 protected:
  ManualClock clock_;
  Heartbeat heartbeat_{clock_};
};

TEST_F(HeartbeatTest, AWorkerIsOverdueOnceItsLimitHasPassedWithoutABeat) {
  auto camera = heartbeat_.join("camera", seconds(10));
  clock_.advance(seconds(10));
  EXPECT_THAT(heartbeat_.overdue(), IsEmpty());
  clock_.advance(seconds(1));
  EXPECT_THAT(heartbeat_.overdue(), ElementsAre("camera"));
  camera.beat();
  EXPECT_THAT(heartbeat_.overdue(), IsEmpty());
  clock_.advance(seconds(11));
  EXPECT_THAT(heartbeat_.overdue(), ElementsAre("camera")) << "each beat counts for one limit only";
}

TEST_F(HeartbeatTest, OneWorkerThatHangsIsNamedAmongOthersThatTurn) {
  auto rig = heartbeat_.join("rig", seconds(5));
  auto camera = heartbeat_.join("camera", seconds(5));
  auto watcher = heartbeat_.join("watcher", seconds(5));
  clock_.advance(seconds(6));
  rig.beat();
  watcher.beat();
  EXPECT_THAT(heartbeat_.overdue(), ElementsAre("camera"));
}

TEST_F(HeartbeatTest, AStepThatMayTakeLongIsAllowedItsTimeOnce) {
  auto rig = heartbeat_.join("rig", seconds(5));
  rig.beat(seconds(30));
  clock_.advance(seconds(35));
  EXPECT_THAT(heartbeat_.overdue(), IsEmpty());
  rig.beat();
  clock_.advance(seconds(6));
  EXPECT_THAT(heartbeat_.overdue(), ElementsAre("rig"));
}

TEST_F(HeartbeatTest, NothingIsExpectedOfAWorkerAtRestUntilItBeatsAgain) {
  auto job = heartbeat_.join("job 1", seconds(5));
  job.rest();
  clock_.advance(seconds(1000));
  EXPECT_THAT(heartbeat_.overdue(), IsEmpty());
  job.beat();
  clock_.advance(seconds(6));
  EXPECT_THAT(heartbeat_.overdue(), ElementsAre("job 1"));
}

TEST_F(HeartbeatTest, AWorkerThatHasLeftIsNotMissedAndAMovedOneStays) {
  Heartbeat::Pulse kept;
  {
    auto leaving = heartbeat_.join("leaving", seconds(5));
    auto staying = heartbeat_.join("staying", seconds(5));
    kept = std::move(staying);
  }
  clock_.advance(seconds(6));
  EXPECT_THAT(heartbeat_.overdue(), ElementsAre("staying"));
  kept = {};
  EXPECT_THAT(heartbeat_.overdue(), IsEmpty());
}

}  // namespace
}  // namespace eigenpose::heartbeat_test
