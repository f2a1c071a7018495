#include "sim/lab/sim_lab.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eigenpose::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

struct Lab : testing::Test {
  ManualClock clock{TimePoint(seconds(1000))};
  SimLab lab{clock};
};

TEST_F(Lab, HasTwelveObjectsToLearnASymmetricOneAmongThemAndTwoHeldOut) {
  int learnable = 0;
  int symmetric = 0;
  int held_out = 0;
  for (const CatalogEntry& entry : lab.objects()) {
    if (entry.held_out) {
      ++held_out;
    } else {
      ++learnable;
      symmetric += entry.symmetric ? 1 : 0;
    }
  }
  EXPECT_GE(learnable, 12);
  EXPECT_GE(symmetric, 1);
  EXPECT_GE(held_out, 2);
}

TEST_F(Lab, TheTableTurnsWhatStandsOnIt) {
  lab.place("mug", degrees(30), 40.0, 0.0);
  lab.set_axis_position(LabAxis::table, degrees(90));
  const Truth truth = lab.truth();
  ASSERT_EQ(truth.objects.size(), 1U);
  EXPECT_NEAR(truth.objects[0].angle.degrees(), 120.0, 1e-9);
  EXPECT_NEAR(truth.objects[0].yaw.degrees(), 30.0, 1e-9);
  const SceneState scene = lab.scene_at(clock.now());
  EXPECT_NEAR(scene.objects[0].x_mm, 0.0, 1e-9);
  EXPECT_NEAR(scene.objects[0].y_mm, 40.0, 1e-9);
}

TEST_F(Lab, TheTruthFollowsTheMotionLaw) {
  const auto motion =
      Trajectory::standstill(0.0, clock.now()).move_to(180.0, {90.0, 360.0, 360.0}, clock.now());
  lab.set_axis_motion(LabAxis::table, motion);
  while (!(clock.now() > motion.end())) {
    EXPECT_NEAR(lab.truth().table.degrees(), motion.position(clock.now()), 1e-9);
    EXPECT_EQ(lab.truth().moving, motion.moving(clock.now()));
    clock.advance(milliseconds(37));
  }
  EXPECT_NEAR(lab.truth().table.degrees(), 180.0, 1e-9);
}

TEST_F(Lab, RemembersHowItLookedDuringAnExposureThatIsOver) {
  const auto id = lab.place("duck");
  const TimePoint there = clock.now();
  clock.advance(milliseconds(10));
  lab.remove(id);
  lab.set_axis_position(LabAxis::table, degrees(45));
  clock.advance(milliseconds(10));
  EXPECT_EQ(lab.scene_at(there).objects.size(), 1U);
  EXPECT_NEAR(lab.scene_at(there).objects[0].angle_deg, 0.0, 1e-9);
  EXPECT_TRUE(lab.scene_at(clock.now()).objects.empty());
}

TEST_F(Lab, AHandBringsAnObjectAndLeaves) {
  lab.place_by_hand("car", degrees(10), 5.0, -5.0);
  EXPECT_TRUE(lab.truth().moving);
  EXPECT_TRUE(lab.truth().objects.at(0).carried);
  clock.advance(milliseconds(200));
  EXPECT_TRUE(lab.truth().hand_in_view);
  EXPECT_GT(lab.scene_at(clock.now()).objects.at(0).z_mm, 1.0);
  clock.advance(seconds(1));
  EXPECT_FALSE(lab.truth().objects.at(0).carried);
  EXPECT_NEAR(lab.scene_at(clock.now()).objects.at(0).x_mm, 5.0, 1e-9);
  EXPECT_EQ(lab.scene_at(clock.now()).objects.at(0).z_mm, 0.0);
  clock.advance(seconds(2));
  EXPECT_FALSE(lab.truth().hand_in_view);
  EXPECT_FALSE(lab.truth().moving);
  EXPECT_EQ(lab.truth().objects.size(), 1U);
}

TEST_F(Lab, AHandTakesAnObjectAway) {
  const auto id = lab.place("pig");
  lab.remove_by_hand(id);
  EXPECT_EQ(lab.truth().objects.size(), 1U);
  clock.advance(seconds(4));
  EXPECT_TRUE(lab.truth().objects.empty());
  EXPECT_FALSE(lab.truth().hand_in_view);
}

TEST_F(Lab, RefusesWhatItDoesNotHaveAndWhatWouldFallOff) {
  EXPECT_THROW(lab.place("unicorn"), std::invalid_argument);
  EXPECT_THROW(lab.place("mug", {}, 500.0, 0.0), std::invalid_argument);
  EXPECT_THROW(lab.remove(77), std::invalid_argument);
  EXPECT_THROW(lab.set_lamp_level(1.5), std::out_of_range);
  EXPECT_TRUE(lab.truth().objects.empty());
}

}  // namespace
}  // namespace eigenpose::sim
