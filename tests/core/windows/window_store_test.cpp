#include "core/windows/window_store.h"

#include <random>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

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
  constexpr int stride = 2;
  constexpr int side = 9;
  Eigen::MatrixXf queries(WindowGrid::components, side * side);
  for (Eigen::Index i = 0; i < queries.size(); ++i) queries.data()[i] = normal(random);
  std::vector<QueryWindow> rounded;
  rounded.reserve(static_cast<std::size_t>(queries.cols()));
  for (Eigen::Index i = 0; i < queries.cols(); ++i)
    rounded.push_back(quantize_query(queries.col(i).data(), scale));
  const PositionTolerance tolerance;
  PlacedQueries placed;
  placed.place(rounded, stride, tolerance, scale);
  const std::size_t lanes = store.groups() * WindowStore::group;
  std::vector<std::int32_t> scores(rounded.size() * lanes);
  store.best_scores(placed, scores.data());
  // Rounding to 8 and 7 bits moves each of 32 coordinates by less than half a step.
  constexpr float rounding = 0.08F;
  for (std::size_t i = 0; i < rounded.size(); ++i) {
    const int row = static_cast<int>(i) / side * stride;
    const int column = static_cast<int>(i) % side * stride;
    const std::int32_t* found = scores.data() + i * lanes;
    for (std::size_t v = 0; v < views.size(); ++v) {
      float nearest = 1e9F;
      for (int r = std::max(0, row - 2); r <= std::min(16, row + 2); ++r) {
        for (int c = std::max(0, column - 2); c <= std::min(16, column + 2); ++c) {
          const auto offset = static_cast<float>((r - row) * (r - row) + (c - column) * (c - column));
          const auto difference =
              views[v].col(r * WindowGrid::side + c) - queries.col(static_cast<Eigen::Index>(i));
          nearest = std::min(nearest, difference.squaredNorm() + tolerance.penalty * offset);
        }
      }
      EXPECT_NEAR(rounded[i].energy - 2.0F * scale.product() * static_cast<float>(found[v]), nearest,
                  rounding);
    }
    for (std::size_t v = views.size(); v < lanes; ++v) EXPECT_LT(found[v], -100000);
  }
}

TEST(WindowStore, RefusesSizesThatDoNotFit) {
  EXPECT_THROW(WindowStore(3, std::vector<std::int8_t>(7), WindowScale{}), std::invalid_argument);
  EXPECT_THROW(WindowStore({Eigen::MatrixXf(3, 3)}, WindowScale{}), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
