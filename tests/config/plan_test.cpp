#include "config/plan.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

using testing::DoubleEq;
using testing::ElementsAre;
using testing::HasSubstr;

const Dof table{"table", "deg", 0.0, 360.0, true};
const Dof slide{"slide", "mm", -50.0, 50.0, false};
const std::vector<Dof> dofs = {table, slide};

std::string plan_refusal(const Plan& plan) {
  try {
    check_plan(plan, dofs);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Plan, AFullTurnLeavesOutTheEndThatIsTheBeginning) {
  EXPECT_THAT(spaced_positions(table, 0, 360, 4), ElementsAre(0, 90, 180, 270));
}

TEST(Plan, APartOfATurnAndAnOpenAxisIncludeTheEnd) {
  EXPECT_THAT(spaced_positions(table, 0, 90, 4), ElementsAre(0, 30, 60, 90));
  EXPECT_THAT(spaced_positions(slide, -10, 10, 3), ElementsAre(-10, 0, 10));
}

TEST(Plan, VisitsEveryCombinationOnceWithTheLastAxisFastest) {
  const Plan plan{"p", {{"slide", {-10, 10}}, {"table", {0, 120, 240}}}};
  ASSERT_EQ(plan.size(), 6U);
  EXPECT_THAT(plan.at(0), ElementsAre(-10, 0));
  EXPECT_THAT(plan.at(1), ElementsAre(-10, 120));
  EXPECT_THAT(plan.at(3), ElementsAre(10, 0));
  EXPECT_THAT(plan.at(5), ElementsAre(10, 240));
}

TEST(Plan, AnyNumberOfAxesMakesAWorkspaceInThePlansOrder) {
  const Plan plan{"p", {{"slide", {0}}, {"table", {0}}}};
  const Workspace workspace = plan_workspace(plan, dofs);
  ASSERT_EQ(workspace.size(), 2U);
  EXPECT_EQ(workspace[0], slide);
  EXPECT_EQ(workspace[1], table);
}

TEST(Plan, RefusesWhatTheAxesCannotDoAndSaysWhatIsAllowed) {
  EXPECT_THAT(plan_refusal({"p", {}}), HasSubstr("at least one"));
  EXPECT_THAT(plan_refusal({"p", {{"tabel", {0}}}}), HasSubstr("allowed: table, slide"));
  EXPECT_THAT(plan_refusal({"p", {{"table", {0}}, {"table", {0}}}}), HasSubstr("named twice"));
  EXPECT_THAT(plan_refusal({"p", {{"table", {}}}}), HasSubstr("no positions"));
  EXPECT_THAT(plan_refusal({"p", {{"slide", {0, 51}}}}), HasSubstr("allowed: -50 to 50"));
  EXPECT_THAT(plan_refusal({"p", {{"table", {0, 360}}}}), HasSubstr("twice"));
  EXPECT_EQ(plan_refusal({"p", {{"table", {0, 10}}}}), "accepted");
}

TEST(Plan, RefusesAGridThatNobodyCanMean) {
  EXPECT_THROW((void)spaced_positions(table, 0, 360, 0), ConfigError);
  EXPECT_THROW((void)spaced_positions(table, 90, 90, 2), ConfigError);
  EXPECT_THROW((void)spaced_positions(table, 0, 360, 2'000'000'000), ConfigError);
  const Plan plan{
      "p",
      {{"table", spaced_positions(table, 0, 360, 1000)}, {"slide", spaced_positions(slide, 0, 50, 1000)}}};
  EXPECT_THAT(plan_refusal(plan), HasSubstr("100000"));
}

}  // namespace
}  // namespace eigenpose
