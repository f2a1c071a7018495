#include "daemon/rig/plan.h"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"

namespace eigenpose::plan_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const Dof table{"table", "deg", 0.0, 360.0, true};
const Dof slide{"slide", "mm", -50.0, 50.0, false};
const std::vector<Dof> dofs = {table, slide};

PlanRequest listed(std::vector<std::pair<std::string, std::vector<double>>> axes) {
  PlanRequest request{"p", {}};
  for (auto& [axis, positions] : axes) request.axes.push_back({axis, std::move(positions), {}});
  return request;
}

std::string plan_refusal(const PlanRequest& request) {
  try {
    (void)make_plan(request, dofs);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Plan, AFullTurnLeavesOutTheEndThatIsTheBeginning) {
  EXPECT_THAT(spaced_positions(table, {0, 360, 4}), ElementsAre(0, 90, 180, 270));
  EXPECT_THAT(spaced_positions(table, {90, 450, 4}), ElementsAre(90, 180, 270, 0)) << "from anywhere";
  EXPECT_THAT(spaced_positions(table, {360, 0, 4}), ElementsAre(0, 270, 180, 90)) << "backwards";
  EXPECT_THAT(spaced_positions(table, {0, -360, 3}), ElementsAre(0, 240, 120));
  EXPECT_THAT(spaced_positions(table, {0, 360, 1}), ElementsAre(0));
}

TEST(Plan, APartOfATurnAndAnOpenAxisIncludeTheEnd) {
  EXPECT_THAT(spaced_positions(table, {0, 90, 4}), ElementsAre(0, 30, 60, 90));
  EXPECT_THAT(spaced_positions(table, {90, 0, 4}), ElementsAre(90, 60, 30, 0));
  EXPECT_THAT(spaced_positions(slide, {-10, 10, 3}), ElementsAre(-10, 0, 10));
  EXPECT_THAT(spaced_positions(slide, {10, -10, 3}), ElementsAre(10, 0, -10));
}

TEST(Plan, VisitsEveryCombinationOnceWithTheLastAxisFastest) {
  const Plan plan = make_plan(listed({{"slide", {-10, 10}}, {"table", {0, 120, 240}}}), dofs);
  ASSERT_EQ(plan.size(), 6U);
  EXPECT_THAT(plan.at(0), ElementsAre(-10, 0));
  EXPECT_THAT(plan.at(1), ElementsAre(-10, 120));
  EXPECT_THAT(plan.at(3), ElementsAre(10, 0));
  EXPECT_THAT(plan.at(5), ElementsAre(10, 240));
}

TEST(Plan, SpacedAndListedAxesMakeOnePlan) {
  PlanRequest request{"p", {{"slide", {5}, {}}, {"table", {}, Spacing{0, 360, 3}}}};
  const Plan plan = make_plan(request, dofs);
  EXPECT_EQ(plan.name, "p");
  EXPECT_THAT(plan.axes[0].positions, ElementsAre(5));
  EXPECT_THAT(plan.axes[1].positions, ElementsAre(0, 120, 240));
}

TEST(Plan, AnyNumberOfAxesMakesAWorkspaceInThePlansOrder) {
  const Workspace workspace = plan_workspace(make_plan(listed({{"slide", {0}}, {"table", {0}}}), dofs), dofs);
  ASSERT_EQ(workspace.size(), 2U);
  EXPECT_EQ(workspace[0], slide);
  EXPECT_EQ(workspace[1], table);
}

TEST(Plan, RefusesWhatTheAxesCannotDoAndSaysWhatIsAllowed) {
  EXPECT_THAT(plan_refusal(listed({})), HasSubstr("at least one"));
  EXPECT_THAT(plan_refusal(listed({{"tabel", {0}}})), HasSubstr("allowed: table, slide"));
  EXPECT_THAT(plan_refusal(listed({{"table", {0}}, {"table", {0}}})), HasSubstr("named twice"));
  EXPECT_THAT(plan_refusal(listed({{"table", {}}})), HasSubstr("no positions"));
  EXPECT_THAT(plan_refusal(listed({{"slide", {0, 51}}})), HasSubstr("allowed: -50 to 50"));
  EXPECT_THAT(plan_refusal(listed({{"slide", {-50.001}}})), HasSubstr("allowed: -50 to 50"));
  EXPECT_THAT(plan_refusal(listed({{"table", {std::numeric_limits<double>::quiet_NaN()}}})),
              HasSubstr("cannot reach"));
  EXPECT_THAT(plan_refusal(listed({{"table", {0, 360}}})), HasSubstr("twice"));
  EXPECT_THAT(plan_refusal({"p", {{"table", {0}, Spacing{0, 360, 4}}}}), HasSubstr("one of them"));
  EXPECT_EQ(plan_refusal(listed({{"table", {0, 10}}, {"slide", {-50, 50}}})), "accepted");
}

TEST(Plan, RefusesASpacingThatNobodyCanMean) {
  EXPECT_THAT(plan_refusal({"p", {{"table", {}, Spacing{0, 360, 0}}}}), HasSubstr("allowed: 1 to 100000"));
  EXPECT_THAT(plan_refusal({"p", {{"table", {}, Spacing{90, 90, 2}}}}), HasSubstr("empty"));
  EXPECT_THAT(plan_refusal({"p", {{"table", {}, Spacing{0, std::numeric_limits<double>::infinity(), 2}}}}),
              HasSubstr("infinite"));
  EXPECT_EQ(plan_refusal({"p", {{"table", {}, Spacing{90, 90, 1}}}}), "accepted");
}

TEST(Plan, RefusesMoreViewsThanAllowedBeforeItComputesThem) {
  EXPECT_THAT(plan_refusal({"p", {{"table", {}, Spacing{0, 360, 2'000'000'000}}}}), HasSubstr("100000"));
  EXPECT_THAT(plan_refusal({"p", {{"table", {}, Spacing{0, 360, 1000}}, {"slide", {}, Spacing{0, 50, 101}}}}),
              HasSubstr("100000"));
  EXPECT_EQ(plan_refusal({"p", {{"table", {}, Spacing{0, 360, 1000}}, {"slide", {}, Spacing{0, 50, 100}}}}),
            "accepted");
}

}  // namespace
}  // namespace eigenpose::plan_test
