#include "core/evaluation/evaluation.h"

#include <cmath>
#include <cstdlib>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "core/dataset/coil_import.h"
#include "core/dataset/image_set.h"
#include "core/learning/calibration/decision_calibration.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(SplitViews, LearnsEveryKthFromTheOffset) {
  const ImageSet& set = testing::learned_world().sets.front();
  const ViewSplit split = split_views(set, 4, 1);
  EXPECT_THAT(split.learned, ElementsAre(1, 5, 9, 13, 17, 21));
  EXPECT_EQ(split.tested.size(), 18U);
  EXPECT_THROW(split_views(set, 1, 0), std::invalid_argument);
  EXPECT_THROW(split_views(set, 4, 4), std::invalid_argument);
}

TEST(SummarizeErrors, GivesMeanMedianPercentileAndGrossRate) {
  const auto errors = summarize_errors({1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 100.0});
  EXPECT_DOUBLE_EQ(errors.mean, 14.5);
  EXPECT_DOUBLE_EQ(errors.median, 5.5);
  EXPECT_DOUBLE_EQ(errors.p90, 9.0);
  EXPECT_DOUBLE_EQ(errors.gross_rate, 0.1);
  EXPECT_DOUBLE_EQ(summarize_errors({}).mean, 0.0);
}

EvaluationOptions small_evaluation() {
  EvaluationOptions options;
  options.learn_every = 2;
  options.learning = testing::small_learning();
  return options;
}

TEST(Evaluation, RecordsEveryTestViewAndCountsTheRecords) {
  const auto& world = testing::learned_world();
  const EvaluationReport report = evaluate(world.sets, small_evaluation());
  EXPECT_EQ(report.learning.views, 48U);
  ASSERT_EQ(report.records.size(), 48U);
  EXPECT_EQ(report.counts.known, 48U);
  EXPECT_EQ(report.counts.unknown, 0U);
  EXPECT_GE(report.recognition_rate(), 0.9) << "30 degrees between learned views";
  EXPECT_EQ(report.counts.answered_right + report.counts.answered_wrong + report.counts.withheld, 48U);
  std::size_t right = 0;
  for (std::size_t o = 0; o < report.objects.size(); ++o) {
    const ObjectEvaluation& object = report.objects[o];
    EXPECT_EQ(object.object, world.sets[o].object());
    EXPECT_EQ(object.counts.known, 12U);
    EXPECT_EQ(object.counts.best_right, object.pose_errors.size());
    right += object.counts.best_right;
  }
  EXPECT_EQ(right, report.counts.best_right);
  for (const RegionRecord& record : report.records) {
    const ImageSet& set = world.sets[record.object];
    EXPECT_TRUE(record.known);
    EXPECT_EQ(record.view % 2, 1U);
    EXPECT_EQ(record.true_q, set.views()[record.view].q);
    ASSERT_TRUE(record.said.has_value());
    if (record.answered()) {
      EXPECT_GT(record.confidence, 0.0);
    }
    ASSERT_EQ(record.pose_error.has_value(), record.best_is_right());
    if (record.pose_error) {
      EXPECT_EQ(*record.pose_error,
                std::abs(set.workspace()[0].difference(record.said_q[0], record.true_q[0])));
    }
  }
}

TEST(Evaluation, GivesTheErrorOfASecondPoseToo) {
  // Of an object that looks the same from all sides every pose has a second one.
  const EvaluationReport report = evaluate(testing::learned_world().sets, small_evaluation());
  std::size_t seconds = 0;
  for (const RegionRecord& record : report.records)
    if (record.other_pose_error) {
      ++seconds;
      EXPECT_TRUE(record.best_is_right());
      EXPECT_GE(*record.other_pose_error, 0.0);
      EXPECT_LE(*record.other_pose_error, 180.0);
    }
  EXPECT_GT(seconds, 0U);
}

