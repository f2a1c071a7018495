#include "core/image/segmentation.h"

#include <gmock/gmock.h>
#include <opencv2/imgproc.hpp>

#include "tests/support/synthetic_objects.h"

namespace eigenpose {
namespace {

using testing::SceneKnobs;

cv::Mat plain(int background, double noise, int type = CV_8UC1, int seed = 3) {
  cv::Mat image(240, 320, type);
  cv::RNG(static_cast<std::uint64_t>(seed)).fill(image, cv::RNG::NORMAL, background, noise);
  return image;
}

TEST(Segmenter, FindsNothingOnAnEmptyTableWhateverItsLevelAndNoise) {
  Segmenter segmenter;
  for (const int level : {0, 3, 25, 60})
    for (const double noise : {0.0, 1.0, 3.0, 8.0})
      for (const int type : {CV_8UC1, CV_8UC3})
        EXPECT_TRUE(segmenter.segment(plain(level, noise, type)).empty()) << level << " ±" << noise;
}

TEST(Segmenter, GivesTightBoxesFromLeftToRight) {
  cv::Mat image = plain(20, 2.0);
  const cv::Rect right(200, 30, 51, 40);
  const cv::Rect left(40, 100, 30, 77);
  cv::rectangle(image, right, 150, cv::FILLED);
  cv::rectangle(image, left, 90, cv::FILLED);
  Segmenter segmenter;
  const auto regions = segmenter.segment(image);
  ASSERT_EQ(regions.size(), 2U);
  EXPECT_EQ(regions[0].box, left);
  EXPECT_EQ(regions[0].area, left.area());
  EXPECT_EQ(regions[1].box, right);
  EXPECT_FALSE(regions[0].touches_border);
}

TEST(Segmenter, AgreesWithConnectedComponentsOnRandomBlobs) {
  cv::RNG random(11);
  for (int round = 0; round < 30; ++round) {
    cv::Mat image(200, 333, CV_8UC1, cv::Scalar(10));
    for (int i = 0; i < 12; ++i)
      cv::ellipse(image, {random.uniform(0, 333), random.uniform(0, 200)},
                  {random.uniform(3, 40), random.uniform(3, 25)}, random.uniform(0, 180), 0, 360, 200,
                  cv::FILLED);
    Segmenter segmenter({.bridged_gap = 0, .dirt_share = 0.0});
    const auto regions = segmenter.segment(image);
    // The same rule, slowly: pixels with a neighbour beside them, 8-connected.
    cv::Mat foreground = image > 100;
    const cv::Mat side = (cv::Mat_<unsigned char>(1, 3) << 1, 0, 1);
    cv::Mat beside;
    cv::dilate(foreground, beside, side, {-1, -1}, 1, cv::BORDER_CONSTANT, 0);
    foreground &= beside;
    cv::Mat labels;
    cv::Mat stats;
    cv::Mat middles;
    const int count = cv::connectedComponentsWithStats(foreground, labels, stats, middles, 8);
    ASSERT_EQ(regions.size(), static_cast<std::size_t>(count - 1)) << round;
    for (const Region& region : regions) {
      bool found = false;
      for (int i = 1; i < count; ++i)
        found = found || (region.box == cv::Rect(stats.at<int>(i, 0), stats.at<int>(i, 1),
                                                 stats.at<int>(i, 2), stats.at<int>(i, 3)) &&
                          region.area == stats.at<int>(i, 4));
      EXPECT_TRUE(found) << "round " << round << " box " << region.box;
    }
  }
}

TEST(Segmenter, ADarkStripeDoesNotCutAnObjectButAGapBetweenObjectsDoes) {
  cv::Mat image(120, 160, CV_8UC1, cv::Scalar(5));
  cv::rectangle(image, {30, 30, 20, 40}, 150, cv::FILLED);
  cv::rectangle(image, {53, 30, 20, 40}, 150, cv::FILLED);  // 3 dark columns between
  Segmenter segmenter;
  ASSERT_EQ(segmenter.segment(image).size(), 1U);
  EXPECT_EQ(segmenter.segment(image)[0].box, cv::Rect(30, 30, 43, 40));
  cv::rectangle(image, {30, 30, 20, 40}, 5, cv::FILLED);
  cv::rectangle(image, {25, 30, 20, 40}, 150, cv::FILLED);  // now 8
  EXPECT_EQ(segmenter.segment(image).size(), 2U);
}

TEST(Segmenter, TellsWhatTouchesTheBorderAndDropsDirt) {
  cv::Mat image = plain(10, 1.5);
  cv::rectangle(image, {0, 50, 40, 40}, 200, cv::FILLED);
  cv::rectangle(image, {150, 100, 3, 2}, 200, cv::FILLED);  // dust
  image.at<unsigned char>(200, 200) = 255;                  // a hot pixel
  Segmenter segmenter;
  const auto regions = segmenter.segment(image);
  ASSERT_EQ(regions.size(), 1U);
  EXPECT_TRUE(regions[0].touches_border);
}

TEST(Segmenter, SeesASaturatedColourThatIsDarkInGrey) {
  cv::Mat image = plain(10, 1.0, CV_8UC3);
  cv::rectangle(image, {100, 100, 40, 40}, cv::Scalar(120, 0, 0), cv::FILLED);
  Segmenter segmenter;
  ASSERT_EQ(segmenter.segment(image).size(), 1U);
  EXPECT_EQ(segmenter.segment(image)[0].box, cv::Rect(100, 100, 40, 40));
}

TEST(Segmenter, CutsOutOneObjectWithoutItsNeighbour) {
  cv::Mat image(120, 160, CV_8UC1, cv::Scalar(5));
  // An L around a square: the boxes overlap, the objects do not.
  cv::rectangle(image, {20, 20, 20, 80}, 200, cv::FILLED);
  cv::rectangle(image, {20, 80, 90, 20}, 200, cv::FILLED);
  cv::rectangle(image, {70, 30, 30, 30}, 100, cv::FILLED);
  const cv::Mat before = image.clone();
  Segmenter segmenter;
  const auto regions = segmenter.segment(image);
  ASSERT_EQ(regions.size(), 2U);
  const cv::Mat corner = segmenter.cut_out(image, 0).clone();
  EXPECT_EQ(cv::countNonZero(corner == 100), 0);
  EXPECT_EQ(cv::countNonZero(corner == 200), regions[0].area);
  const cv::Mat square = segmenter.cut_out(image, 1).clone();
  EXPECT_EQ(cv::countNonZero(square == 100), 900);
  EXPECT_EQ(cv::norm(image, before, cv::NORM_INF), 0.0) << "the frame is never written to";
}

TEST(Segmenter, TheBoxMovesWithTheObjectAndDoesNotDependOnTheBackground) {
  Segmenter segmenter;
  const auto box = [&](int background, double dx) {
    SceneKnobs knobs;
    knobs.background = background;
    knobs.x += dx;
    const auto regions = segmenter.segment(testing::scene_with(3, 40.0, knobs));
    return regions.size() == 1 ? regions[0].box : cv::Rect();
  };
  const cv::Rect reference = box(4, 0.0);
  ASSERT_GT(reference.area(), 400);
  EXPECT_EQ(box(4, 17.0), reference + cv::Point(17, 0));
  const cv::Rect brighter = box(30, 0.0);
  // The threshold stands a fixed contrast above the background; a soft edge may move by a pixel.
  EXPECT_NEAR(brighter.x, reference.x, 1);
  EXPECT_NEAR(brighter.width, reference.width, 2);
}

TEST(Segmenter, RefusesPicturesItDoesNotKnow) {
  Segmenter segmenter;
  EXPECT_THROW(segmenter.segment(cv::Mat()), std::invalid_argument);
  EXPECT_THROW(segmenter.segment(cv::Mat(4, 4, CV_32FC1)), std::invalid_argument);
  EXPECT_THROW(Segmenter({.bridged_gap = 99}), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
