#include "core/recognition/parts_recognizer.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "core/learning/calibration/decision_calibration.h"
#include "core/learning/parts_learning.h"
#include "core/recognition/decision.h"
#include "tests/support/drawn_pictures.h"
#include "tests/support/parts_world.h"

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

/// A decision by the weights that stand before any view was seen.
const DecisionModel& decision() {
  static const DecisionModel before = [] {
    DecisionModel made;
    made.weights = prior_weights(ViewColors::none);
    return made;
  }();
  return before;
}

TEST(PartsRecognizer, NamesObjectAndPoseOfViewsItHasNotSeen) {
  PartsRecognizer recognizer(model(), decision());
  for (unsigned o = 0; o < objects; ++o) {
    const double truth = 37.0 + 50.0 * o;
    const auto votes = recognizer.look(test::DrawnObject(20 + o).view(truth)).vote();
    ASSERT_EQ(votes.ranked().front().object, o);
    const PartsAnswer answer = votes.settle(o);
    EXPECT_LT(test::turn_error(answer.poses.front().q[0], truth), 2.0);
    EXPECT_GT(answer.poses.front().votes, 0.7);
  }
}

TEST(PartsRecognizer, FindsAnObjectOfWhichAFifthIsOccluded) {
  PartsRecognizer recognizer(model(), decision());
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
  PartsRecognizer recognizer(model(), decision());
  for (const int brightness : {0, 90, 255}) {
    for (unsigned o = 0; o < objects; ++o) {
      const double truth = 52.0 + 50.0 * o;
      cv::Mat picture = test::DrawnObject(20 + o).view(truth);
      picture(cv::Rect(8, 18, 24, 24)).setTo(brightness);
      const PartsIdentification found = recognizer.look(picture).vote().identify_occluded();
      ASSERT_EQ(found.best.object, o) << "under an occluder of brightness " << brightness;
      EXPECT_LT(found.second_evidence, found.evidence - 1.0);
      EXPECT_LT(test::turn_error(found.best.poses.front().q[0], truth), 4.0)
          << "object " << o << " under an occluder of brightness " << brightness;
    }
  }
}

TEST(PartsRecognizer, StartsOccludedPosesOnTheSideOfTheViewThatItsNeighboursVoteFor) {
  // Views 30° apart, poses 12° beside one: a start on the other side is 24° off, more than a round may move.
  std::vector<PartsViews> views;
  for (unsigned o = 0; o < 3; ++o) views.push_back(test::turntable_views(test::DrawnObject(20 + o), 30.0));
  const PartsModel coarse = learn_parts(views, {});
  PartsRecognizer recognizer(coarse, decision());
  int right = 0;
  int shown = 0;
  for (std::size_t o = 0; o < 3; ++o) {
    const std::array<std::size_t, 1> shortlist{o};
    for (int i = 0; i < 12; ++i) {
      const double truth = 30.0 * i + (i % 2 == 0 ? 12.0 : -12.0);
      cv::Mat picture = test::DrawnObject(20 + static_cast<unsigned>(o)).view(truth);
      picture(cv::Rect(8, 18, 16, 16)).setTo(0);
      const PartsIdentification found = recognizer.look(picture).vote(shortlist).identify_occluded();
      ++shown;
      right += test::turn_error(found.best.poses.front().q[0], truth) < 8.0 ? 1 : 0;
    }
  }
  EXPECT_GE(right, shown * 9 / 10) << "of " << shown;
}

TEST(PartsRecognizer, HasMoreEvidenceForOccludedKnownObjectsThanForUnknownOnes) {
  PartsRecognizer recognizer(model(), decision());
  const auto evidence_of_occluded = [&](cv::Mat picture) {
    picture(cv::Rect(8, 18, 24, 24)).setTo(0);
    return recognizer.look(picture).vote().identify_occluded().evidence;
  };
  std::vector<double> known;
  std::vector<double> unknown;
  constexpr int shown = 20;
  for (int i = 0; i < shown; ++i) {
    known.push_back(evidence_of_occluded(
        test::DrawnObject(20 + static_cast<unsigned>(i % objects)).view(52.0 + 17.0 * i)));
    unknown.push_back(
        evidence_of_occluded(test::DrawnObject(60 + static_cast<unsigned>(i)).view(52.0 + 17.0 * i)));
  }
  std::ranges::sort(known);
  std::ranges::sort(unknown);
  EXPECT_GT(known[shown / 4], unknown[shown * 3 / 4]);
}

