#include "core/subspace/scatter_operator.h"

#include <gtest/gtest.h>

#include "core/subspace/gram.h"
#include "core/subspace/memory_source.h"
#include "tests/core/subspace/subspace_samples.h"
#include "tests/support/byte_source.h"

namespace eigenpose {
namespace {

using Space = ScatterOperator::Space;

TEST(ScatterOperator, MultipliesLikeTheMatrixThatItNeverForms) {
  const auto bytes = test::smooth_views(70, 130, 3);
  const ByteSource source(bytes, 130);
  Eigen::MatrixXd gram = gram_matrix(source, {});
  const double total = normalize_and_center(gram, view_norms(gram, true), 1);
  Eigen::MatrixXf floats(130, 70);
  source.read(0, floats);
  Eigen::MatrixXd views = floats.cast<double>();
  views.colwise() -= Eigen::VectorXd(views.rowwise().mean());

  ScatterOperator over_views(source, Space::views, 2, 0);
  ASSERT_EQ(over_views.size(), 70);
  EXPECT_NEAR(over_views.total_scatter(), total, 1e-12);
  const Eigen::MatrixXd x = Eigen::MatrixXd::Random(70, 5);
  Eigen::MatrixXd y(70, 5);
  over_views.apply(x, y);
  // Sums of 130 products of order one in double.
  EXPECT_LT((y - gram * x).cwiseAbs().maxCoeff(), 1e-12);

  ScatterOperator over_pixels(source, Space::pixels, 2, 0);
  ASSERT_EQ(over_pixels.size(), 130);
  const Eigen::MatrixXd u = Eigen::MatrixXd::Random(130, 5);
  Eigen::MatrixXd v(130, 5);
  over_pixels.apply(u, v);
  // The comparison has float views: 6e-8 relative.
  EXPECT_LT((v - views * (views.transpose() * u)).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(ScatterOperator, ReadsOnceAProductOverPixelsAndTwiceOverViews) {
  const auto bytes = test::smooth_views(40, 64, 4);
  const ByteSource source(bytes, 64);
  ScatterOperator over_pixels(source, Space::pixels, 1, 0);
  EXPECT_EQ(over_pixels.passes(), 1U) << "norms and mean";
  Eigen::MatrixXd y(64, 2);
  over_pixels.apply(Eigen::MatrixXd::Random(64, 2), y);
  EXPECT_EQ(over_pixels.passes(), 2U);
  ScatterOperator over_views(source, Space::views, 1, 0);
  Eigen::MatrixXd z(40, 2);
  over_views.apply(Eigen::MatrixXd::Random(40, 2), z);
  EXPECT_EQ(over_views.passes(), 3U);
}

TEST(ScatterOperator, NamesTheBlackView) {
  auto bytes = test::smooth_views(6, 50, 5);
  std::fill_n(bytes.begin() + 100, 50, std::uint8_t{0});
  const ByteSource source(bytes, 50);
  EXPECT_THROW(ScatterOperator(source, Space::views, 1, 0), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
