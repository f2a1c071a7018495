#include "core/parts/parts_recognizer.h"

#include <gtest/gtest.h>

#include "tests/core/parts/pictures.h"

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
