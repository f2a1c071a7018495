#include "core/recognition/parts_recognizer.h"

#include <limits>

#include <gtest/gtest.h>

#include "core/learning/calibration/occlusion_calibration.h"
#include "core/learning/calibration/parts_calibration.h"
#include "tests/support/drawn_pictures.h"

namespace eigenpose {
namespace {

constexpr int objects = 5;

const PartsModel& model() {
  static const PartsModel learned = [] {
    std::vector<PartsViews> views;
    for (unsigned o = 0; o < objects; ++o)
      views.push_back(test::turntable_views(test::DrawnObject(20 + o), 15.0));
    return learn_parts(views, {});
  }();
  return learned;
}

TEST(PartsRecognizer, NamesObjectAndPoseOfViewsItHasNotSeen) {
  PartsRecognizer recognizer(model());
  for (unsigned o = 0; o < objects; ++o) {
    const double truth = 37.0 + 50.0 * o;
    recognizer.look(test::DrawnObject(20 + o).view(truth));
    const auto votes = recognizer.vote();
    ASSERT_EQ(votes.front().object, o);
    const PartsAnswer answer = recognizer.settle(o);
    EXPECT_LT(test::turn_error(answer.poses.front().q[0], truth), 2.0);
    EXPECT_LT(answer.score, 0.3);
  }
}

TEST(PartsRecognizer, FindsAnObjectOfWhichAFifthIsCovered) {
  PartsRecognizer recognizer(model());
  for (unsigned o = 0; o < objects; ++o) {
    const double truth = 52.0 + 50.0 * o;
    cv::Mat picture = test::DrawnObject(20 + o).view(truth);
    picture(cv::Rect(8, 18, 28, 28)).setTo(0);
    recognizer.look(picture);
    ASSERT_EQ(recognizer.vote().front().object, o);
    const PartsAnswer answer = recognizer.settle(o);
    EXPECT_GT(answer.covered, 0.1);
    EXPECT_LT(test::turn_error(answer.poses.front().q[0], truth), 4.0);
  }
}

TEST(PartsRecognizer, FollowsThePoseOfACoveredObjectWhateverTheCoverLooksLike) {
  PartsRecognizer recognizer(model());
  for (const int brightness : {0, 90, 255}) {
    for (unsigned o = 0; o < objects; ++o) {
      const double truth = 52.0 + 50.0 * o;
      cv::Mat picture = test::DrawnObject(20 + o).view(truth);
      picture(cv::Rect(8, 18, 24, 24)).setTo(brightness);
      recognizer.look(picture);
      const PartsIdentification found = recognizer.identify();
      ASSERT_EQ(found.best.object, o) << "under a cover of brightness " << brightness;
      EXPECT_FALSE(found.tie);
      EXPECT_LT(test::turn_error(found.best.poses.front().q[0], truth), 4.0)
          << "object " << o << " under a cover of brightness " << brightness;
    }
  }
}

TEST(PartsRecognizer, MoreSpeaksForACoveredObjectThanForStrangers) {
  std::vector<PartsViews> views;
  for (unsigned o = 0; o < objects; ++o)
    views.push_back(test::turntable_views(test::DrawnObject(20 + o), 15.0));
  PartsModel learned = model();
  calibrate_parts(learned, views, {});
  const double threshold = occlusion_threshold(measure_occlusion(learned, views, {}), 0.1);
  PartsRecognizer recognizer(learned);
  const auto accepted = [&](cv::Mat picture) {
    picture(cv::Rect(8, 18, 24, 24)).setTo(0);
    recognizer.look(picture);
    const PartsIdentification found = recognizer.identify();
    return found.best.covered > learned.calibration[found.best.object].covered_share &&
           found.best.covered <= max_occluded_share && found.evidence > threshold;
  };
  int known = 0;
  int strangers = 0;
  constexpr int shown = 20;
  for (int i = 0; i < shown; ++i) {
    known +=
        accepted(test::DrawnObject(20 + static_cast<unsigned>(i % objects)).view(52.0 + 17.0 * i)) ? 1 : 0;
    strangers += accepted(test::DrawnObject(60 + static_cast<unsigned>(i)).view(52.0 + 17.0 * i)) ? 1 : 0;
  }
  EXPECT_GE(known, shown / 2);
  EXPECT_LE(strangers, known / 2);
}

TEST(CoveredThreshold, IsConformalAndForgetsTheObjectLeftOut) {
  const std::vector<OcclusionEvidence> strangers = {{0, 1, 5.0}, {1, 0, 9.0}, {2, 1, 3.0}, {2, 0, 7.0}};
  // One of five, counting the new one, is the largest.
  EXPECT_EQ(occlusion_threshold(strangers, 0.2), 9.0);
  EXPECT_EQ(occlusion_threshold(strangers, 0.4), 7.0);
  EXPECT_EQ(occlusion_threshold(strangers, 0.001), 9.0)
      << "four strangers support no smaller rate than a fifth";
  EXPECT_EQ(occlusion_threshold(strangers, 0.25, 0), 4.0) << "no less is ever enough";
  EXPECT_EQ(occlusion_threshold({}, 0.1), std::numeric_limits<double>::infinity());
}

TEST(CoveredCalibration, NeedsTwoObjects) {
  PartsModel one;
  EXPECT_TRUE(measure_occlusion(one, std::vector<PartsViews>(1), {}).empty());
}

TEST(PartsRecognizer, GivesAStrangerAWorseScoreThanAKnownObject) {
  PartsRecognizer recognizer(model());
  recognizer.look(test::DrawnObject(20).view(7.0));
  recognizer.vote();
  const double known = recognizer.settle(0).score;
  recognizer.look(test::DrawnObject(99).view(7.0));
  const double stranger = recognizer.settle(recognizer.vote().front().object).score;
  EXPECT_LT(known + 0.1, stranger);
}

}  // namespace
}  // namespace eigenpose