TEST(PartsRecognizer, MaskingExplainsMuchWhereSomethingOccludesAndLittleWhereNothingDoes) {
  PartsRecognizer recognizer(model(), decision());
  cv::Mat picture = test::DrawnObject(21).view(52.0);
  const auto gain_of = [&](const cv::Mat& shown) {
    const auto votes = recognizer.look(shown).vote();
    return votes.gain_of_masking(votes.identify_occluded().best);
  };
  EXPECT_LT(gain_of(picture), 1.0);
  picture(cv::Rect(8, 18, 28, 28)).setTo(0);
  EXPECT_GT(gain_of(picture), 1.0);
}

TEST(PartsRecognizer, GivesAnUnknownObjectFewerVotesThanAKnownOne) {
  PartsRecognizer recognizer(model(), decision());
  const double known = recognizer.look(test::DrawnObject(20).view(7.0)).vote().match(0).votes;
  const auto votes = recognizer.look(test::DrawnObject(99).view(7.0)).vote();
  EXPECT_GT(known - 0.1, votes.match(votes.ranked().front().object).votes);
}

TEST(PartsRecognizer, VotesAsIfViewsOrAnObjectHadNotBeenLearned) {
  PartsRecognizer recognizer(model(), decision());
  const auto look = recognizer.look(test::DrawnObject(22).view(45.0));  // learned view 3
  const double present = look.vote().match(2).votes;
  const int view = 3;
  const double left_out = look.vote().without(2, {&view, 1}).match(2).votes;
  EXPECT_LT(left_out, present - 0.05);
  EXPECT_GT(left_out, 0.1) << "the other views are there";
  std::vector<int> all(24);
  std::iota(all.begin(), all.end(), 0);
  const auto without = look.vote().without(2, all);
  EXPECT_NE(without.ranked().front().object, 2U);
  EXPECT_EQ(without.match(2).votes, 0.0);
  EXPECT_EQ(without.ranked().back().object, 2U);
  EXPECT_EQ(look.vote().match(2).votes, present) << "what was excluded is back";
}

TEST(PartsRecognizer, ComparesColoursWithThoseOfTheViewsButTheOnesLeftOut) {
  const auto& world = testing::parts_world();
  const PartsModel& parts = *world.model->parts;
  PartsRecognizer recognizer(parts, world.model->decision);
  for (const int side : {64, 128}) {
    cv::Mat picture(side, side, CV_8UC3, cv::Scalar(30, 120, 160));
    picture.rowRange(0, side / 2).setTo(cv::Scalar(160, 60, 30));
    const auto look = recognizer.look(picture);
    const ChromaticityRoots roots = chromaticity_roots(chromaticity_map(picture, parts.background));
    const std::vector<int> most{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17};
    for (std::size_t o = 0; o < parts.objects.size(); ++o) {
      const auto match = look.color_match(o);
      ASSERT_TRUE(match);
      EXPECT_EQ(match->distance, parts.colors[o].distance(roots));
      EXPECT_EQ(match->typical, parts.calibration[o].typical_color);
      EXPECT_EQ(look.color_match(o, most)->distance, parts.colors[o].distance(roots, most));
    }
  }
  PartsRecognizer of_grey(model(), decision());
  EXPECT_FALSE(of_grey.look(test::DrawnObject(20).view(0.0)).color_match(0));
}

TEST(PartsRecognizer, RefusesVotesOfAPictureThatIsNoLongerTheLast) {
  PartsRecognizer recognizer(model(), decision());
  const auto first = recognizer.look(test::DrawnObject(20).view(7.0));
  const auto votes = first.vote();
  EXPECT_GT(votes.match(0).votes, 0.0);
  const auto again = first.vote();
  EXPECT_THROW((void)votes.ranked(), std::logic_error) << "other votes were taken since";
  EXPECT_THROW((void)votes.match(0), std::logic_error);
  EXPECT_THROW((void)votes.occluded_share(0), std::logic_error);
  EXPECT_THROW((void)votes.identify_occluded(), std::logic_error);
  EXPECT_NO_THROW((void)again.settle(0));
  const auto second = recognizer.look(test::DrawnObject(21).view(7.0));
  EXPECT_THROW((void)first.vote(), std::logic_error) << "another picture was looked at since";
  EXPECT_THROW((void)first.pose_picture(), std::logic_error);
  EXPECT_THROW((void)again.settle(0), std::logic_error);
  EXPECT_EQ(second.vote().ranked().front().object, 1U);
}

