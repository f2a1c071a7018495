#include "core/image/scene_change.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace eigenpose {
namespace {

using std::chrono::milliseconds;

/// A film of a dark table at 30 frames a second, with noise of a fixed seed.
class Film {
 public:
  Film(int type, double noise)
      : noise_(noise), background_(240, 320, type, cv::Scalar::all(12)), random_(7) {}

  Frame next(const cv::Mat& scene) {
    Frame frame;
    frame.sequence = static_cast<std::uint64_t>(++shown_);
    frame.exposure_start = TimePoint{} + milliseconds(33) * shown_;
    cv::Mat noise(scene.size(), CV_MAKETYPE(CV_16S, scene.channels()));
    random_.fill(noise, cv::RNG::NORMAL, 0.0, noise_);
    cv::Mat wide;
    scene.convertTo(wide, CV_16S);
    wide += noise;
    wide.convertTo(frame.image, CV_8U);
    return frame;
  }
  [[nodiscard]] cv::Mat empty() const { return background_.clone(); }
  [[nodiscard]] cv::Mat with_square(int x) const {
    cv::Mat scene = background_.clone();
    cv::rectangle(scene, {x, 100, 60, 60}, cv::Scalar::all(140), cv::FILLED);
    return scene;
  }

 private:
  double noise_;
  cv::Mat background_;
  cv::RNG random_;
  int shown_ = 0;
};

/// Enough frames to settle: 300 ms at 30 frames a second are 10.
SceneChange::Observation show(SceneChange& scene, Film& film, const cv::Mat& picture, int frames = 12) {
  SceneChange::Observation seen;
  for (int i = 0; i < frames; ++i) seen = scene.update(film.next(picture));
  return seen;
}

TEST(SceneChange, SettlesOnAStillNoisyPicture) {
  for (const double noise : {0.0, 2.0, 8.0, 25.0}) {
    SceneChange scene;
    Film film(CV_8UC1, noise);
    EXPECT_TRUE(show(scene, film, film.empty(), 30).settled) << "noise " << noise;
  }
}

TEST(SceneChange, IsNotSettledBeforeTheSettlingTimeIsOver) {
  SceneChange scene;
  Film film(CV_8UC3, 2.0);
  EXPECT_FALSE(show(scene, film, film.empty(), 9).settled);
  EXPECT_TRUE(show(scene, film, film.empty(), 3).settled);
}

TEST(SceneChange, AnObjectThatAppearsIsAChangeUntilItIsAccepted) {
  SceneChange scene;
  Film film(CV_8UC3, 2.0);
  show(scene, film, film.empty());
  scene.accept();
  EXPECT_FALSE(show(scene, film, film.empty()).changed);
  const SceneChange::Observation first = scene.update(film.next(film.with_square(100)));
  EXPECT_FALSE(first.settled);
  EXPECT_TRUE(first.changed);
  const SceneChange::Observation later = show(scene, film, film.with_square(100));
  EXPECT_TRUE(later.settled);
  EXPECT_TRUE(later.changed);
  scene.accept();
  EXPECT_FALSE(show(scene, film, film.with_square(100)).changed);
}

TEST(SceneChange, AThingThatMovesSlowlyNeverSettles) {
  SceneChange scene;
  Film film(CV_8UC1, 1.0);
  show(scene, film, film.empty());
  bool settled = false;
  for (int x = 20; x < 120; ++x) settled = settled || scene.update(film.next(film.with_square(x))).settled;
  EXPECT_FALSE(settled) << "a pixel a frame is still motion";
}

TEST(SceneChange, AHandThatCameAndWentLeavesTheSceneUnchanged) {
  SceneChange scene;
  Film film(CV_8UC1, 2.0);
  show(scene, film, film.with_square(50));
  scene.accept();
  for (int x = 0; x < 10; ++x) EXPECT_FALSE(scene.update(film.next(film.with_square(150 + 10 * x))).settled);
  const SceneChange::Observation after = show(scene, film, film.with_square(50));
  EXPECT_TRUE(after.settled);
  EXPECT_FALSE(after.changed);
}

TEST(SceneChange, ALightSwitchedOnceIsAChangeAndNotNoise) {
  SceneChange scene;
  Film film(CV_8UC1, 1.0);
  show(scene, film, film.empty());
  scene.accept();
  const double threshold = scene.threshold();
  const SceneChange::Observation seen = show(scene, film, film.empty() + cv::Scalar::all(40));
  EXPECT_TRUE(seen.changed);
  EXPECT_TRUE(seen.settled);
  EXPECT_EQ(scene.threshold(), threshold);
}

TEST(SceneChange, AGivenThresholdIsTaken) {
  SceneChangeOptions options;
  options.threshold = 60.0;
  SceneChange scene(options);
  Film film(CV_8UC1, 0.0);
  show(scene, film, film.empty());
  scene.accept();
  EXPECT_FALSE(scene.update(film.next(film.empty() + cv::Scalar::all(50))).changed);
  EXPECT_TRUE(scene.update(film.next(film.empty() + cv::Scalar::all(70))).changed);
}

TEST(SceneChange, APictureOfAnotherSizeBeginsAnew) {
  SceneChange scene;
  Film film(CV_8UC1, 0.0);
  show(scene, film, film.empty());
  scene.accept();
  Frame other = film.next(film.empty());
  other.image = cv::Mat(100, 100, CV_8UC1, cv::Scalar::all(0));
  EXPECT_FALSE(scene.update(other).settled);
}

/// What a lamp on the mains does to `scene`: frame `k` of a beat of `period` frames, ±`amplitude`. Rows may
/// be read one after another: `waves` of the flicker fit into the height.
cv::Mat flickering(const cv::Mat& scene, double amplitude, double period, int k, double waves = 0.0) {
  cv::Mat lit = scene.clone();
  for (int y = 0; y < lit.rows; ++y) {
    const double phase = 2.0 * CV_PI * (k / period + waves * y / lit.rows);
    cv::Mat row = lit.row(y);
    row.convertTo(row, -1, 1.0 + amplitude * std::sin(phase));
  }
  return lit;
}

TEST(SceneChange, SettlesUnderALampThatFlickersAndReportsIt) {
  for (const double amplitude : {0.02, 0.03, 0.05, 0.08, 0.1})
    for (const double period : {2.3, 5.0, 12.0, 25.0}) {
      SceneChange scene;
      Film film(CV_8UC1, 0.6);
      SceneChange::Observation seen;
      int settled = 0;
      for (int k = 0; k < 60; ++k) {
        seen = scene.update(film.next(flickering(film.with_square(100), amplitude, period, k)));
        if (seen.settled) ++settled;
      }
      EXPECT_GE(settled, 60 - 14) << amplitude << " " << period;
      // Of dark ground, 12 levels, flicker is at most one level of rounding: 6.5 · 1.4826.
      EXPECT_LE(scene.threshold(), 9.7) << amplitude << " " << period;
      // Half a level of 140 at each extreme, and a beat of five frames that misses the extremes by 5 %.
      EXPECT_NEAR(scene.flicker(), amplitude, 0.005 + 0.05 * amplitude) << amplitude << " " << period;
    }
}

TEST(SceneChange, SettlesUnderFlickerOfABrightGroundInColourAndWithSaturatedBlocks) {
  SceneChange scene;
  Film film(CV_8UC3, 1.0);
  cv::Mat picture(240, 320, CV_8UC3, cv::Scalar(120, 130, 140));
  cv::rectangle(picture, {40, 40, 100, 100}, cv::Scalar(250, 252, 255), cv::FILLED);
  SceneChange::Observation seen;
  for (int k = 0; k < 40; ++k) seen = scene.update(film.next(flickering(picture, 0.06, 12.0, k)));
  EXPECT_TRUE(seen.settled);
  EXPECT_LT(scene.threshold(), 10.0) << "flicker that is common to all blocks is no noise";
}

TEST(SceneChange, SettlesUnderTheBandsOfARollingShutter) {
  SceneChange scene;
  Film film(CV_8UC1, 0.6);
  cv::Mat picture = film.empty();
  cv::rectangle(picture, {20, 10, 260, 220}, cv::Scalar::all(140), cv::FILLED);
  SceneChange::Observation seen;
  for (int k = 0; k < 60; ++k) seen = scene.update(film.next(flickering(picture, 0.04, 6.0, k, 2.0)));
  EXPECT_TRUE(seen.settled);
}

TEST(SceneChange, AScreenThatDoesNotFlickerWithTheLampIsStillToo) {
  SceneChange scene;
  Film film(CV_8UC1, 0.6);
  SceneChange::Observation seen;
  for (int k = 0; k < 40; ++k) {
    cv::Mat picture = flickering(film.with_square(100), 0.06, 12.0, k);
    cv::rectangle(picture, {220, 20, 30, 30}, cv::Scalar::all(200), cv::FILLED);
    seen = scene.update(film.next(picture));
  }
  EXPECT_TRUE(seen.settled);
}

TEST(SceneChange, UnderFlickerAnObjectThatComesGoesOrMovesIsAChange) {
  SceneChange scene;
  Film film(CV_8UC1, 0.6);
  const auto show_flickering = [&](const cv::Mat& picture, int frames) {
    SceneChange::Observation seen;
    for (int k = 0; k < frames; ++k) seen = scene.update(film.next(flickering(picture, 0.05, 12.0, k)));
    return seen;
  };
  show_flickering(film.with_square(100), 30);
  scene.accept();
  EXPECT_FALSE(show_flickering(film.with_square(100), 30).changed);

  cv::Mat small = film.with_square(100);
  cv::rectangle(small, {240, 40, 12, 12}, cv::Scalar::all(40), cv::FILLED);
  EXPECT_TRUE(show_flickering(small, 1).changed) << "a small dark thing beside it";
  EXPECT_TRUE(show_flickering(small, 20).settled);
  EXPECT_TRUE(show_flickering(film.empty(), 20).changed) << "it is gone";
  EXPECT_TRUE(show_flickering(film.with_square(104), 20).changed) << "it moved by half a block";
  bool settled = false;
  for (int k = 0; k < 80; ++k)
    settled =
        scene.update(film.next(flickering(film.with_square(120 + k), 0.05, 12.0, k))).settled || settled;
  EXPECT_FALSE(settled) << "a pixel a frame is still motion";
}

TEST(SceneChange, ASteadyLampDoesNotFlicker) {
  for (const double noise : {0.0, 0.6, 4.0}) {
    SceneChange scene;
    Film film(CV_8UC1, noise);
    show(scene, film, film.with_square(100), 40);
    EXPECT_LT(scene.flicker(), 0.005) << noise;
  }
  SceneChange fresh;
  EXPECT_EQ(fresh.flicker(), 0.0);
}

TEST(SceneChange, FlickerIsMeasuredAnewAfterAChange) {
  SceneChange scene;
  Film film(CV_8UC1, 0.0);
  for (int k = 0; k < 40; ++k) scene.update(film.next(flickering(film.with_square(100), 0.08, 5.0, k)));
  EXPECT_GT(scene.flicker(), 0.05);
  scene.update(film.next(film.with_square(160)));
  EXPECT_EQ(scene.flicker(), 0.0) << "what was measured belongs to another scene";
  show(scene, film, film.with_square(160));
  EXPECT_LT(scene.flicker(), 0.005);
}

TEST(SceneChange, ALampThatIsDimmedByAThirdIsAChange) {
  SceneChange scene;
  Film film(CV_8UC1, 0.6);
  show(scene, film, film.with_square(100));
  scene.accept();
  cv::Mat dimmed;
  film.with_square(100).convertTo(dimmed, -1, 0.66);
  EXPECT_TRUE(show(scene, film, dimmed).changed);
}

TEST(SceneChange, TheThresholdGrowsWithTheCamerasNoise) {
  // The median of the difference of two block means, noise · √2 / 8, over its standard deviation is 0.674;
  // grey levels are whole, so the measurement is off by up to half of one.
  for (const double noise : {8.0, 16.0, 30.0}) {
    SceneChange scene;
    Film film(CV_8UC1, noise);
    const cv::Mat ground(240, 320, CV_8UC1, cv::Scalar::all(128));  // far from black, where noise is cut off
    show(scene, film, ground, 20);
    EXPECT_NEAR(scene.threshold(), 6.5 * noise * std::sqrt(2.0) / 8.0, 0.5 * 6.5 * 1.4826) << noise;
  }
}

TEST(SceneChange, SixteenBitPicturesAreMeasuredInTheSameLevels) {
  SceneChange scene;
  const auto frame_of = [](int k, int level) {
    Frame frame;
    frame.exposure_start = TimePoint{} + milliseconds(33) * k;
    frame.image = cv::Mat(240, 320, CV_16UC1, cv::Scalar(257.0 * level));
    return frame;
  };
  for (int k = 0; k < 12; ++k) scene.update(frame_of(k, 10));
  scene.accept();
  EXPECT_FALSE(scene.update(frame_of(12, 13)).changed) << "three levels are the smallest threshold";
  EXPECT_TRUE(scene.update(frame_of(13, 14)).changed);
}

TEST(SceneChange, RefusesABlockThatIsNone) {
  SceneChangeOptions options;
  options.block = 1;
  EXPECT_THROW(SceneChange{options}, std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
