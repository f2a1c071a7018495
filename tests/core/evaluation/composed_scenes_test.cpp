// Scenes whose truth is known, and what is counted of them.
#include "core/evaluation/composed_scenes.h"

#include <algorithm>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "core/evaluation/evaluation.h"
#include "core/image/foreground.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using testing::learned_world;

std::vector<SetView> every_view() {
  std::vector<SetView> views;
  for (std::size_t s = 0; s < learned_world().sets.size(); ++s)
    for (std::size_t v = 0; v < learned_world().sets[s].views().size(); ++v) views.push_back({s, v});
  return views;
}

TEST(ComposedScenes, ObjectsStandApartUnlessAskedToTouch) {
  const auto views = every_view();
  SceneComposer apart(learned_world().sets, views, {}, {});
  SceneComposer touching(learned_world().sets, views, {.overlap = 0.2}, {});
  Segmenter segmenter;
  for (std::size_t i = 0; i < 20; ++i) {
    const ComposedScene scattered = apart.compose(i);
    ASSERT_GE(scattered.objects.size(), 2U);
    ASSERT_LE(scattered.objects.size(), 4U);
    EXPECT_EQ(segmenter.segment(scattered.picture).size(), scattered.objects.size());
    const ComposedScene fused = touching.compose(i);
    ASSERT_EQ(fused.objects.size(), scattered.objects.size());
    EXPECT_EQ(segmenter.segment(fused.picture).size(), 1U);
  }
}

