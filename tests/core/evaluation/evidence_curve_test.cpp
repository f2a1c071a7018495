#include "core/evaluation/evidence_curve.h"

#include <algorithm>
#include <limits>
#include <random>

#include <gmock/gmock.h>

#include "tests/core/evaluation/made_records.h"

namespace eigenpose {
namespace {

using testing::made_record;
using testing::nothing_found;
using testing::unknown_object;

constexpr double infinity = std::numeric_limits<double>::infinity();

RegionRecord known_with(double evidence, std::size_t said = 0) {
  return made_record(0, said, Verdict::recognized, evidence);
}

RegionRecord unknown_with(double evidence) {
  return unknown_object(made_record(0, 1, Verdict::unknown, evidence));
}

void expect_point(const EvidenceCurve::Point& point, const EvidenceCurve::Point& expected) {
  EXPECT_EQ(point.threshold, expected.threshold);
  EXPECT_DOUBLE_EQ(point.false_rejection, expected.false_rejection) << expected.threshold;
  EXPECT_DOUBLE_EQ(point.false_acceptance, expected.false_acceptance) << expected.threshold;
  EXPECT_DOUBLE_EQ(point.answered_wrong, expected.answered_wrong) << expected.threshold;
}

TEST(EvidenceCurve, HasAPointForEachEvidenceAndOneWhereNothingIsAccepted) {
  const std::vector records{known_with(3.0),  known_with(2.0, 1), known_with(5.0),
                            nothing_found(0), unknown_with(1.0),  unknown_with(3.0)};
  const EvidenceCurve curve = evidence_curve(records);
  EXPECT_EQ(curve.known, 4U);
  EXPECT_EQ(curve.unknown, 2U);
  ASSERT_EQ(curve.points.size(), 5U);
  expect_point(curve.points[0], {1.0, 0.25, 1.0, 0.25});
  expect_point(curve.points[1], {2.0, 0.25, 0.5, 0.25});
  expect_point(curve.points[2], {3.0, 0.5, 0.5, 0.0});
  expect_point(curve.points[3], {5.0, 0.75, 0.0, 0.0});
  expect_point(curve.points[4], {infinity, 1.0, 0.0, 0.0});
}

TEST(EvidenceCurve, EvidenceThatEqualsTheThresholdIsAccepted) {
  const EvidenceCurve curve =
      evidence_curve(std::vector{known_with(2.0), known_with(2.0), unknown_with(2.0), unknown_with(2.0)});
  ASSERT_EQ(curve.points.size(), 2U) << "one point for all ties";
  expect_point(curve.points[0], {2.0, 0.0, 1.0, 0.0});
  expect_point(curve.points[1], {infinity, 1.0, 0.0, 0.0});
}

TEST(EvidenceCurve, MarksThePointInUseByWhatEachRegionRequired) {
  std::vector records{known_with(3.0),  known_with(1.0),   known_with(4.0, 1),
                      nothing_found(0), unknown_with(2.0), unknown_with(1.0)};
  for (RegionRecord& record : records) record.required_evidence = 2.0;
  expect_point(evidence_curve(records).in_use, {2.0, 0.5, 0.5, 0.25});
  records[1].required_evidence = 0.5;  // is accepted now
  records[4].required_evidence = 2.5;  // is rejected now
  expect_point(evidence_curve(records).in_use, {2.0, 0.25, 0.0, 0.25});
}

TEST(EvidenceCurve, AWrongObjectBelowTheThresholdInUseIsRejectedAndNoWrongAnswer) {
  std::vector records{known_with(3.0), known_with(1.0, 1), known_with(4.0, 1), known_with(5.0),
                      unknown_with(1.0)};
  for (RegionRecord& record : records) record.required_evidence = 2.0;
  expect_point(evidence_curve(records).in_use, {2.0, 0.25, 0.0, 0.25});
}

TEST(EvidenceCurve, ThePointInUseLiesOnTheCurveWhereAllRequireTheSame) {
  std::mt19937 random(1);
  std::normal_distribution<double> draw;
  std::vector<RegionRecord> records;
  for (int i = 0; i < 200; ++i)
    records.push_back(i % 2 == 0 ? known_with(1.0 + draw(random)) : unknown_with(draw(random)));
  for (RegionRecord& record : records) record.required_evidence = 0.7;
  const EvidenceCurve curve = evidence_curve(records);
  const auto next = std::ranges::find_if(curve.points, [](const auto& p) { return p.threshold >= 0.7; });
  ASSERT_NE(next, curve.points.end());
  EXPECT_EQ(curve.in_use.threshold, 0.7);
  EXPECT_EQ(curve.in_use.false_rejection, next->false_rejection);
  EXPECT_EQ(curve.in_use.false_acceptance, next->false_acceptance);
  for (std::size_t i = 1; i < curve.points.size(); ++i) {
    EXPECT_LT(curve.points[i - 1].threshold, curve.points[i].threshold);
    EXPECT_LE(curve.points[i - 1].false_rejection, curve.points[i].false_rejection);
    EXPECT_GE(curve.points[i - 1].false_acceptance, curve.points[i].false_acceptance);
  }
}

TEST(EvidenceCurve, AViewWithoutAMatchIsRejectedAtEveryThreshold) {
  RegionRecord at_border = known_with(9.0);
  at_border.verdict = Verdict::touches_border;
  RegionRecord undefined = known_with(std::numeric_limits<double>::quiet_NaN());
  const EvidenceCurve curve =
      evidence_curve(std::vector{at_border, undefined, unknown_object(nothing_found(1)), unknown_with(-7.0)});
  ASSERT_EQ(curve.points.size(), 2U);
  expect_point(curve.points[0], {-7.0, 1.0, 0.5, 0.0});
  EXPECT_DOUBLE_EQ(curve.in_use.false_rejection, 1.0);
}

TEST(EvidenceCurve, OfNothingMatchedIsOnePoint) {
  const EvidenceCurve curve = evidence_curve(std::vector{nothing_found(0), unknown_object(nothing_found(1))});
  ASSERT_EQ(curve.points.size(), 1U);
  expect_point(curve.points[0], {infinity, 1.0, 0.0, 0.0});
  expect_point(curve.in_use, {infinity, 1.0, 0.0, 0.0});
}

TEST(EvidenceCurve, NeedsKnownAndUnknownObjects) {
  EXPECT_THROW(evidence_curve(std::vector{known_with(1.0)}), std::invalid_argument);
  EXPECT_THROW(evidence_curve(std::vector{unknown_with(1.0)}), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
