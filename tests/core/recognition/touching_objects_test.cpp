// Objects that touch: told apart by their learned sizes.
#include <cmath>

#include <gmock/gmock.h>

#include "core/base/angle.h"
#include "core/recognition/recognizer.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using testing::SceneKnobs;

/// Three objects with windows, learned from scenes by a camera that stands still.
struct PartsWorld {
  PartsWorld() {
    testing::write_turn(folder.path(), "one", 1, 36, knobs());
    testing::write_turn(folder.path(), "two", 2, 36, knobs());
    testing::write_turn(folder.path(), "three", 3, 36, knobs());
    sets = open_image_sets(folder.path());
    LearningOptions options = testing::small_learning();
    options.normalization.size = 64;
    options.parts = true;
    model = std::make_shared<const Model>(learn(all_views(sets), options));
  }
  static SceneKnobs knobs() {
    SceneKnobs knobs = SceneKnobs::centred(400, 300, 1.6);
    knobs.x = 130.0;  // there is room for another beside it
    return knobs;
  }
  test::TemporaryFolder folder;
  std::vector<ImageSet> sets;
  std::shared_ptr<const Model> model;
};

const PartsWorld& world() {
  static const PartsWorld made;
  return made;
}

/// Two objects side by side, moved together until they are one region.
cv::Mat touching(int left, double left_angle, int right, double right_angle, Recognizer& recognize) {
  SceneKnobs a = PartsWorld::knobs();
  SceneKnobs b = a;
  for (b.x = a.x + 160.0;; b.x -= 2.0) {
    cv::Mat scene = testing::scene_with(left, left_angle, a);
    testing::draw_object(scene, right, right_angle, b);
    Segmenter segmenter(recognize.model().normalization.segmentation);
    if (segmenter.segment(scene).size() < 2) return scene;
  }
}

TEST(TouchingObjects, TellsTouchingObjectsApart) {
  Recognizer recognize(world().model);
  int right = 0;
  int pairs = 0;
  for (double angle = 5.0; angle < 360.0; angle += 50.0) {
    ++pairs;
    const auto outcomes = recognize.recognize(touching(1, angle, 2, angle + 65.0, recognize));
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

TEST(PartsStage, IsLessSureTheMoreIsCovered) {
  Recognizer recognize(world().model);
  double last = 1.0;
  double least = 1.0;
  for (const double hidden : {0.0, 0.15, 0.3}) {
    double sum = 0.0;
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
        if (outcome.verdict != Verdict::recognized) continue;
        EXPECT_EQ(outcome.best->object, "one");
        sum += outcome.confidence;
        least = std::min(least, outcome.confidence);
        ++told;
      }
    }
    ASSERT_GT(told, 0) << hidden;
    EXPECT_LT(sum / told, last + 1e-9) << hidden;
    last = sum / told;
  }
  EXPECT_GT(least, 0.0);
  EXPECT_LT(last, 0.9);
}

TEST(TouchingObjects, DoesWithoutTheSizesOfObjectsThatCameReadyCut) {
  Model model = *world().model;
  auto parts = std::make_shared<PartsModel>(*model.parts);
  ASSERT_EQ(model.objects[1].name, "three");
  for (cv::Size& size : parts->extents[1]) size = {};
  model.parts = parts;
  Recognizer recognize(std::make_shared<const Model>(model));
  const cv::Mat scene = touching(1, 5.0, 2, 70.0, recognize);
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

TEST(TouchingObjects, LeavesStrangersInOnePiece) {
  Recognizer recognize(world().model);
  int taken_apart = 0;
  for (int kind = 20; kind < 32; ++kind) {
    SceneKnobs knobs = PartsWorld::knobs();
    knobs.scale = 2.4;  // large enough for two
    const auto outcomes = recognize.recognize(testing::scene_with(kind, 30.0 * kind, knobs));
    if (outcomes.size() == 1U)
      EXPECT_EQ(outcomes[0].verdict, Verdict::unknown);
    else
      ++taken_apart;
  }
  EXPECT_LE(taken_apart, 1) << "of 12; made-up objects are much alike";
}

TEST(TouchingObjects, AKnownObjectIsToldBesideAStranger) {
  Recognizer recognize(world().model);
  int told = 0;
  int shown = 0;
  for (double angle = 5.0; angle < 360.0; angle += 45.0) {
    ++shown;
    bool known = false;
    bool stranger = false;
    for (const Outcome& outcome : recognize.recognize(touching(1, angle, 25, 40.0, recognize))) {
      stranger = stranger || outcome.verdict == Verdict::unknown;
      if (outcome.verdict != Verdict::recognized) continue;
      known = true;
      EXPECT_EQ(outcome.best->object, "one");
      EXPECT_LT(std::abs(circular_difference(outcome.best->q[0], angle, 360.0)), 15.0);
    }
    EXPECT_TRUE(stranger) << angle;
    told += known ? 1 : 0;
  }
  EXPECT_GE(told, shown / 2) << "of " << shown;
}

}  // namespace
}  // namespace eigenpose
