#include "core/recognition/recognizer.h"

#include <cmath>

#include <gmock/gmock.h>
#include <opencv2/imgproc.hpp>

#include "core/base/angle.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using testing::SceneKnobs;

constexpr std::array<const char*, 4> names{"", "one", "two", "three"};

Recognizer recognizer() {
  return Recognizer(testing::learned_world().model);
}

TEST(Recognizer, NamesObjectsAndPosesBetweenTheLearnedOnes) {
  Recognizer recognize = recognizer();
  double worst = 0.0;
  for (int kind = 1; kind <= 3; ++kind)
    for (double angle = 7.5; angle < 360.0; angle += 30.0) {
      const auto outcomes = recognize.recognize(testing::scene_with(kind, angle, {}, 900 + kind));
      ASSERT_EQ(outcomes.size(), 1U);
      ASSERT_EQ(outcomes[0].verdict, Verdict::recognized)
          << names[static_cast<std::size_t>(kind)] << " at " << angle;
      EXPECT_EQ(outcomes[0].best->object, names[static_cast<std::size_t>(kind)]);
      worst = std::max(worst, std::abs(circular_difference(outcomes[0].best->q[0], angle, 360.0)));
      EXPECT_GT(outcomes[0].confidence, 0.5);
    }
  // Half the learned step is 7.5 degrees: halfway between two views is found better than by the nearest view.
  EXPECT_LT(worst, 5.0);
}

TEST(Recognizer, DoesNotCareForPlaceSizeOrBrightness) {
  Recognizer recognize = recognizer();
  SceneKnobs knobs;
  knobs.width = 320;
  knobs.height = 240;
  knobs.x = 200.0;
  knobs.y = 150.0;
  knobs.scale = 1.7;
  knobs.brightness = 0.7;
  knobs.background = 14;
  const auto outcomes = recognize.recognize(testing::scene_with(2, 75.0, knobs));
  ASSERT_EQ(outcomes.size(), 1U);
  EXPECT_EQ(outcomes[0].verdict, Verdict::recognized);
  EXPECT_EQ(outcomes[0].best->object, "two");
  EXPECT_NEAR(outcomes[0].best->q[0], 75.0, 4.0);
}

TEST(Recognizer, SaysUnknownToAnObjectItHasNotLearned) {
  Recognizer recognize = recognizer();
  int unknown = 0;
  int seen = 0;
  for (int kind = 20; kind < 26; ++kind)
    for (double angle = 0.0; angle < 360.0; angle += 60.0) {
      const auto outcomes = recognize.recognize(testing::scene_with(kind, angle));
      ASSERT_EQ(outcomes.size(), 1U);
      ++seen;
      if (outcomes[0].verdict != Verdict::unknown) continue;
      ++unknown;
      ASSERT_TRUE(outcomes[0].best.has_value()) << "the nearest is told as information";
      EXPECT_GT(outcomes[0].best->distance, outcomes[0].rejection_distance);
      EXPECT_EQ(outcomes[0].confidence, 0.0);
    }
  EXPECT_EQ(unknown, seen);
}

TEST(Recognizer, SeesNothingOnAnEmptyTable) {
  Recognizer recognize = recognizer();
  EXPECT_TRUE(recognize.recognize(testing::empty_scene({}, 5)).empty());
}

TEST(Recognizer, SeesSeveralObjectsFromLeftToRight) {
  Recognizer recognize = recognizer();
  SceneKnobs knobs;
  knobs.width = 320;
  cv::Mat scene = testing::empty_scene(knobs, 6);
  testing::draw_object(scene, 3, 200.0, knobs);
  knobs.x = 240.0;
  testing::draw_object(scene, 1, 50.0, knobs);
  const auto outcomes = recognize.recognize(scene);
  ASSERT_EQ(outcomes.size(), 2U);
  EXPECT_EQ(outcomes[0].best->object, "three");
  EXPECT_NEAR(outcomes[0].best->q[0], 200.0, 5.0);
  EXPECT_EQ(outcomes[1].best->object, "one");
  EXPECT_NEAR(outcomes[1].best->q[0], 50.0, 5.0);
}

TEST(Recognizer, TellsThatASymmetricObjectsPoseCannotBeSeen) {
  Recognizer recognize = recognizer();
  const auto outcomes = recognize.recognize(testing::scene_with(testing::symmetric_kind, 33.0));
  ASSERT_EQ(outcomes.size(), 1U);
  EXPECT_EQ(outcomes[0].verdict, Verdict::recognized);
  EXPECT_EQ(outcomes[0].best->object, "round");
  ASSERT_EQ(outcomes[0].q_sigma.size(), 1U);
  EXPECT_TRUE(std::isinf(outcomes[0].q_sigma[0]));
}