/// The filled outline of the object in a view.
cv::Mat mask_of(const SetView& shown) {
  Segmenter segmenter;
  const cv::Mat image = learned_world().sets[shown.set].load(shown.view);
  const auto regions = segmenter.segment(image);
  const auto largest = std::ranges::max_element(regions, {}, [](const Region& r) { return r.box.area(); });
  const cv::Mat cut = segmenter.cut_out(image, static_cast<std::size_t>(largest - regions.begin()));
  cv::Mat mask = foreground_of(cut, segmenter.background());
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(mask, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(mask, outlines, -1, cv::Scalar::all(255), cv::FILLED);
  return mask;
}

TEST(ComposedScenes, HideNoMoreOfAnObjectThanAskedForHoweverManyStandBeforeIt) {
  constexpr double overlap = 0.2;
  const auto views = every_view();
  SceneComposer composer(learned_world().sets, views, {.overlap = overlap}, {});
  double most = 0.0;
  for (std::size_t s = 0; s < 60; ++s) {
    const ComposedScene scene = composer.compose(s);
    std::vector<cv::Mat> masks;  // of the frame
    for (const ComposedScene::Placed& placed : scene.objects) {
      masks.push_back(cv::Mat::zeros(scene.picture.size(), CV_8U));
      mask_of(placed.shown).copyTo(masks.back()(placed.box));
    }
    for (std::size_t i = 0; i < masks.size(); ++i) {
      cv::Mat before = cv::Mat::zeros(scene.picture.size(), CV_8U);
      for (std::size_t k = i + 1; k < masks.size(); ++k) before |= masks[k];
      const double share =
          cv::countNonZero(before & masks[i]) / static_cast<double>(cv::countNonZero(masks[i]));
      EXPECT_LE(share, overlap) << "object " << i << " of scene " << s;
      most = std::max(most, share);
    }
  }
  EXPECT_GT(most, 0.1) << "or the bound is never near";
}

TEST(ComposedScenes, TellWhereEachObjectStands) {
  const auto views = every_view();
  SceneComposer composer(learned_world().sets, views, {}, {});
  Segmenter segmenter;
  const ComposedScene scene = composer.compose(3);
  const auto regions = segmenter.segment(scene.picture);
  for (const ComposedScene::Placed& placed : scene.objects) {
    const bool seen = std::ranges::any_of(regions, [&](const Region& region) {
      return (region.box & placed.box).area() >= 0.9 * placed.box.area();
    });
    EXPECT_TRUE(seen);
  }
}

TEST(ComposedScenes, AreTheSameAgainAndDifferBySeed) {
  const auto views = every_view();
  SceneComposer first(learned_world().sets, views, {.overlap = 0.1, .seed = 5}, {});
  SceneComposer again(learned_world().sets, views, {.overlap = 0.1, .seed = 5}, {});
  SceneComposer other(learned_world().sets, views, {.overlap = 0.1, .seed = 6}, {});
  first.compose(1);  // what came before does not matter
  const cv::Mat picture = first.compose(2).picture;
  const cv::Mat same = again.compose(2).picture;
  ASSERT_EQ(picture.size(), same.size());
  EXPECT_EQ(cv::norm(picture, same, cv::NORM_INF), 0.0);
  const cv::Mat different = other.compose(2).picture;
  EXPECT_TRUE(different.size() != picture.size() || cv::norm(picture, different, cv::NORM_INF) > 0.0);
}

TEST(ComposedScenes, RefuseWhatCannotBeComposed) {
  const auto views = every_view();
  EXPECT_THROW(SceneComposer(learned_world().sets, {}, {}, {}), std::invalid_argument);
  EXPECT_THROW(SceneComposer(learned_world().sets, views, {.overlap = 1.5}, {}), std::invalid_argument);
}

TEST(ComposedScenes, AreCountedByTheirTruth) {
  const ImageSet& set = learned_world().sets[0];
  ComposedScene scene;
  for (const int x : {10, 100, 200}) scene.objects.push_back({{0, 0}, {x, 10, 50, 50}});
  const auto said = [&](const cv::Rect& box, const std::string& object, Verdict verdict) {
    Outcome outcome;
    outcome.box = box;
    outcome.verdict = verdict;
    outcome.best = {object, {set.views()[0].q[0] + 4.0}, 0.1};
    return outcome;
  };
  const std::vector<Outcome> outcomes = {
      said({12, 12, 50, 50}, set.object(), Verdict::recognized),
      said({100, 10, 50, 50}, set.object(), Verdict::unknown),
      said({230, 40, 50, 50}, set.object(), Verdict::recognized),  // beside it
      said({300, 300, 20, 20}, "another", Verdict::recognized),
  };
  SceneReport report;
  count_scene(scene, learned_world().sets, outcomes, report);
  EXPECT_EQ(report.scenes, 1U);
  EXPECT_EQ(report.objects, 3U);
  EXPECT_EQ(report.found, 2U);
  EXPECT_EQ(report.right, 2U);
  EXPECT_EQ(report.recognized, 1U);
  EXPECT_EQ(report.extra, 2U);
  ASSERT_EQ(report.pose_errors.size(), 2U);
  EXPECT_NEAR(report.pose_errors[0], 4.0, 1e-9);
}

TEST(ComposedScenes, CountARegionForOneObjectAlone) {
  // Two objects, one almost behind the other: they were found as one region.
  const ImageSet& set = learned_world().sets[0];
  ComposedScene scene;
  for (const int x : {10, 14}) scene.objects.push_back({{0, 0}, {x, 10, 50, 50}});
  Outcome outcome;
  outcome.box = {12, 10, 50, 50};
  outcome.verdict = Verdict::recognized;
  outcome.best = {set.object(), {set.views()[0].q[0]}, 0.1};
  SceneReport report;
  count_scene(scene, learned_world().sets, std::span(&outcome, 1), report);
  EXPECT_EQ(report.objects, 2U);
  EXPECT_EQ(report.found, 1U);
  EXPECT_EQ(report.recognized, 1U);
  EXPECT_EQ(report.extra, 0U);
}

TEST(ComposedScenes, AreRecognisedWhereObjectsStandApart) {
  EvaluationOptions options;
  options.learning = testing::small_learning();
  options.scenes.count = 20;
  const EvaluationReport report = evaluate(learned_world().sets, options);
  ASSERT_TRUE(report.scenes);
  EXPECT_EQ(report.scenes->scenes, 20U);
  EXPECT_EQ(report.scenes->found, report.scenes->objects);
  EXPECT_GE(static_cast<double>(report.scenes->right), 0.95 * static_cast<double>(report.scenes->objects));
  EXPECT_EQ(report.scenes->extra, 0U);
}

}  // namespace
}  // namespace eigenpose
