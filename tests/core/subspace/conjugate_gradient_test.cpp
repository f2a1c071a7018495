#include "core/subspace/conjugate_gradient.h"

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// One eigenvalue far above the others, which lie close together.
VectorXd one_far_above() {
  VectorXd values = VectorXd::LinSpaced(80, 1.0, 0.9);
  values[0] = 50.0;
  return values;
}

EigenPairs found_after(std::size_t iterations) {
  const VectorXd values = one_far_above();
  return conjugate_gradient_eigenpairs(values.size(),
                                       [&](const MatrixXd& x, MatrixXd& y) { y = values.asDiagonal() * x; },
                                       {.wanted = 4, .tolerance = 1e-9, .max_iterations = iterations});
}

TEST(ConjugateGradient, HasConvergedWhereEveryPairHas) {
  bool some = false;  // of the pairs had converged, not all
  for (const std::size_t iterations : {2U, 4U, 6U, 8U, 12U, 16U, 24U, 400U}) {
    const EigenPairs found = found_after(iterations);
    ASSERT_EQ(found.values.size(), 4);
    const VectorXd relative = found.residuals / found.values[0];
    EXPECT_EQ(found.converged, relative.maxCoeff() <= 1e-9) << iterations;
    some = some || (relative.minCoeff() <= 1e-9 && relative.maxCoeff() > 1e-9);
  }
  EXPECT_TRUE(some) << "or the test shows nothing";
  const EigenPairs found = found_after(400);
  EXPECT_TRUE(found.converged);
  const VectorXd values = one_far_above();
  for (Index k = 0; k < 4; ++k) EXPECT_NEAR(found.values[k], values[k], 1e-8) << k;
  EXPECT_NEAR(found.next_value, values[4], 1e-6);
}

}  // namespace
}  // namespace eigenpose