TEST(Recognizer, SaysAmbiguousBetweenTwoObjectsThatLookAlike) {
  const test::TemporaryFolder folder;
  testing::write_turn(folder.path(), "left", 1, 24);
  SceneKnobs again;
  again.noise_sigma = 1.2;
  testing::write_turn(folder.path(), "right", 1, 24, again);
  const auto sets = open_image_sets(folder.path());
  Recognizer recognize(std::make_shared<const Model>(learn(all_views(sets), testing::small_learning())));
  const auto outcomes = recognize.recognize(testing::scene_with(1, 100.0, {}, 55));
  ASSERT_EQ(outcomes.size(), 1U);
  EXPECT_EQ(outcomes[0].verdict, Verdict::ambiguous);
  ASSERT_TRUE(outcomes[0].runner_up.has_value());
  EXPECT_NE(outcomes[0].runner_up->object, outcomes[0].best->object);
}

TEST(Recognizer, TellsTwinsApartThatDifferInAFaintMark) {
  // The second is a little redder in the middle.
  const auto scene = [](bool marked, double angle, int seed) {
    cv::Mat picture = testing::scene_with(1, angle, {}, seed);
    cv::Mat tint = cv::Mat::zeros(picture.size(), picture.type());
    if (marked) cv::circle(tint, {80, 60}, 8, cv::Scalar(0, 0, 45), cv::FILLED);
    picture += tint;
    return picture;
  };
  const test::TemporaryFolder folder;
  for (const bool marked : {false, true})
    testing::write_turn(folder.path(), marked ? "marked" : "plain", 36,
                        [&](double angle, int number) { return scene(marked, angle, number); });
  const auto sets = open_image_sets(folder.path());
  LearningOptions options = testing::small_learning();
  options.normalization.size = 64;
  options.parts = true;
  Recognizer recognize(std::make_shared<const Model>(learn(all_views(sets), options)));
  int told = 0;
  for (int i = 0; i < 24; ++i) {
    const bool marked = i % 2 == 1;
    const auto outcomes = recognize.recognize(scene(marked, 15.0 * i + 4.0, 100 + i));
    ASSERT_EQ(outcomes.size(), 1U);
    ASSERT_NE(outcomes[0].verdict, Verdict::unknown) << i;
    if (outcomes[0].verdict != Verdict::recognized) continue;
    EXPECT_EQ(outcomes[0].best->object, marked ? "marked" : "plain") << i;
    ++told;
  }
  EXPECT_GE(told, 22);
}

TEST(Recognizer, DoesNotGuessAtHalfAnObjectOrASpeck) {
  Recognizer recognize = recognizer();
  SceneKnobs knobs;
  knobs.x = 6.0;
  const auto cut = recognize.recognize(testing::scene_with(1, 0.0, knobs));
  ASSERT_EQ(cut.size(), 1U);
  EXPECT_EQ(cut[0].verdict, Verdict::touches_border);
  EXPECT_FALSE(cut[0].best.has_value());
  knobs.x = 80.0;
  knobs.scale = 0.1;
  const auto speck = recognize.recognize(testing::scene_with(1, 0.0, knobs));
  ASSERT_EQ(speck.size(), 1U);
  EXPECT_EQ(speck[0].verdict, Verdict::too_small);
}

TEST(Recognizer, RefusesPicturesTheModelCannotTake) {
  Recognizer recognize = recognizer();
  EXPECT_THROW((void)recognize.recognize(cv::Mat()), std::invalid_argument);
  EXPECT_THROW((void)recognize.recognize(cv::Mat(20, 20, CV_8UC1, cv::Scalar(0))), std::invalid_argument);
  EXPECT_THROW(Recognizer(nullptr), std::invalid_argument);
}

TEST(Recognizer, TellsWhereItsTimeWent) {
  Recognizer recognize = recognizer();
  RecognitionTimes times;
  (void)recognize.recognize(testing::scene_with(1, 10.0), &times);
  EXPECT_GT(times.segment.count(), 0);
  EXPECT_GT(times.search.count(), 0);
  EXPECT_GE(times.total, times.segment + times.normalize + times.project + times.search);
}

TEST(Verdict, HasStableNames) {
  EXPECT_EQ(verdict_name(Verdict::recognized), "recognized");
  EXPECT_EQ(verdict_name(Verdict::touches_border), "touches_border");
}

}  // namespace
}  // namespace eigenpose