TEST(Evaluation, ShowsTheTestViewsToModelsWithoutTheirObjectToo) {
  EvaluationOptions options = small_evaluation();
  options.leave_one_out = true;
  const EvaluationReport report = evaluate(testing::learned_world().sets, options);
  ASSERT_EQ(report.records.size(), 96U);
  EXPECT_EQ(report.counts.known, 48U);
  EXPECT_EQ(report.counts.unknown, 48U);
  for (std::size_t i = 0; i < 48; ++i) {
    const RegionRecord& known = report.records[i];
    const RegionRecord& unknown = report.records[48 + i];
    EXPECT_FALSE(unknown.known);
    EXPECT_EQ(unknown.object, known.object);
    EXPECT_EQ(unknown.view, known.view);
    EXPECT_NE(unknown.said, unknown.object) << "the model does not hold it";
    EXPECT_FALSE(unknown.pose_error.has_value());
  }
  for (const ObjectEvaluation& object : report.objects) EXPECT_EQ(object.counts.unknown, 12U);
}

/// The model with object `o` erased, member by member.
std::shared_ptr<const Model> model_without(const Model& whole, std::size_t o,
                                           const LearningReport& learning) {
  auto rest = std::make_shared<Model>(whole);
  rest->decision = calibrate_decision(learning.probes, whole.decision.set, o);
  rest->objects.clear();
  PartsModel parts = *whole.parts;
  parts.objects.clear();
  parts.poses.clear();
  parts.calibration.clear();
  parts.view_poses.clear();
  parts.extents.clear();
  parts.colors.clear();
  for (std::size_t k = 0; k < whole.objects.size(); ++k) {
    if (k == o) continue;
    rest->objects.push_back(whole.objects[k]);
    parts.objects.push_back(whole.parts->objects[k]);
    parts.poses.push_back(whole.parts->poses[k]);
    parts.calibration.push_back(whole.parts->calibration[k]);
    parts.view_poses.push_back(whole.parts->view_poses[k]);
    parts.extents.push_back(whole.parts->extents[k]);
    parts.colors.push_back(whole.parts->colors[k]);
  }
  rest->parts = std::make_shared<const PartsModel>(std::move(parts));
  return rest;
}

