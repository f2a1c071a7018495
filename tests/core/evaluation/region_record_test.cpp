#include "core/evaluation/region_record.h"

#include <gmock/gmock.h>

#include "tests/core/evaluation/made_records.h"

namespace eigenpose {
namespace {

using ::testing::ElementsAre;
using testing::made_record;
using testing::nothing_found;
using ::testing::Pair;
using testing::unknown_object;

/// Every way in which a known view can end, and three unknown ones.
std::vector<RegionRecord> one_of_each() {
  return {made_record(0, 0, Verdict::recognized),
          made_record(0, 0, Verdict::recognized),
          made_record(0, 1, Verdict::recognized),
          made_record(0, 0, Verdict::unknown),
          made_record(0, 1, Verdict::unknown),
          made_record(1, 1, Verdict::ambiguous),
          made_record(1, 0, Verdict::ambiguous),
          made_record(1, 1, Verdict::touches_border),
          made_record(1, 1, Verdict::too_small),
          nothing_found(1),
          unknown_object(made_record(0, 1, Verdict::recognized)),
          unknown_object(made_record(0, 1, Verdict::ambiguous)),
          unknown_object(made_record(1, 0, Verdict::unknown)),
          unknown_object(nothing_found(1))};
}

TEST(AnswerCounts, EveryKnownViewIsAnsweredRightAnsweredWrongOrWithheld) {
  const AnswerCounts counts = count_answers(one_of_each());
  EXPECT_EQ(counts.known, 10U);
  EXPECT_EQ(counts.answered_right, 2U);
  EXPECT_EQ(counts.answered_wrong, 1U);
  EXPECT_EQ(counts.withheld, 7U);
  EXPECT_DOUBLE_EQ(counts.answered_right_rate(), 0.2);
  EXPECT_DOUBLE_EQ(counts.answered_wrong_rate(), 0.1);
  EXPECT_DOUBLE_EQ(counts.withheld_rate(), 0.7);
}

TEST(AnswerCounts, RecognitionIsTheBestObjectWhateverTheVerdict) {
  const AnswerCounts counts = count_answers(one_of_each());
  EXPECT_EQ(counts.best_right, 6U);
  EXPECT_EQ(counts.rejected, 3U);  // unknown, at the border, too small
  EXPECT_EQ(counts.ambiguous, 1U);
  EXPECT_EQ(counts.missed, 1U);
  EXPECT_DOUBLE_EQ(counts.recognition_rate(), 0.6);
  EXPECT_DOUBLE_EQ(counts.rejected_rate(), 0.3);
  EXPECT_DOUBLE_EQ(counts.ambiguous_rate(), 0.1);
}

TEST(AnswerCounts, AnUnknownObjectIsFalselyAcceptedWhenItGetsANameEvenAnAmbiguousOne) {
  const AnswerCounts counts = count_answers(one_of_each());
  EXPECT_EQ(counts.unknown, 4U);
  EXPECT_EQ(counts.falsely_accepted, 2U);
  EXPECT_DOUBLE_EQ(counts.false_acceptance_rate().value(), 0.5);
}

TEST(AnswerCounts, HaveNoRateOfFalseAcceptancesWithoutUnknownObjects) {
  const AnswerCounts counts = count_answers(std::vector{made_record(0, 0, Verdict::recognized)});
  EXPECT_FALSE(counts.false_acceptance_rate().has_value());
  EXPECT_DOUBLE_EQ(counts.answered_right_rate(), 1.0);
}

TEST(AnswerCounts, OfNoKnownViewsAreZero) {
  const AnswerCounts counts =
      count_answers(std::vector{unknown_object(made_record(0, 1, Verdict::recognized))});
  EXPECT_DOUBLE_EQ(counts.answered_right_rate(), 0.0);
  EXPECT_DOUBLE_EQ(counts.withheld_rate(), 0.0);
  EXPECT_DOUBLE_EQ(counts.false_acceptance_rate().value(), 1.0);
}

TEST(AnswerCounts, AllWithheldIsARateOfOne) {
  const AnswerCounts counts =
      count_answers(std::vector{made_record(0, 0, Verdict::unknown), nothing_found(1)});
  EXPECT_DOUBLE_EQ(counts.withheld_rate(), 1.0);
  EXPECT_DOUBLE_EQ(counts.answered_right_rate(), 0.0);
  EXPECT_DOUBLE_EQ(counts.answered_wrong_rate(), 0.0);
  EXPECT_DOUBLE_EQ(counts.recognition_rate(), 0.5);
}

TEST(RegionRecord, IsMatchedWhereItWasComparedWithTheModel) {
  EXPECT_TRUE(made_record(0, 0, Verdict::recognized).matched());
  EXPECT_TRUE(made_record(0, 1, Verdict::ambiguous).matched());
  EXPECT_TRUE(made_record(0, 1, Verdict::unknown).matched());
  EXPECT_FALSE(made_record(0, 0, Verdict::touches_border).matched());
  EXPECT_FALSE(made_record(0, 0, Verdict::too_small).matched());
  EXPECT_FALSE(nothing_found(0).matched());
  RegionRecord nothing_said = made_record(0, 0, Verdict::unknown);
  nothing_said.said.reset();
  EXPECT_FALSE(nothing_said.matched());
}

TEST(RegionRecord, AnUnknownObjectIsNeverRight) {
  EXPECT_TRUE(made_record(0, 0, Verdict::unknown).best_is_right());
  EXPECT_FALSE(made_record(0, 1, Verdict::recognized).best_is_right());
  EXPECT_FALSE(unknown_object(made_record(0, 0, Verdict::recognized)).best_is_right());
  EXPECT_FALSE(nothing_found(0).best_is_right());
}

TEST(Confusions, NameTheBestObjectOfKnownViewsThatIsWrong) {
  EXPECT_THAT(count_confusions(one_of_each()),
              ElementsAre(Pair(Pair(0U, std::optional<std::size_t>(1)), 2U), Pair(Pair(1U, std::nullopt), 1U),
                          Pair(Pair(1U, std::optional<std::size_t>(0)), 1U)));
}

TEST(ConfusionMatrix, HasAColumnForEveryObjectAndOneForWhatIsWithheld) {
  EXPECT_THAT(confusion_matrix(one_of_each(), 2).views,
              ElementsAre(ElementsAre(2, 1, 2), ElementsAre(0, 0, 5)));
}

}  // namespace
}  // namespace eigenpose
