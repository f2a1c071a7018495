#include "core/windows/windows.h"

#include <stdexcept>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "tests/support/drawn_pictures.h"

namespace eigenpose {
namespace {

OrientationGrid grid_of_picture(const cv::Mat& picture) {
  OrientationGridMaker maker;
  OrientationGrid grid;
  maker.compute(picture, grid);
  return grid;
}

cv::Mat vertical_stripes() {
  cv::Mat picture(64, 64, CV_8UC1);
  for (int r = 0; r < 64; ++r)
    for (int c = 0; c < 64; ++c) picture.at<std::uint8_t>(r, c) = c / 4 % 2 == 0 ? 40 : 200;
  return picture;
}

/// Of the mean window: the part of gradients in this bin and in the opposite one.
float along(const WindowSpace& space, int bin) {
  float sum = 0.0F;
  for (int cell = 0; cell < WindowGrid::window * WindowGrid::window; ++cell)
    for (const int b : {bin, bin + OrientationGrid::bins / 2})
      sum += space.mean()(cell * OrientationGrid::bins + b);
  return sum;
}

TEST(WindowSpace, TakesTheWindowsEvenlyFromAllViewsWhereItTakesAPart) {
  const cv::Mat across = vertical_stripes();
  const cv::Mat down = across.t();
  std::vector<OrientationGrid> maps(4, grid_of_picture(across));
  maps.resize(8, grid_of_picture(down));
  for (const std::size_t limit : {std::size_t{200}, std::size_t{30000}}) {
    const WindowSpace space = WindowSpace::learn(maps, 1, limit);
    EXPECT_GT(along(space, 0), 0.0F);
    EXPECT_NEAR(along(space, 2) / along(space, 0), 1.0, 0.05) << limit;
  }
}

TEST(WindowSpace, ProjectsTheWindowAtEveryStrideFromTheMean) {
  const OrientationGrid grid = grid_of_picture(test::DrawnObject(3).view(10.0));
  const WindowSpace space = WindowSpace::learn({grid}, 1);
  std::vector<float> window(static_cast<std::size_t>(space.length()));
  for (const int stride : {1, 2, 4}) {
    Eigen::MatrixXf found;
    std::vector<float> masses;
    space.project(grid, stride, found, &masses);
    const int per_side = (WindowGrid::side - 1) / stride + 1;
    ASSERT_EQ(found.cols(), per_side * per_side);
    for (int i = 0; i < per_side * per_side; ++i) {
      const float mass = window_vector(grid, i / per_side * stride, i % per_side * stride, window.data());
      EXPECT_EQ(masses[static_cast<std::size_t>(i)], mass);
      const Eigen::VectorXf expected =
          space.basis().transpose() *
          (Eigen::Map<const Eigen::VectorXf>(window.data(), space.length()) - space.mean());
      EXPECT_LT((found.col(i) - expected).norm(), 1e-5F) << i;
    }
  }
}

TEST(WindowSpace, RefusesWhatMakesNone) {
  EXPECT_THROW((void)WindowSpace::learn({}), std::invalid_argument);
  EXPECT_THROW(
      (void)WindowSpace::from_parts(Eigen::VectorXf::Zero(144), Eigen::MatrixXf::Zero(143, 32), 1.0F),
      std::invalid_argument);
  EXPECT_THROW(
      (void)WindowSpace::from_parts(Eigen::VectorXf::Zero(144), Eigen::MatrixXf::Zero(144, 31), 1.0F),
      std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
