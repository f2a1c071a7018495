#include "core/image/scene_change.h"

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

TEST(SceneChange, RefusesABlockThatIsNone) {
  SceneChangeOptions options;
  options.block = 1;
  EXPECT_THROW(SceneChange{options}, std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
