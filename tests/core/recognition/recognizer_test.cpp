#include "core/recognition/recognizer.h"

#include <cmath>
#include <memory>
#include <thread>
#include <vector>

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
      EXPECT_LT(outcomes[0].evidence, outcomes[0].required_evidence);
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
  EXPECT_THROW(Recognizer(std::shared_ptr<const Model>()), std::invalid_argument);
  EXPECT_THROW(Recognizer(std::shared_ptr<const RecognitionIndex>()), std::invalid_argument);
  EXPECT_THROW(RecognitionIndex(std::make_shared<const Model>()), std::invalid_argument);
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

/// A copy of the learned world's model with `change` applied to object "one".
template <typename Change>
std::shared_ptr<const Model> with_changed_one(const Change& change) {
  auto model = std::make_shared<Model>(*testing::learned_world().model);
  for (ModelObject& object : model->objects)
    if (object.name == "one") change(object);
  return model;
}

TEST(Recognizer, MeasuresEachObjectByItsOwnYardstick) {
  // An object whose views usually lie so near that no view does any longer.
  Recognizer recognize(with_changed_one([](ModelObject& one) { one.typical_distance = 1e-9; }));
  for (double angle = 5.0; angle < 360.0; angle += 60.0) {
    const auto refused = recognize.recognize(testing::scene_with(1, angle));
    ASSERT_EQ(refused.size(), 1U);
    EXPECT_EQ(refused[0].verdict, Verdict::unknown);
    EXPECT_EQ(refused[0].best->object, "one") << "the nearest is reported all the same";
    EXPECT_LT(refused[0].evidence, refused[0].required_evidence);
    EXPECT_EQ(recognize.recognize(testing::scene_with(2, angle))[0].verdict, Verdict::recognized);
  }
}

TEST(Recognizer, RecognisersInSeveralThreadsShareOneIndex) {
  const auto index = std::make_shared<const RecognitionIndex>(testing::learned_world().model);
  std::vector<cv::Mat> scenes;
  std::vector<double> evidence;
  Recognizer alone(index);
  for (int i = 0; i < 24; ++i) {
    scenes.push_back(testing::scene_with(1 + i % 3, 15.0 * i, {}, 40 + i));
    evidence.push_back(alone.recognize(scenes.back()).front().evidence);
  }
  std::vector<std::vector<double>> seen(3);
  std::vector<std::jthread> threads;
  for (std::vector<double>& mine : seen)
    threads.emplace_back([&] {
      Recognizer recognize(index);
      for (const cv::Mat& scene : scenes) mine.push_back(recognize.recognize(scene).front().evidence);
    });
  threads.clear();
  for (const auto& mine : seen) EXPECT_EQ(mine, evidence);
}

TEST(Recognizer, CallsARegionTooSmallByItsLargerSide) {
  // The model's pictures have 32 pixels a side: a quarter of that is enough.
  Recognizer recognize = recognizer();
  const auto verdict_of = [&](int width, int height) {
    cv::Mat scene = testing::empty_scene({}, 5);
    cv::rectangle(scene, cv::Rect(70, 50, width, height), cv::Scalar(90, 180, 220), cv::FILLED);
    const auto outcomes = recognize.recognize(scene);
    EXPECT_EQ(outcomes.size(), 1U) << width << " x " << height;
    return outcomes.empty() ? Verdict::unknown : outcomes[0].verdict;
  };
  EXPECT_EQ(verdict_of(6, 6), Verdict::too_small);
  EXPECT_NE(verdict_of(6, 40), Verdict::too_small);
  EXPECT_NE(verdict_of(40, 6), Verdict::too_small);
}

TEST(Recognizer, RefinesThePoseInTheObjectsOwnEigenspaceWithinItsBasinOnly) {
  // The manifold of the object's own eigenspace, turned by whole steps of 15 degrees.
  for (const int steps : {0, 1, 2, 12}) {
    Recognizer recognize(with_changed_one([&](ModelObject& one) {
      ObjectEigenspace& space = *one.space;
      const auto axes = space.manifold.axes();
      const std::size_t count = axes[0].samples.size();
      Eigen::MatrixXd points(space.manifold.dimensions(), static_cast<Eigen::Index>(count));
      for (std::size_t i = 0; i < count; ++i) {
        const double from = axes[0].samples[(i + static_cast<std::size_t>(steps)) % count];
        points.col(static_cast<Eigen::Index>(i)) = space.manifold.evaluate({&from, 1});
      }
      space.manifold = Manifold::interpolate({axes[0]}, points, space.manifold.degree());
      space.better_pose = true;
    }));
    // One step is within the basin of one and a half; more is not.
    const double turned = steps == 1 ? 15.0 : 0.0;
    for (double angle = 20.0; angle < 360.0; angle += 75.0) {
      const auto outcomes = recognize.recognize(testing::scene_with(1, angle));
      ASSERT_EQ(outcomes.size(), 1U);
      EXPECT_LT(std::abs(circular_difference(outcomes[0].best->q[0], angle - turned, 360.0)), 6.0)
          << steps << " steps, at " << angle;
    }
  }
}

TEST(Recognizer, ReportsTheOtherPoseOfAnObjectThatLooksTheSameFromBehind) {
  const test::TemporaryFolder folder;
  testing::write_turn(folder.path(), "twice", 36,
                      [](double angle, int seed) { return testing::scene_with(1, 2.0 * angle, {}, seed); });
  testing::write_turn(folder.path(), "plain", 2, 36);
  const auto sets = open_image_sets(folder.path());
  Recognizer recognize(std::make_shared<const Model>(learn(all_views(sets), testing::small_learning())));
  for (double angle = 4.0; angle < 360.0; angle += 45.0) {
    const auto outcomes = recognize.recognize(testing::scene_with(1, 2.0 * angle, {}, 901));
    ASSERT_EQ(outcomes.size(), 1U);
    ASSERT_TRUE(outcomes[0].other_pose) << angle;
    EXPECT_EQ(outcomes[0].other_pose->object, "twice");
    const double apart = circular_difference(outcomes[0].other_pose->q[0], outcomes[0].best->q[0], 360.0);
    EXPECT_NEAR(std::abs(apart), 180.0, 6.0) << angle;
    EXPECT_FALSE(recognize.recognize(testing::scene_with(2, angle, {}, 902))[0].other_pose) << angle;
  }
}

TEST(Recognizer, GivesTheBoxOfEachRegionInTheFrame) {
  Recognizer recognize = recognizer();
  SceneKnobs knobs;
  knobs.width = 320;
  knobs.x = 240.0;
  knobs.y = 70.0;
  const cv::Mat scene = testing::scene_with(2, 30.0, knobs);
  cv::Mat grey;
  cv::cvtColor(scene, grey, cv::COLOR_BGR2GRAY);
  const cv::Rect truth = cv::boundingRect(grey > 40);
  const auto outcomes = recognize.recognize(scene);
  ASSERT_EQ(outcomes.size(), 1U);
  const cv::Rect both = outcomes[0].box & truth;
  EXPECT_GT(both.area(), 0.8 * (outcomes[0].box.area() + truth.area() - both.area()))
      << outcomes[0].box << " and " << truth;
}

}  // namespace
}  // namespace eigenpose
