#include "core/base/workspace.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

const Dof table{"table", "deg", 0, 360, true};
const Dof slide{"x", "mm", -10, 10, false};

TEST(Workspace, RefusesWhatIsNoWorkspace) {
  EXPECT_THROW(Workspace(std::vector<Dof>{}), std::invalid_argument);
  EXPECT_THROW(Workspace({table, table}), std::invalid_argument);
  EXPECT_THROW(Workspace({Dof{"", "deg", 0, 360, true}}), std::invalid_argument);
  EXPECT_THROW(Workspace({Dof{"x", "mm", 10, 10, false}}), std::invalid_argument);
}

TEST(Workspace, WrapsPeriodicDofsOnly) {
  const Workspace workspace({table, slide});
  const std::vector<double> q = workspace.canonical(std::vector<double>{-10.0, 25.0});
  EXPECT_DOUBLE_EQ(q[0], 350.0);
  EXPECT_DOUBLE_EQ(q[1], 25.0);
  EXPECT_THROW((void)workspace.canonical(std::vector<double>{1.0}), std::invalid_argument);
}

TEST(Workspace, DifferenceKnowsTheSeam) {
  EXPECT_DOUBLE_EQ(table.difference(5, 355), 10.0);
  EXPECT_DOUBLE_EQ(slide.difference(-9, 9), -18.0);
}

}  // namespace
}  // namespace eigenpose
