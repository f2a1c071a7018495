#include "core/recognition/parts_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/base/angle.h"
#include "core/recognition/recognizer.h"
#include "tests/support/parts_world.h"

namespace eigenpose {
namespace {

using testing::parts_world;
using testing::PartsWorld;

cv::Mat scene_of(int kind, double angle, int seed = 3) {
  return testing::scene_with(kind, angle, PartsWorld::knobs(), seed);
}

TEST(PartsStage, FindsPosesWithinAThirdOfTheLearnedStepAroundTheWholeTurn) {
  Recognizer recognize(parts_world().model);
  for (double angle = 1.0; angle < 361.0; angle += 13.0) {
    const auto outcomes = recognize.recognize(scene_of(2, angle));
    ASSERT_EQ(outcomes.size(), 1U) << angle;
    ASSERT_EQ(outcomes[0].verdict, Verdict::recognized) << angle;
    EXPECT_EQ(outcomes[0].best->object, "two");
    EXPECT_LT(std::abs(circular_difference(outcomes[0].best->q[0], angle, 360.0)), 10.0 / 3.0) << angle;
    EXPECT_FALSE(outcomes[0].unfinished);
  }
}

TEST(PartsStage, MeasuresEachObjectByItsOwnYardstick) {
  // An object whose views usually lie so near that no view does any longer.
  const std::size_t one = parts_world().index_of("one");
  auto changed = std::make_shared<Model>(*parts_world().model);
  changed->objects[one].typical_distance = 1e-9;
  for (const double weight : {10.0, 20.0}) {
    changed->decision.weights.windows[2] = changed->decision.weights.whole[2] = weight;
    changed->decision.weights.windows[0] = changed->decision.weights.whole[0] = 4.5 * weight;
    changed->decision.tuning.most_occluded = -1.0;  // nothing is occluded
    Recognizer recognize(changed);
    for (double angle = 5.0; angle < 360.0; angle += 60.0) {
      const auto refused = recognize.recognize(scene_of(1, angle));
      ASSERT_EQ(refused.size(), 1U);
      EXPECT_EQ(refused[0].verdict, Verdict::unknown) << angle;
      EXPECT_LT(refused[0].evidence, refused[0].required_evidence);
      const auto others = recognize.recognize(scene_of(2, angle));
      ASSERT_EQ(others.size(), 1U);
      EXPECT_EQ(others[0].verdict, Verdict::recognized) << angle;
    }
  }
}

TEST(PartsStage, AsksTheWindowsWhereTheWholeRegionDoesNotSettleIt) {
  // Weights by which the windows speak against, or for, whatever they see.
  for (const double offset : {1e6, -1e6}) {
    Recognizer recognize(parts_world().deciding([&](DecisionModel& decision) {
      decision.settled = std::numeric_limits<double>::infinity();
      decision.weights.windows = {offset};
      decision.tuning.most_occluded = -1.0;  // nothing is occluded
    }));
    const auto outcomes = recognize.recognize(scene_of(1, 40.0));
    ASSERT_EQ(outcomes.size(), 1U);
    EXPECT_NE(outcomes[0].verdict == Verdict::unknown, offset > 0.0);
    EXPECT_EQ(outcomes[0].evidence, offset);
  }
}

TEST(PartsStage, KnowsObjectsThoughTheLightIsOfASlightlyOtherColour) {
  Recognizer recognize(parts_world().model);
  for (const double red : {0.98, 1.02})
    for (const double angle : {5.0, 40.0, 215.0}) {
      cv::Mat scene = scene_of(1, angle);
      cv::multiply(scene, cv::Scalar(1.0 / red, 1.0, red), scene);
      const auto outcomes = recognize.recognize(scene);
      ASSERT_EQ(outcomes.size(), 1U);
      EXPECT_EQ(outcomes[0].verdict, Verdict::recognized) << red << " " << angle;
      EXPECT_EQ(outcomes[0].best->object, "one");
    }
}

TEST(PartsStage, SettlesByTheWholeRegionAloneWithEnoughEvidence) {
  // Windows that speak against everything are not asked.
  Recognizer recognize(parts_world().deciding([](DecisionModel& decision) {
    decision.required = decision.required_occluded = decision.settled = -1e6;
    decision.tuning.settled_lead = -1e6;
    decision.weights.windows = {-1e9};
  }));
  const auto outcomes = recognize.recognize(scene_of(1, 40.0));
  ASSERT_EQ(outcomes.size(), 1U);
  EXPECT_EQ(outcomes[0].verdict, Verdict::recognized);
  EXPECT_EQ(outcomes[0].best->object, "one");
  EXPECT_EQ(outcomes[0].required_evidence, -1e6);
  EXPECT_GT(outcomes[0].evidence, -1e6);
}

TEST(PartsStage, AcceptsOccludedObjectsByTheirEvidenceUpToHalfOccluded) {
  cv::Mat scene = scene_of(1, 40.0);
  Segmenter segmenter(parts_world().model->normalization.segmentation);
  const cv::Rect box = segmenter.segment(scene)[0].box;
  scene(cv::Rect(box.x + box.width / 4, box.y + box.height / 3, box.width / 3, box.height / 3))
      .setTo(cv::Scalar::all(3));
  struct Case {
    double occluded_offset;
    double most_occluded;
    double least_masking_gain;
    bool accepted;
  };
  for (const Case& shown : {Case{1e6, 0.5, -1e6, true}, Case{-1e6, 0.5, -1e6, false},
                            Case{1e6, 0.001, -1e6, false}, Case{1e6, 0.5, 1e6, false}}) {
    auto changed = std::make_shared<Model>(*parts_world().changed([&](PartsModel& parts) {
      for (PartsCalibration& own : parts.calibration) own.foreign_share = 0.0;
      parts.extents.assign(parts.objects.size(), std::vector<cv::Size>(36));  // nothing is split
    }));
    changed->decision.settled = std::numeric_limits<double>::infinity();
    changed->decision.weights.windows = {-1e9};
    changed->decision.weights.occluded = {shown.occluded_offset};
    changed->decision.tuning.most_occluded = shown.most_occluded;
    changed->decision.tuning.least_masking_gain = shown.least_masking_gain;
    Recognizer recognize(changed);
    const auto outcomes = recognize.recognize(scene);
    ASSERT_EQ(outcomes.size(), 1U);
    EXPECT_EQ(outcomes[0].verdict, shown.accepted ? Verdict::recognized : Verdict::unknown)
        << shown.occluded_offset << " " << shown.most_occluded << " " << shown.least_masking_gain;
    if (!shown.accepted) continue;
    EXPECT_GT(outcomes[0].covered_share, 0.0);
    EXPECT_LE(outcomes[0].covered_share, 0.5);
    EXPECT_EQ(outcomes[0].best->object, "one");
  }
}

/// A model of objects that all look like `scene`.
std::shared_ptr<const Model> learn_scenes(
    const std::vector<std::pair<std::string, std::function<cv::Mat(double, int)>>>& objects) {
  const test::TemporaryFolder folder;
  for (const auto& [name, scene] : objects) testing::write_turn(folder.path(), name, 36, scene);
  const auto sets = open_image_sets(folder.path());
  return std::make_shared<const Model>(learn(all_views(sets), PartsWorld::options()));
}

TEST(PartsStage, ReportsATieOfTwoObjectsThatLookTheSameAsAmbiguous) {
  const auto scene = [](double angle, int seed) { return scene_of(1, angle, seed); };
  const auto again = [](double angle, int seed) { return scene_of(1, angle, seed + 500); };
  Recognizer recognize(learn_scenes({{"left", scene}, {"right", again}}));
  int ambiguous = 0;
  int shown = 0;
  for (double angle = 5.0; angle < 360.0; angle += 30.0) {
    const auto outcomes = recognize.recognize(scene_of(1, angle, 900));
    ASSERT_EQ(outcomes.size(), 1U);
    ++shown;
    ambiguous += outcomes[0].verdict == Verdict::ambiguous ? 1 : 0;
    ASSERT_TRUE(outcomes[0].runner_up);
    EXPECT_NE(outcomes[0].runner_up->object, outcomes[0].best->object);
    EXPECT_NE(outcomes[0].verdict, Verdict::unknown);
  }
  EXPECT_GE(ambiguous, shown - 2) << "of " << shown;
}

TEST(PartsStage, ReportsTheOtherPoseOfAnObjectThatLooksTheSameFromBehind) {
  const auto twice = [](double angle, int seed) { return scene_of(1, 2.0 * angle, seed); };
  const auto plain = [](double angle, int seed) { return scene_of(2, angle, seed); };
  Recognizer recognize(learn_scenes({{"twice", twice}, {"plain", plain}}));
  for (double angle = 4.0; angle < 360.0; angle += 45.0) {
    const auto outcomes = recognize.recognize(twice(angle, 901));
    ASSERT_EQ(outcomes.size(), 1U);
    ASSERT_TRUE(outcomes[0].best);
    EXPECT_EQ(outcomes[0].best->object, "twice");
    ASSERT_TRUE(outcomes[0].other_pose) << angle;
    EXPECT_EQ(outcomes[0].other_pose->object, "twice");
    const double apart = circular_difference(outcomes[0].other_pose->q[0], outcomes[0].best->q[0], 360.0);
    EXPECT_NEAR(std::abs(apart), 180.0, 8.0) << angle;
    const double error = std::abs(circular_difference(outcomes[0].best->q[0], angle, 360.0));
    EXPECT_LT(std::min(error, std::abs(error - 180.0)), 4.0) << angle;
    const auto unique = recognize.recognize(plain(angle, 902));
    ASSERT_EQ(unique.size(), 1U);
    EXPECT_FALSE(unique[0].other_pose) << angle;
  }
}

}  // namespace
}  // namespace eigenpose
