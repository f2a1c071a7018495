#include "core/recognition/parts_recognizer.h"

#include <limits>

#include <gtest/gtest.h>

#include "core/learning/calibration/occlusion_calibration.h"
#include "core/learning/calibration/parts_calibration.h"
#include "core/recognition/decision.h"
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
    const auto votes = recognizer.look(test::DrawnObject(20 + o).view(truth)).vote();
    ASSERT_EQ(votes.ranked().front().object, o);
    const PartsAnswer answer = votes.settle(o);
    EXPECT_LT(test::turn_error(answer.poses.front().q[0], truth), 2.0);
    EXPECT_LT(answer.score, 0.3);
  }
}

TEST(PartsRecognizer, FindsAnObjectOfWhichAFifthIsOccluded) {
  PartsRecognizer recognizer(model());
  for (unsigned o = 0; o < objects; ++o) {
    const double truth = 52.0 + 50.0 * o;
    cv::Mat picture = test::DrawnObject(20 + o).view(truth);
    picture(cv::Rect(8, 18, 28, 28)).setTo(0);
    const auto votes = recognizer.look(picture).vote();
    ASSERT_EQ(votes.ranked().front().object, o);
    const PartsAnswer answer = votes.settle(o);
    EXPECT_GT(answer.occluded, 0.1);
    EXPECT_LT(test::turn_error(answer.poses.front().q[0], truth), 4.0);
  }
}

TEST(PartsRecognizer, FollowsThePoseOfAnOccludedObjectWhateverTheOccluderLooksLike) {
  PartsRecognizer recognizer(model());
  for (const int brightness : {0, 90, 255}) {
    for (unsigned o = 0; o < objects; ++o) {
      const double truth = 52.0 + 50.0 * o;
      cv::Mat picture = test::DrawnObject(20 + o).view(truth);
      picture(cv::Rect(8, 18, 24, 24)).setTo(brightness);
      const PartsIdentification found = recognizer.look(picture).identify();
      ASSERT_EQ(found.best.object, o) << "under an occluder of brightness " << brightness;
      EXPECT_FALSE(found.tie);
      EXPECT_LT(test::turn_error(found.best.poses.front().q[0], truth), 4.0)
          << "object " << o << " under an occluder of brightness " << brightness;
    }
  }
}

TEST(PartsRecognizer, AcceptsOccludedKnownObjectsAndFewUnknownOnes) {
  std::vector<PartsViews> views;
  for (unsigned o = 0; o < objects; ++o)
    views.push_back(test::turntable_views(test::DrawnObject(20 + o), 15.0));
  PartsModel learned = model();
  calibrate_parts(learned, views, {});
  const double threshold = occlusion_threshold(measure_occlusion(learned, views, {}), 0.1);
  PartsRecognizer recognizer(learned);
  const auto accepted = [&](cv::Mat picture) {
    picture(cv::Rect(8, 18, 24, 24)).setTo(0);
    const PartsIdentification found = recognizer.look(picture).identify();
    return found.best.occluded > learned.calibration[found.best.object].covered_share &&
           found.best.occluded <= max_occluded_share && found.evidence > threshold;
  };
  int known = 0;
  int unknown = 0;
  constexpr int shown = 20;
  for (int i = 0; i < shown; ++i) {
    known +=
        accepted(test::DrawnObject(20 + static_cast<unsigned>(i % objects)).view(52.0 + 17.0 * i)) ? 1 : 0;
    unknown += accepted(test::DrawnObject(60 + static_cast<unsigned>(i)).view(52.0 + 17.0 * i)) ? 1 : 0;
  }
  EXPECT_GE(known, shown * 3 / 4);
  EXPECT_LE(unknown, known / 2) << "of " << shown << "; few objects were learned";
}

TEST(OcclusionThreshold, IsConformalAndForgetsTheObjectLeftOut) {
  const std::vector<OcclusionEvidence> unknown = {{0, 1, 5.0}, {1, 0, 9.0}, {2, 1, 3.0}, {2, 0, 7.0}};
  // One of five, counting the new one, is the largest.
  EXPECT_EQ(occlusion_threshold(unknown, 0.2), 9.0);
  EXPECT_EQ(occlusion_threshold(unknown, 0.4), 7.0);
  EXPECT_EQ(occlusion_threshold(unknown, 0.001), 9.0)
      << "four unknown views support no smaller rate than a fifth";
  EXPECT_EQ(occlusion_threshold(unknown, 0.25, 0), 4.0) << "no less is ever enough";
  EXPECT_EQ(occlusion_threshold({}, 0.1), std::numeric_limits<double>::infinity());
}

TEST(OcclusionCalibration, NeedsTwoObjects) {
  PartsModel one;
  EXPECT_TRUE(measure_occlusion(one, std::vector<PartsViews>(1), {}).empty());
}