TEST(PartsRecognizer, RefusesObjectsThatWereNotVotedFor) {
  PartsRecognizer recognizer(model(), decision());
  const std::vector<std::size_t> shortlist{1, 3};
  const auto votes = recognizer.look(test::DrawnObject(21).view(7.0)).vote(shortlist);
  EXPECT_EQ(votes.ranked().size(), 2U);
  EXPECT_NO_THROW((void)votes.settle(3));
  EXPECT_THROW((void)votes.match(0), std::invalid_argument);
  EXPECT_THROW((void)votes.occluded_share(0), std::invalid_argument);
  EXPECT_THROW((void)votes.without(0, {}), std::invalid_argument);
  EXPECT_THROW((void)votes.settle(2), std::invalid_argument);
}

TEST(PartsRecognizer, GivesTheSameAnswerWhateverItLookedAtBefore) {
  PartsRecognizer used(model(), decision());
  cv::Mat occluded = test::DrawnObject(22).view(52.0);
  occluded(cv::Rect(8, 18, 24, 24)).setTo(0);
  (void)used.look(test::DrawnObject(24).view(200.0)).vote().identify_occluded();
  (void)used.look(occluded).vote().identify_occluded();
  PartsRecognizer fresh(model(), decision());
  for (const cv::Mat& picture : {test::DrawnObject(20).view(7.0), occluded}) {
    const PartsIdentification a = used.look(picture).vote().identify_occluded();
    const PartsIdentification b = fresh.look(picture).vote().identify_occluded();
    EXPECT_EQ(a.best.object, b.best.object);
    EXPECT_EQ(a.second_evidence, b.second_evidence);
    EXPECT_EQ(a.evidence, b.evidence);
    ASSERT_EQ(a.best.poses.size(), b.best.poses.size());
    for (std::size_t i = 0; i < a.best.poses.size(); ++i) EXPECT_EQ(a.best.poses[i].q, b.best.poses[i].q);
  }
}

TEST(PartsRecognizer, SettlesPosesAlikeWhateverItLookedAtBefore) {
  PartsRecognizer used(model(), decision());
  for (const unsigned o : {0U, 3U, 1U}) {
    // Moved a little: the votes after alignment are those of other pixels.
    const cv::Mat picture = test::DrawnObject(20 + o).view(100.0 + 7.0 * o, 64, 1.5, -1.0);
    PartsRecognizer fresh(model(), decision());
    const PartsAnswer a = used.look(picture).vote().settle(o);
    const PartsAnswer b = fresh.look(picture).vote().settle(o);
    ASSERT_EQ(a.poses.size(), b.poses.size());
    for (std::size_t i = 0; i < a.poses.size(); ++i) {
      EXPECT_EQ(a.poses[i].q, b.poses[i].q);
      EXPECT_EQ(a.poses[i].votes, b.poses[i].votes);
      EXPECT_EQ(a.poses[i].merit, b.poses[i].merit);
    }
  }
}

TEST(PartsRecognizer, OrdersPosesByMeritAndGivesEachObjectAtMostOnce) {
  PartsRecognizer recognizer(model(), decision());
  const PartsIdentification found =
      recognizer.look(test::DrawnObject(23).view(133.0)).vote().identify_occluded();
  EXPECT_EQ(found.best.object, 3U);
  ASSERT_TRUE(found.second);
  EXPECT_NE(found.second->object, found.best.object);
  EXPECT_LT(found.second_evidence, found.evidence - 1.0);
  for (std::size_t i = 1; i < found.best.poses.size(); ++i)
    EXPECT_LE(found.best.poses[i].merit, found.best.poses[i - 1].merit);
  EXPECT_LT(test::turn_error(found.best.poses.front().q[0], 133.0), 3.0);
}

TEST(PartsRecognizer, HasAsMuchEvidenceForEitherOfTwins) {
  std::vector<PartsViews> views{test::turntable_views(test::DrawnObject(20), 15.0),
                                test::turntable_views(test::DrawnObject(20), 15.0),
                                test::turntable_views(test::DrawnObject(21), 15.0)};
  const PartsModel twins = learn_parts(views, {});
  PartsRecognizer recognizer(twins, decision());
  const auto lead_of = [&](unsigned object) {
    const auto found = recognizer.look(test::DrawnObject(object).view(37.0)).vote().identify_occluded();
    return found.evidence - found.second_evidence;
  };
  EXPECT_LT(lead_of(20), 0.5);
  EXPECT_GT(lead_of(21), 1.0);
}

}  // namespace
}  // namespace eigenpose
