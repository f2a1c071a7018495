#include "core/subspace/back_projection.h"

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(FinishedEigenspace, HasItsSignFromTheFirstOfEquallyLargeEntries) {
  // Equal up to rounding: which of the two is larger differs from machine to machine.
  for (const double rounding : {-1e-9, 0.0, 1e-9})
    for (const double sign : {-1.0, 1.0}) {
      Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(4, 2);
      basis.col(0) << 0.1, -sign, sign * (1.0 + rounding), 0.0;
      basis.col(1) << 0.0, 0.0, 0.0, sign;
      const Eigenspace space =
          finished_eigenspace(Eigen::VectorXd::Zero(4), basis, Eigen::Vector2d(2.0, 1.0), 3.0);
      EXPECT_GT(space.basis(1, 0), 0.0F) << rounding << ", " << sign;
      EXPECT_LT(space.basis(2, 0), 0.0F);
      EXPECT_FLOAT_EQ(space.basis(3, 1), 1.0F);
    }
}

TEST(FinishedEigenspace, HasItsSignFromTheLargestEntryElse) {
  Eigen::MatrixXd basis(3, 1);
  basis << 0.5, -0.6, 0.5;
  const Eigenspace space =
      finished_eigenspace(Eigen::VectorXd::Zero(3), basis, Eigen::VectorXd::Ones(1), 1.0);
  EXPECT_GT(space.basis(1, 0), 0.0F);
  EXPECT_LT(space.basis(0, 0), 0.0F);
  EXPECT_NEAR(space.basis.col(0).norm(), 1.0F, 1e-6F);
}

}  // namespace
}  // namespace eigenpose