TEST(PartsRecognizer, GivesAnUnknownObjectAWorseScoreThanAKnownOne) {
  PartsRecognizer recognizer(model());
  const double known = recognizer.look(test::DrawnObject(20).view(7.0)).vote().settle(0).score;
  const auto votes = recognizer.look(test::DrawnObject(99).view(7.0)).vote();
  const double unknown = votes.settle(votes.ranked().front().object).score;
  EXPECT_LT(known + 0.1, unknown);
}

TEST(PartsRecognizer, RefusesVotesOfAPictureThatIsNoLongerTheLast) {
  PartsRecognizer recognizer(model());
  const auto first = recognizer.look(test::DrawnObject(20).view(7.0));
  const auto votes = first.vote();
  EXPECT_GT(votes.share_of(0), 0.0);
  const auto again = first.vote();
  EXPECT_THROW((void)votes.ranked(), std::logic_error) << "other votes were taken since";
  EXPECT_THROW((void)votes.share_of(0), std::logic_error);
  EXPECT_NO_THROW((void)again.settle(0));
  const auto second = recognizer.look(test::DrawnObject(21).view(7.0));
  EXPECT_THROW((void)first.vote(), std::logic_error) << "another picture was looked at since";
  EXPECT_THROW((void)first.identify(), std::logic_error);
  EXPECT_THROW((void)first.pose_picture(), std::logic_error);
  EXPECT_THROW((void)again.settle(0), std::logic_error);
  EXPECT_EQ(second.vote().ranked().front().object, 1U);
}

TEST(PartsRecognizer, RefusesObjectsThatWereNotVotedFor) {
  PartsRecognizer recognizer(model());
  const std::vector<std::size_t> shortlist{1, 3};
  const auto votes = recognizer.look(test::DrawnObject(21).view(7.0)).vote(shortlist);
  EXPECT_EQ(votes.ranked().size(), 2U);
  EXPECT_NO_THROW((void)votes.settle(3));
  EXPECT_THROW((void)votes.share_of(0), std::invalid_argument);
  EXPECT_THROW((void)votes.settle(2), std::invalid_argument);
}

TEST(PartsRecognizer, GivesTheSameAnswerWhateverItLookedAtBefore) {
  PartsRecognizer used(model());
  cv::Mat occluded = test::DrawnObject(22).view(52.0);
  occluded(cv::Rect(8, 18, 24, 24)).setTo(0);
  (void)used.look(test::DrawnObject(24).view(200.0)).identify();
  (void)used.look(occluded).identify();
  PartsRecognizer fresh(model());
  for (const cv::Mat& picture : {test::DrawnObject(20).view(7.0), occluded}) {
    const PartsIdentification a = used.look(picture).identify();
    const PartsIdentification b = fresh.look(picture).identify();
    EXPECT_EQ(a.best.object, b.best.object);
    EXPECT_EQ(a.best.score, b.best.score);
    EXPECT_EQ(a.evidence, b.evidence);
    ASSERT_EQ(a.best.poses.size(), b.best.poses.size());
    for (std::size_t i = 0; i < a.best.poses.size(); ++i) EXPECT_EQ(a.best.poses[i].q, b.best.poses[i].q);
  }
}

TEST(PartsRecognizer, OrdersPosesByMeritAndGivesEachObjectAtMostOnce) {
  PartsRecognizer recognizer(model());
  for (const Occlusion occlusion : {Occlusion::measured, Occlusion::assumed}) {
    const PartsIdentification found =
        recognizer.look(test::DrawnObject(23).view(133.0)).identify({}, occlusion);
    EXPECT_EQ(found.best.object, 3U);
    ASSERT_TRUE(found.second);
    EXPECT_NE(found.second->object, found.best.object);
    EXPECT_LT(found.second_share, 1.0);
    EXPECT_FALSE(found.tie);
    for (std::size_t i = 1; i < found.best.poses.size(); ++i)
      EXPECT_LE(found.best.poses[i].merit, found.best.poses[i - 1].merit);
    EXPECT_LT(test::turn_error(found.best.poses.front().q[0], 133.0), 3.0);
  }
}

TEST(PartsRecognizer, CallsTwinsATie) {
  std::vector<PartsViews> views{test::turntable_views(test::DrawnObject(20), 15.0),
                                test::turntable_views(test::DrawnObject(20), 15.0),
                                test::turntable_views(test::DrawnObject(21), 15.0)};
  const PartsModel twins = learn_parts(views, {});
  PartsRecognizer recognizer(twins);
  for (const Occlusion occlusion : {Occlusion::measured, Occlusion::assumed}) {
    EXPECT_TRUE(recognizer.look(test::DrawnObject(20).view(37.0)).identify({}, occlusion).tie);
    EXPECT_FALSE(recognizer.look(test::DrawnObject(21).view(37.0)).identify({}, occlusion).tie);
  }
}

}  // namespace
}  // namespace eigenpose
