#include "core/parts/window_store.h"

#include <random>

#include <gtest/gtest.h>

#include "core/parts/window_kernels.h"

namespace eigenpose {
namespace {

TEST(WindowKernels, GiveThePortableAnswerInEveryBit) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> value(-127, 127);
  std::uniform_int_distribution<int> query(0, 127);
  constexpr std::size_t groups = 5;
  std::vector<std::int8_t> values(groups * 256);
  std::vector<std::int32_t> biases(groups * 8);
  std::vector<std::uint8_t> q(32);
  for (int round = 0; round < 200; ++round) {
    // Every tenth round takes the largest values there are: nothing may overflow.
    for (auto& v : values)
      v = static_cast<std::int8_t>(round % 10 == 0 ? (round % 20 == 0 ? 127 : -127) : value(random));
    for (auto& v : q) v = static_cast<std::uint8_t>(round % 10 == 0 ? 127 : query(random));
    for (auto& b : biases) b = value(random) * 100;
    std::vector<std::int32_t> chosen(groups * 8, -5000);
    std::vector<std::int32_t> portable = chosen;
    raise_scores(values.data(), biases.data(), groups, q.data(), 37, chosen.data());
    raise_scores_portable(values.data(), biases.data(), groups, q.data(), 37, portable.data());
    ASSERT_EQ(chosen, portable);
  }
}

TEST(WindowStore, FindsTheSquaredDistanceToTheNearestWindowWithinTheTolerance) {
  std::mt19937 random(4);
  std::normal_distribution<float> normal(0.0F, 0.15F);
  std::vector<Eigen::MatrixXf> views(11);
  for (auto& view : views) {
    view.resize(WindowGrid::components, WindowGrid::positions);
    for (Eigen::Index i = 0; i < view.size(); ++i) view.data()[i] = normal(random);
  }
  const WindowScale scale = WindowScale::for_range(0.8F);
  const WindowStore learned(views, scale);
  // What a model file keeps is all there is.
  const WindowStore store(views.size(), learned.values(), scale);
  Eigen::VectorXf query(WindowGrid::components);
  for (Eigen::Index i = 0; i < query.size(); ++i) query(i) = normal(random);
  const QueryWindow rounded = quantize_query(query.data(), scale);
  const PositionTolerance tolerance;
  std::vector<std::int32_t> scores(store.groups() * WindowStore::group);
  // Rounding to 8 and 7 bits moves each of 32 coordinates by less than half a step.
  constexpr float rounding = 0.08F;
  for (const auto& [row, column] : {std::pair{8, 8}, {0, 0}, {16, 3}}) {
    store.best_scores(rounded, row, column, tolerance, scale, scores.data());
    for (std::size_t v = 0; v < views.size(); ++v) {
      float nearest = 1e9F;
      for (int r = std::max(0, row - 2); r <= std::min(16, row + 2); ++r) {
        for (int c = std::max(0, column - 2); c <= std::min(16, column + 2); ++c) {
          const float offset = static_cast<float>((r - row) * (r - row) + (c - column) * (c - column));
          nearest = std::min(nearest, (views[v].col(r * WindowGrid::side + c) - query).squaredNorm() +
                                          tolerance.penalty * offset);
        }
      }
      const float found = rounded.energy - 2.0F * scale.product() * static_cast<float>(scores[v]);
      EXPECT_NEAR(found, nearest, rounding);
    }
    for (std::size_t v = views.size(); v < scores.size(); ++v) EXPECT_LT(scores[v], -100000);
  }
}

TEST(WindowStore, RefusesSizesThatDoNotFit) {
  EXPECT_THROW(WindowStore(3, std::vector<std::int8_t>(7), WindowScale{}), std::invalid_argument);
  EXPECT_THROW(WindowStore({Eigen::MatrixXf(3, 3)}, WindowScale{}), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
