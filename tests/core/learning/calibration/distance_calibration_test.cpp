#include "core/learning/calibration/distance_calibration.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/learning/calibration/cross_validation.h"
#include "core/learning/learning.h"
#include "core/search/search.h"
#include "tests/support/learned_world.h"
#include "tests/support/serial_progress.h"

namespace eigenpose {
namespace {

/// The learned world's views, and what learning made of them.
struct World {
  World()
      : model(*testing::learned_world().model),
        training(all_views(testing::learned_world().sets)),
        views(training, {model.normalization, 1, 0, {}}, {}, {}),
        points(project_all(views, model.eigenspace, 1)) {
    for (const ModelObject& object : model.objects) manifolds.push_back(object.manifold);
  }
  [[nodiscard]] std::vector<RejectionEvidence> measure(const RejectionOptions& options) const {
    return measure_rejection(learned(), options, {}, {});
  }
  [[nodiscard]] LearnedManifolds learned() const { return {views, model.eigenspace, points, manifolds}; }
  const Model& model;
  std::vector<TrainingSet> training;
  TrainingViews views;
  Eigen::MatrixXd points;
  std::vector<Manifold> manifolds;
};

const World& world() {
  static const World made;
  return made;
}

TEST(DistanceCalibration, GivesTheThresholdsOfTheLearnedModel) {
  const auto found = world().measure({});
  ASSERT_EQ(found.size(), world().model.objects.size());
  for (std::size_t o = 0; o < found.size(); ++o) {
    EXPECT_EQ(found[o].rejection_distance, world().model.objects[o].rejection_distance);
    EXPECT_EQ(found[o].typical_distance, world().model.objects[o].typical_distance);
    EXPECT_GT(found[o].rejection_distance, found[o].typical_distance);
  }
}

TEST(DistanceCalibration, DoesNotDependOnThreads) {
  RejectionOptions options;
  options.threads = 3;
  const auto several = world().measure(options);
  const auto one = world().measure({});
  for (std::size_t o = 0; o < one.size(); ++o)
    EXPECT_EQ(several[o].rejection_distance, one[o].rejection_distance);
}

TEST(DistanceCalibration, IsTheQuantileTimesTheSlack) {
  RejectionOptions plain;
  plain.slack = 1.0;
  RejectionOptions slack = plain;
  slack.slack = 1.5;
  RejectionOptions all = plain;
  all.accepted_share = 1.0;
  RejectionOptions half = plain;
  half.accepted_share = 0.5;
  const auto p = world().measure(plain);
  const auto s = world().measure(slack);
  const auto a = world().measure(all);
  const auto h = world().measure(half);
  for (std::size_t o = 0; o < p.size(); ++o) {
    EXPECT_DOUBLE_EQ(s[o].rejection_distance, 1.5 * p[o].rejection_distance);
    EXPECT_GE(a[o].rejection_distance, p[o].rejection_distance);
    EXPECT_LT(h[o].rejection_distance, p[o].rejection_distance);
    EXPECT_LT(h[o].rejection_distance, a[o].typical_distance * 1.5);
  }
}

TEST(DistanceCalibration, GrowsWithThePerturbation) {
  RejectionOptions none;
  none.perturbation = {};
  RejectionOptions strong;
  strong.perturbation = {.shift = 0.06, .scale = 0.1, .turn_deg = 6.0};
  const auto still = world().measure(none);
  const auto usual = world().measure({});
  const auto moved = world().measure(strong);
  for (std::size_t o = 0; o < still.size(); ++o) {
    EXPECT_LT(still[o].rejection_distance, usual[o].rejection_distance);
    EXPECT_LT(usual[o].rejection_distance, moved[o].rejection_distance);
  }
}

TEST(DistanceCalibration, FindsTheDofOfARoundObjectNotObservable) {
  const auto found = world().measure({});
  for (std::size_t o = 0; o < found.size(); ++o) {
    ASSERT_EQ(found[o].dof_observable.size(), 1U);
    EXPECT_EQ(found[o].dof_observable[0], world().model.objects[o].name != "round");
    EXPECT_EQ(found[o].left_out_errors[0].size(), 24U) << "each view is left out once";
  }
}

TEST(DistanceCalibration, RefusesOptionsOutOfRangeAndEndsWhenAskedTo) {
  RejectionOptions options;
  options.copies = 0;
  EXPECT_THROW(world().measure(options), std::invalid_argument);
  options = {};
  options.accepted_share = 0.0;
  EXPECT_THROW(world().measure(options), std::invalid_argument);
  options.accepted_share = 1.01;
  EXPECT_THROW(world().measure(options), std::invalid_argument);
  std::stop_source source;
  source.request_stop();
  EXPECT_THROW(measure_rejection(world().learned(), {}, {}, source.get_token()), Interrupted);
}

TEST(DistanceCalibration, ReportsProgressOneCallAtATime) {
  test::SerialProgress heard;
  RejectionOptions options;
  options.threads = 4;
  measure_rejection(world().learned(), options, heard.listener(), {});
  heard.expect_complete();
}

/// An object on a grid of closed × open values.
ObjectViews grid_object(std::size_t closed, std::size_t open) {
  ObjectViews object;
  SampleAxis turn{{"table", "deg", 0.0, 360.0, true}, {}};
  for (std::size_t i = 0; i < closed; ++i)
    turn.samples.push_back(360.0 * static_cast<double>(i) / static_cast<double>(closed));
  SampleAxis line{{"x", "mm", 0.0, 10.0, false}, {}};
  for (std::size_t i = 0; i < open; ++i)
    line.samples.push_back(10.0 * static_cast<double>(i) / static_cast<double>(open - 1));
  object.axes = {turn, line};
  object.count = closed * open;
  return object;
}

TEST(CrossValidation, LeavesOutEverySecondValueOfATurnInTurn) {
  const ObjectViews object = grid_object(8, 5);
  const auto folds = make_folds(object, 0);
  ASSERT_EQ(folds.size(), 2U);
  std::vector<int> left(object.count, 0);
  for (const Fold& fold : folds) {
    EXPECT_EQ(fold.axes[0].samples.size(), 4U);
    EXPECT_EQ(fold.axes[1].samples.size(), 5U);
    EXPECT_EQ(fold.kept.size() + fold.left_out.size(), object.count);
    for (std::size_t i = 0; i < fold.left_out.size(); ++i) {
      const auto cell = static_cast<std::size_t>(fold.left_out[i]);
      ++left[cell];
      EXPECT_DOUBLE_EQ(fold.left_out_values[i], object.axes[0].samples[cell / 5]);
    }
  }
  for (const int times : left) EXPECT_EQ(times, 1);
}

TEST(CrossValidation, KeepsTheEndsOfAnOpenDof) {
  const ObjectViews object = grid_object(8, 5);
  for (const Fold& fold : make_folds(object, 1)) {
    EXPECT_DOUBLE_EQ(fold.axes[1].samples.front(), 0.0);
    EXPECT_DOUBLE_EQ(fold.axes[1].samples.back(), 10.0);
    for (const double value : fold.left_out_values) EXPECT_TRUE(value > 0.0 && value < 10.0);
  }
}

TEST(CrossValidation, NeedsSixValuesOfATurnAndFiveOfAnOpenDof) {
  EXPECT_TRUE(make_folds(grid_object(5, 5), 0).empty());
  EXPECT_FALSE(make_folds(grid_object(6, 5), 0).empty());
  EXPECT_TRUE(make_folds(grid_object(6, 4), 1).empty());
  EXPECT_FALSE(make_folds(grid_object(6, 5), 1).empty());
}

TEST(CrossValidation, FindsLeftOutViewsOfASmoothTurnAtTheirValue) {
  ObjectViews object = grid_object(24, 5);
  object.axes.pop_back();
  object.count = 24;
  // A circle: half the views already show all of it.
  const auto errors = left_out_errors(object, 0, 2, [&](const Fold& fold) {
    const auto points = [&](const std::vector<Eigen::Index>& cells) {
      Eigen::MatrixXd result(2, static_cast<Eigen::Index>(cells.size()));
      for (std::size_t i = 0; i < cells.size(); ++i) {
        const double angle = object.axes[0].samples[static_cast<std::size_t>(cells[i])] * M_PI / 180.0;
        result.col(static_cast<Eigen::Index>(i)) << std::cos(angle), std::sin(angle);
      }
      return result;
    };
    return FoldPoints{points(fold.kept), points(fold.left_out)};
  });
  ASSERT_EQ(errors.size(), 24U);
  for (const double error : errors) EXPECT_LT(error, 0.5) << "degrees; the step is 15";
}

}  // namespace
}  // namespace eigenpose
