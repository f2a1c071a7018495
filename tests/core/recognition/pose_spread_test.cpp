#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/recognition/recognizer.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

TEST(Recognizer, ReportsTheSpreadOfThePoseThatDistanceAndManifoldGive) {
  // σ = max(d, s)/√6 of a point, along a manifold that moves by ‖∂f/∂q‖ for each degree.
  Recognizer recognize(testing::learned_world().model);
  const Model& model = recognize.model();
  for (double angle = 7.5; angle < 360.0; angle += 45.0) {
    const auto outcomes = recognize.recognize(testing::scene_with(2, angle, {}, 900));
    ASSERT_EQ(outcomes.size(), 1U);
    const Outcome& outcome = outcomes[0];
    ASSERT_EQ(outcome.verdict, Verdict::recognized);
    const auto object = std::ranges::find(model.objects, outcome.best->object, &ModelObject::name);
    const double speed = object->manifold.evaluate_with_jacobian(outcome.best->q).jacobian.norm();
    const double sigma = std::max(outcome.best->distance, object->typical_distance) /
                         std::sqrt(model.decision.tuning.effective_dimensions) / speed;
    // The speed is that of the nearest of four samples a learned step.
    EXPECT_NEAR(outcome.q_sigma[0] / sigma, 1.0, 0.25) << angle;
    EXPECT_DOUBLE_EQ(outcome.q_covariance[0], outcome.q_sigma[0] * outcome.q_sigma[0]);
  }
}

}  // namespace
}  // namespace eigenpose
