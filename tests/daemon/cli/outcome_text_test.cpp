#include "daemon/cli/outcome_text.h"

#include <limits>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/api/json/outcome_json.h"

namespace eigenpose {
namespace {

using cli::outcome_text;
using cli::value_text;
using nlohmann::json;

/// An object of these DOFs; its manifold is a straight line.
ModelObject object_of(const std::string& name, const std::vector<Dof>& dofs, std::vector<bool> observable) {
  std::vector<SampleAxis> axes;
  Eigen::Index points = 1;
  for (const Dof& dof : dofs) {
    axes.push_back({dof, {0.0, 25.0, 50.0, 75.0}});
    points *= 4;
  }
  ModelObject object{name, Workspace(dofs), Manifold::interpolate(axes, Eigen::MatrixXd::Zero(2, points), 1)};
  object.dof_observable = std::move(observable);
  return object;
}

Model model_of_three() {
  const Dof table{"table", "deg", 0.0, 360.0, true};
  Model model;
  model.objects.push_back(object_of("duck", {table}, {true}));
  model.objects.push_back(object_of("bottle", {table}, {false}));
  model.objects.push_back(
      object_of("stage", {{"x", "mm", 0.0, 100.0, false}, {"arm", "deg", 0.0, 360.0, true}}, {true, true}));
  return model;
}

Outcome recognized(const std::string& object, std::vector<double> q, std::vector<double> sigma) {
  Outcome outcome;
  outcome.verdict = Verdict::recognized;
  outcome.best = Hypothesis{object, std::move(q), 0.234};
  outcome.q_sigma = std::move(sigma);
  outcome.evidence = 4.24;
  outcome.required_evidence = 0.81;
  outcome.confidence = 0.37;
  return outcome;
}

std::string text_of(const Outcome& outcome) {
  return outcome_text(outcome_json(outcome, model_of_three()));
}

TEST(OutcomeText, PrintsARecognisedObjectWithPoseAndUncertainty) {
  EXPECT_EQ(text_of(recognized("duck", {70.04}, {0.31})),
            "duck at 70.0° ± 0.3 (evidence 4.2 of 0.8, confidence 0.37)");
}

TEST(OutcomeText, PrintsNoNumberForAPoseThatIsNotObservable) {
  const Outcome infinite = recognized("duck", {304.0}, {std::numeric_limits<double>::infinity()});
  EXPECT_EQ(text_of(infinite), "duck, pose not observable (evidence 4.2 of 0.8, confidence 0.37)");
  EXPECT_EQ(text_of(recognized("bottle", {304.0}, {0.5})),
            "bottle, pose not observable (evidence 4.2 of 0.8, confidence 0.37)")
      << "the model says so, whatever the uncertainty";
}

TEST(OutcomeText, NeverPrintsAFullTurn) {
  EXPECT_EQ(value_text(359.96, "deg"), "0.0°");
  EXPECT_EQ(value_text(359.94, "deg"), "359.9°");
  EXPECT_EQ(value_text(-0.04, "deg"), "0.0°");
  EXPECT_EQ(value_text(12.34, "mm"), "12.3 mm");
  EXPECT_EQ(value_text(360.0, "mm"), "360.0 mm");
}

TEST(OutcomeText, NamesTheDegreesOfFreedomWhereThereAreSeveral) {
  EXPECT_EQ(text_of(recognized("stage", {12.5, 90.0}, {0.2, std::numeric_limits<double>::infinity()})),
            "stage at arm not observable, x 12.5 mm ± 0.2 (evidence 4.2 of 0.8, confidence 0.37)");
}

TEST(OutcomeText, PrintsWhyAnObjectWasNotRecognised) {
  Outcome outcome = recognized("duck", {70.0}, {0.3});
  outcome.verdict = Verdict::unknown;
  EXPECT_EQ(text_of(outcome), "unknown object (most like duck: evidence 4.2 of 0.8)");
  outcome.verdict = Verdict::ambiguous;
  outcome.runner_up = Hypothesis{"bottle", {10.0}, 0.25};
  EXPECT_EQ(text_of(outcome),
            "duck at 70.0° ± 0.3 or bottle, pose not observable (evidence 4.2 of 0.8, confidence 0.37)");
  outcome.best.reset();
  outcome.verdict = Verdict::touches_border;
  EXPECT_EQ(text_of(outcome), "something that touches the border of the picture");
  outcome.verdict = Verdict::too_small;
  EXPECT_EQ(text_of(outcome), "something too small to recognise");
}

TEST(OutcomeText, PrintsAnotherPoseOfTheSameObjectAndOcclusion) {
  Outcome outcome = recognized("duck", {70.0}, {0.3});
  outcome.other_pose = Hypothesis{"duck", {250.0}, 0.24};
  outcome.covered_share = 0.31;
  EXPECT_EQ(text_of(outcome),
            "duck at 70.0° ± 0.3 or at 250.0° (evidence 4.2 of 0.8, confidence 0.37, 31 % occluded)");
}

TEST(OutcomeText, PrintsControlCharactersOfANameEscaped) {
  Outcome outcome = recognized("du\x1b[2Jck\n", {}, {});
  EXPECT_EQ(text_of(outcome), "du\\x1b[2Jck\\n (evidence 4.2 of 0.8, confidence 0.37)");
}

TEST(OutcomeJson, HoldsEveryPartOfTheOutcome) {
  Outcome outcome = recognized("duck", {70.0}, {0.5});
  outcome.q_covariance = {0.25};
  outcome.box = {1, 2, 3, 4};
  outcome.covered_share = 0.1;
  outcome.unfinished = true;
  outcome.runner_up = Hypothesis{"bottle", {10.0}, 0.5};
  const json expected = {{"verdict", "recognized"},
                         {"box", {1, 2, 3, 4}},
                         {"object", "duck"},
                         {"q", {70.0}},
                         {"pose", {{"table_deg", 70.0}}},
                         {"pose_sigma", {{"table_deg", 0.5}}},
                         {"q_sigma", {0.5}},
                         {"q_covariance", json::array({json::array({0.25})})},
                         {"distance", 0.234},
                         {"evidence", 4.24},
                         {"required_evidence", 0.81},
                         {"covered_share", 0.1},
                         {"confidence", 0.37},
                         {"unfinished", true},
                         {"runner_up",
                          {{"object", "bottle"},
                           {"q", json::array({nullptr})},
                           {"pose", {{"table_deg", nullptr}}},
                           {"distance", 0.5}}},
                         {"other_pose", nullptr}};
  EXPECT_EQ(outcome_json(outcome, model_of_three()), expected);
}

TEST(OutcomeJson, WritesNullForWhatCannotBeObserved) {
  const json entry =
      outcome_json(recognized("duck", {304.0}, {std::numeric_limits<double>::infinity()}), model_of_three());
  EXPECT_TRUE(entry.at("q").at(0).is_null());
  EXPECT_TRUE(entry.at("pose").at("table_deg").is_null());
  EXPECT_TRUE(entry.at("q_sigma").at(0).is_null());
  EXPECT_TRUE(entry.at("pose_sigma").at("table_deg").is_null());
}

}  // namespace
}  // namespace eigenpose
