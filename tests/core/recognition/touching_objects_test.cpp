#include "core/recognition/touching_objects.h"

#include <cmath>
#include <stop_token>

#include <gmock/gmock.h>

#include "core/base/angle.h"
#include "core/recognition/recognizer.h"
#include "tests/support/parts_world.h"

namespace eigenpose {
namespace {

using testing::SceneKnobs;

using testing::PartsWorld;

const PartsWorld& world() {
  return testing::parts_world();
}

/// Where the only object of a scene stands.
cv::Rect only_box(const cv::Mat& scene) {
  Segmenter segmenter(world().model->normalization.segmentation);
  const auto regions = segmenter.segment(scene);
  return regions.size() == 1 ? regions[0].box : cv::Rect();
}

struct TouchingScene {
  cv::Mat picture;
  cv::Rect left;  ///< of each object, alone
  cv::Rect right;
};

/// Two objects side by side, moved together until they are one region.
TouchingScene touching_scene(int left, double left_angle, int right, double right_angle) {
  const SceneKnobs a = PartsWorld::knobs();
  SceneKnobs b = a;
  for (b.x = a.x + 160.0;; b.x -= 2.0) {
    TouchingScene scene{testing::scene_with(left, left_angle, a), {}, {}};
    testing::draw_object(scene.picture, right, right_angle, b);
    Segmenter segmenter(world().model->normalization.segmentation);
    if (segmenter.segment(scene.picture).size() > 1) continue;
    scene.left = only_box(testing::scene_with(left, left_angle, a));
    scene.right = only_box(testing::scene_with(right, right_angle, b));
    return scene;
  }
}

cv::Mat touching(int left, double left_angle, int right, double right_angle) {
  return touching_scene(left, left_angle, right, right_angle).picture;
}

double union_share(const cv::Rect& a, const cv::Rect& b) {
  return static_cast<double>((a & b).area()) / (a.area() + b.area() - (a & b).area());
}

TEST(TouchingObjects, AreSplit) {
  Recognizer recognize(world().model);
  int right = 0;
  int pairs = 0;
  for (double angle = 5.0; angle < 360.0; angle += 50.0) {
    ++pairs;
    const auto outcomes = recognize.recognize(touching(1, angle, 2, angle + 65.0));
    if (outcomes.size() != 2) continue;
    const bool swapped = outcomes[0].box.x > outcomes[1].box.x;
    const Outcome& left = outcomes[swapped ? 1 : 0];
    const Outcome& other = outcomes[swapped ? 0 : 1];
    ASSERT_EQ(left.verdict, Verdict::recognized);
    ASSERT_EQ(other.verdict, Verdict::recognized);
    EXPECT_EQ(left.best->object, "one");
    EXPECT_EQ(other.best->object, "two");
    EXPECT_LT(std::abs(circular_difference(left.best->q[0], angle, 360.0)), 12.0);
    EXPECT_LT(std::abs(circular_difference(other.best->q[0], angle + 65.0, 360.0)), 12.0);
    ++right;
  }
  EXPECT_GE(right, pairs - 2) << "of " << pairs;
}

TEST(PartsStage, IsLessConfidentAndHasLessEvidenceTheMoreIsOccluded) {
  Recognizer recognize(world().model);
  double last = std::numeric_limits<double>::infinity();
  double last_confidence = 1.0;
  double least = 1.0;
  for (const double hidden : {0.0, 0.15, 0.3}) {
    double sum = 0.0;
    double confidence = 0.0;
    int told = 0;
    for (double angle = 5.0; angle < 360.0; angle += 30.0) {
      cv::Mat scene = testing::scene_with(1, angle, PartsWorld::knobs());
      Segmenter segmenter(recognize.model().normalization.segmentation);
      cv::Rect box = segmenter.segment(scene)[0].box;
      // What is hidden is as dark as the table, in the middle of one side: the outline stays.
      const int height = static_cast<int>(hidden * box.height);
      scene(cv::Rect(box.x + box.width / 4, box.y + box.height / 2, box.width / 2, height))
          .setTo(cv::Scalar::all(3));
      for (const Outcome& outcome : recognize.recognize(scene)) {
        if (!outcome.best) continue;
        sum += outcome.evidence;  // of what is called unknown, too
        confidence += outcome.confidence;
        ++told;
        if (outcome.verdict != Verdict::recognized) continue;
        EXPECT_EQ(outcome.best->object, "one");
        least = std::min(least, outcome.confidence);
      }
    }
    ASSERT_GT(told, 0) << hidden;
    EXPECT_LT(sum / told, last + 1e-9) << hidden;
    last = sum / told;
    EXPECT_LT(confidence / told, last_confidence + 1e-9) << hidden;
    last_confidence = confidence / told;
  }
  EXPECT_GT(least, 0.0);
  EXPECT_LT(last_confidence, 0.9);
}

TEST(TouchingObjects, AreSplitWithoutTheSizesOfObjectsThatCameReadyCut) {
  Model model = *world().model;
  auto parts = std::make_shared<PartsModel>(*model.parts);
  ASSERT_EQ(model.objects[1].name, "three");
  for (cv::Size& size : parts->extents[1]) size = {};
  model.parts = parts;
  Recognizer recognize(std::make_shared<const Model>(model));
  const cv::Mat scene = touching(1, 5.0, 2, 70.0);
  const auto outcomes = recognize.recognize(scene);
  ASSERT_EQ(outcomes.size(), 2U);
  EXPECT_EQ(outcomes[0].best->object, "one");
  EXPECT_EQ(outcomes[1].best->object, "two");
}

TEST(TouchingObjects, LeavesAnObjectThatStandsNearerThanItWasLearnedInOnePiece) {
  Recognizer recognize(world().model);
  for (double angle = 5.0; angle < 360.0; angle += 60.0) {
    SceneKnobs near = SceneKnobs::centred(400, 300, 2.4);  // half as large again
    const auto outcomes = recognize.recognize(testing::scene_with(1, angle, near));
    ASSERT_EQ(outcomes.size(), 1U) << angle;
    ASSERT_EQ(outcomes[0].verdict, Verdict::recognized) << angle;
    EXPECT_EQ(outcomes[0].best->object, "one");
    EXPECT_LT(std::abs(circular_difference(outcomes[0].best->q[0], angle, 360.0)), 12.0);
  }
}

TEST(TouchingObjects, LeavesUnknownObjectsInOnePiece) {
  Recognizer recognize(world().model);
  int taken_apart = 0;
  for (int kind = 20; kind < 32; ++kind) {
    SceneKnobs knobs = PartsWorld::knobs();
    knobs.scale = 2.4;  // large enough for two
    const auto outcomes = recognize.recognize(testing::scene_with(kind, 30.0 * kind, knobs));
    if (outcomes.size() == 1U) {
      EXPECT_EQ(outcomes[0].verdict, Verdict::unknown);
    } else
      ++taken_apart;
  }
  EXPECT_LE(taken_apart, 1) << "of 12; made-up objects are much alike";
}

TEST(TouchingObjects, ReportsAKnownObjectBesideAnUnknownOne) {
  Recognizer recognize(world().model);
  int told = 0;
  int shown = 0;
  for (double angle = 5.0; angle < 360.0; angle += 45.0) {
    ++shown;
    bool known = false;
    bool unknown = false;
    for (const Outcome& outcome : recognize.recognize(touching(1, angle, 25, 40.0))) {
      unknown = unknown || outcome.verdict == Verdict::unknown;
      if (outcome.verdict != Verdict::recognized) continue;
      known = true;
      EXPECT_EQ(outcome.best->object, "one");
      EXPECT_LT(std::abs(circular_difference(outcome.best->q[0], angle, 360.0)), 15.0);
    }
    EXPECT_TRUE(unknown) << angle;
    told += known ? 1 : 0;
  }
  EXPECT_GE(told, shown / 2) << "of " << shown;
}

TEST(TouchingObjects, GetTheBoxesInWhichTheyStand) {
  Recognizer recognize(world().model);
  int split = 0;
  for (double angle = 5.0; angle < 360.0; angle += 50.0) {
    const TouchingScene scene = touching_scene(1, angle, 2, angle + 65.0);
    for (const Outcome& outcome : recognize.recognize(scene.picture)) {
      if (outcome.verdict != Verdict::recognized) continue;
      ++split;
      const cv::Rect& truth = outcome.best->object == "one" ? scene.left : scene.right;
      EXPECT_GT(union_share(outcome.box, truth), 0.6)
          << outcome.best->object << " at " << angle << ": " << outcome.box << ", it stands in " << truth;
    }
  }
  EXPECT_GE(split, 10);
}

TEST(TouchingObjects, AreNotSplitWhereTheSearchIsStoppedAndTheOutcomeSaysSo) {
  Recognizer recognize(world().model);
  const cv::Mat scene = touching(1, 55.0, 2, 120.0);
  const auto whole = recognize.recognize(scene);
  ASSERT_EQ(whole.size(), 2U);
  for (const Outcome& outcome : whole) EXPECT_FALSE(outcome.unfinished);
  std::stop_source source;
  source.request_stop();
  RecognitionLimits stopped;
  stopped.stop = source.get_token();
  RecognitionLimits no_time;
  no_time.region_time = Duration::zero();
  for (const RecognitionLimits& limits : {stopped, no_time}) {
    const auto outcomes = recognize.recognize(scene, limits);
    ASSERT_EQ(outcomes.size(), 1U);
    EXPECT_TRUE(outcomes[0].unfinished);
    EXPECT_EQ(outcomes[0].verdict, Verdict::unknown);
    // What needs no search is not touched by the limits.
    const auto alone = recognize.recognize(testing::scene_with(1, 55.0, PartsWorld::knobs()), limits);
    ASSERT_EQ(alone.size(), 1U);
    EXPECT_EQ(alone[0].verdict, Verdict::recognized);
    EXPECT_FALSE(alone[0].unfinished);
  }
  RecognitionLimits enough;
  enough.region_time = std::chrono::hours(1);
  EXPECT_EQ(recognize.recognize(scene, enough).size(), 2U);
  EXPECT_EQ(recognize.recognize(scene).size(), 2U) << "limits hold for one call";
}

TEST(TouchingObjects, TheRegionsOfAPictureShareItsTime) {
  Recognizer recognize(world().model);
  const cv::Mat scene = touching(1, 55.0, 2, 120.0);
  cv::Mat twice;
  cv::vconcat(scene, scene, twice);
  ASSERT_EQ(recognize.recognize(twice).size(), 4U) << "two regions of two objects";
  RecognitionLimits limits;
  limits.frame_time = Duration::zero();
  const auto outcomes = recognize.recognize(twice, limits);
  ASSERT_EQ(outcomes.size(), 2U);
  for (const Outcome& outcome : outcomes) EXPECT_TRUE(outcome.unfinished);
  limits.frame_time = std::chrono::hours(1);
  EXPECT_EQ(recognize.recognize(twice, limits).size(), 4U);
  limits.region_time = Duration::zero();
  EXPECT_EQ(recognize.recognize(twice, limits).size(), 2U) << "a region has no more than its own time";
}

TEST(TouchingObjects, AreNotReportedWithoutEnoughEvidence) {
  const cv::Mat scene = touching(1, 55.0, 2, 120.0);
  Recognizer usual(world().model);
  ASSERT_EQ(usual.recognize(scene).size(), 2U);
  Recognizer strict(world().deciding([](DecisionModel& decision) {
    decision.required = decision.required_occluded = decision.settled = 1e6;
  }));
  const auto outcomes = strict.recognize(scene);
  ASSERT_EQ(outcomes.size(), 1U);
  EXPECT_EQ(outcomes[0].verdict, Verdict::unknown);
}

TEST(TouchingObjects, AreReportedUpToAQuarterOccludedOnly) {
  // The second stands before the first, nearer and nearer; whatever is found has enough evidence.
  Recognizer recognize(world().deciding(
      [](DecisionModel& decision) { decision.required = decision.required_occluded = -1e6; }));
  const SceneKnobs behind = PartsWorld::knobs();
  int split = 0;
  for (const double angle : {5.0, 185.0})
    for (const double beside : {30.0, 70.0}) {
      SceneKnobs before = behind;
      before.x += beside;
      cv::Mat scene = testing::scene_with(1, angle, behind);
      testing::draw_object(scene, 2, angle + 65.0, before);
      const auto outcomes = recognize.recognize(scene);
      if (outcomes.size() < 2) continue;
      for (const Outcome& outcome : outcomes) {
        if (!outcome.best) continue;
        ++split;
        EXPECT_LE(outcome.covered_share, 0.25) << outcome.best->object << " at " << angle << ", " << beside;
      }
    }
  EXPECT_GT(split, 0);
}

TEST(TouchingObjects, AreLookedForWhereARegionIsWiderOrHigherThanTheObjectWasLearned) {
  // Whoever is not allowed to look says that the search is unfinished.
  std::stop_source source;
  source.request_stop();
  RecognitionLimits stopped;
  stopped.stop = source.get_token();
  const cv::Mat scene = testing::scene_with(1, 20.0, PartsWorld::knobs());
  const cv::Rect box = only_box(scene);
  const std::size_t one = world().index_of("one");
  const auto looked_for = [&](double width, double height) {
    Recognizer recognize(world().changed([&](PartsModel& parts) {
      for (cv::Size& size : parts.extents[one])
        size = {cvRound(box.width / width), cvRound(box.height / height)};
    }));
    const auto outcomes = recognize.recognize(scene, stopped);
    EXPECT_EQ(outcomes.size(), 1U);
    EXPECT_EQ(outcomes[0].best->object, "one");
    return outcomes[0].unfinished;
  };
  ASSERT_LT(box.height, 1.25 * box.width) << "or its height is too large for its width";
  ASSERT_LT(box.width, 1.25 * box.height);
  EXPECT_FALSE(looked_for(1.0, 1.0));
  EXPECT_FALSE(looked_for(1.2, 1.2));
  EXPECT_TRUE(looked_for(1.4, 1.0));
  EXPECT_TRUE(looked_for(1.0, 1.4));
}

TEST(TouchingObjects, DoNotReplaceAKnownObjectUnlessTheyExplainItsRegion) {
  // The object was learned half as large, so that its region may hold two; it is one all the same.
  const std::size_t one = world().index_of("one");
  auto changed = std::make_shared<Model>(*world().changed([&](PartsModel& parts) {
    for (cv::Size& size : parts.extents[one]) size = {size.width * 2 / 3, size.height * 2 / 3};
  }));
  changed->decision.required = changed->decision.required_occluded =
      -1e6;  // whatever is found has enough evidence
  Recognizer recognize(changed);
  for (double angle = 5.0; angle < 360.0; angle += 60.0) {
    const auto outcomes = recognize.recognize(testing::scene_with(1, angle, PartsWorld::knobs()));
    bool unknown = false;
    for (const Outcome& outcome : outcomes) unknown = unknown || outcome.verdict == Verdict::unknown;
    EXPECT_FALSE(unknown) << "a part of the object is called unknown at " << angle;
  }
}

}  // namespace
}  // namespace eigenpose