TEST(Evaluation, RefusesWhatTheSetsCannotShowBeforeItLearns) {
  const test::TemporaryFolder folder;
  ImageSetWriter writer(folder.path(), "cut", turntable_workspace(), nlohmann::json::object(),
                        {.cropped = true, .sync_every_view = false});
  for (int i = 0; i < 6; ++i)
    writer.add(testing::scene_with(2, 60.0 * i)(cv::Rect(40, 20, 80, 80)), {60.0 * i});
  writer.finish();
  const auto sets = open_image_sets(folder.path());
  const auto refusal = [&](const EvaluationOptions& options) {
    try {
      (void)evaluate(sets, options, [](const ProgressUpdate&) { ADD_FAILURE() << "has begun"; });
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EvaluationOptions options = small_evaluation();
  options.scenes.count = 1;
  EXPECT_THAT(refusal(options), HasSubstr("cropped"));
  options.scenes.count = 0;
  options.leave_one_out = true;
  EXPECT_THAT(refusal(options), HasSubstr("two objects"));
}

TEST(Evaluation, TakesAllOfAnObjectOutOfTheModelThatDoesNotHoldIt) {
  const test::TemporaryFolder folder;
  testing::write_turn(folder.path(), "a", 1, 8);
  testing::write_turn(folder.path(), "b", 2, 8);
  const auto sets = open_image_sets(folder.path());
  EvaluationOptions options = small_evaluation();
  options.learning.normalization.size = 64;
  options.learning.parts = true;
  options.leave_one_out = true;
  const EvaluationReport report = evaluate(sets, options);
  std::vector<TrainingSet> training;
  training.reserve(sets.size());
  for (const ImageSet& set : sets) training.push_back({&set, split_views(set, 2, 0).learned});
  LearningReport learning;
  const Model whole = learn(training, options.learning, &learning);
  ASSERT_NE(whole.parts->calibration[0].typical_votes, whole.parts->calibration[1].typical_votes);
  ASSERT_EQ(report.records.size(), 16U);
  for (std::size_t i = 8; i < 16; ++i) {
    const RegionRecord& record = report.records[i];
    Recognizer recognize(model_without(whole, record.object, learning));
    const auto outcomes = recognize.recognize(sets[record.object].load(record.view));
    ASSERT_EQ(outcomes.size(), 1U);
    EXPECT_EQ(record.evidence, outcomes[0].evidence) << i;
    EXPECT_EQ(record.required_evidence, outcomes[0].required_evidence);
    EXPECT_EQ(record.verdict, outcomes[0].verdict);
  }
}

TEST(Damaged, IsAnotherPictureForEachViewAndSeedAndTheSameAgain) {
  cv::Mat picture(96, 128, CV_8UC3);
  cv::RNG(3).fill(picture, cv::RNG::UNIFORM, 0, 255);
  const auto differ = [](const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) > 0.0; };
  EXPECT_FALSE(differ(damaged(picture, {}, 4), picture));
  for (const TestDamage& damage : {TestDamage{.shift = 4.0}, TestDamage{.scale = 0.1},
                                   TestDamage{.rotation_deg = 10.0}, TestDamage{.occlusion = 0.2}}) {
    TestDamage other = damage;
    other.seed = 2;
    EXPECT_TRUE(differ(damaged(picture, damage, 4), picture));
    EXPECT_FALSE(differ(damaged(picture, damage, 4), damaged(picture, damage, 4)));
    EXPECT_TRUE(differ(damaged(picture, damage, 4), damaged(picture, damage, 5)));
    EXPECT_TRUE(differ(damaged(picture, damage, 4), damaged(picture, other, 4)));
  }
}

TEST(Evaluation, DamagesTheViewsOfUnknownObjectsAsThoseOfKnownOnes) {
  EvaluationOptions options = small_evaluation();
  options.leave_one_out = true;
  const auto said_of_unknown = [&](const TestDamage& damage) {
    options.damage = damage;
    const EvaluationReport report = evaluate(testing::learned_world().sets, options);
    std::vector<std::vector<double>> poses;
    for (const RegionRecord& record : report.records)
      if (!record.known) poses.push_back(record.said_q);
    return poses;
  };
  const auto plain = said_of_unknown({});
  const auto changed = [&](const TestDamage& damage) {
    const auto now = said_of_unknown(damage);
    std::size_t count = 0;
    for (std::size_t i = 0; i < plain.size(); ++i) count += now.at(i) != plain[i] ? 1 : 0;
    return count;
  };
  EXPECT_EQ(changed({}), 0U);
  EXPECT_GT(changed({.occlusion = 0.3}), 12U);
  EXPECT_GT(changed({.rotation_deg = 10.0}), 12U);
}

TEST(Evaluation, ReachesThePublishedFiguresOnCoil20) {
  const char* datasets = std::getenv("EIGENPOSE_DATASETS");
  if (datasets == nullptr || !std::filesystem::exists(std::filesystem::path(datasets) / "coil-20"))
    GTEST_SKIP()
        << "missed: recognition and pose on COIL-20; set EIGENPOSE_DATASETS to a folder with coil-20";
  const test::TemporaryFolder folder;
  const ImportReport imported =
      import_coil(std::filesystem::path(datasets) / "coil-20", folder.path(), {.angle = {5.0}});
  ASSERT_EQ(imported.sets.size(), 20U);
  EXPECT_TRUE(imported.cropped);
  EvaluationOptions options;
  options.learn_every = 2;
  options.learning.normalization.size = 128;
  options.learning.normalization.color = false;
  options.learning.solver.components = 20;
  options.learning.parts = false;
  const EvaluationReport report = evaluate(open_image_sets(folder.path()), options);
  EXPECT_EQ(report.counts.known, 720U);
  EXPECT_EQ(report.recognition_rate(), 1.0);
  EXPECT_LE(report.pose_errors().mean, 1.28);  // the plain method in the universal eigenspace alone
  EXPECT_EQ(report.pose_errors().gross_rate, 0.0);
}

}  // namespace
}  // namespace eigenpose
