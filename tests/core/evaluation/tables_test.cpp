#include "core/evaluation/tables.h"

#include <limits>

#include <gmock/gmock.h>

#include "tests/core/evaluation/made_records.h"

namespace eigenpose {
namespace {

using testing::made_record;
using testing::nothing_found;
using testing::unknown_object;

TEST(RecordsCsv, HasOneLineForEachShownRegion) {
  RegionRecord right = made_record(1, 1, Verdict::recognized, 4.5);
  right.view = 3;
  right.true_q = {30.0, -2.5};
  right.said_q = {31.0, -2.0};
  right.required_evidence = 1.25;
  right.confidence = 0.75;
  right.pose_error = 1.0;
  right.other_pose_error = 179.0;
  RegionRecord ambiguous = made_record(0, 1, Verdict::ambiguous, -1.0);
  ambiguous.true_q = {5.0};
  const std::vector records{right,
                            ambiguous,
                            made_record(0, 1, Verdict::recognized),
                            nothing_found(0),
                            unknown_object(made_record(0, 1, Verdict::ambiguous, 2.0)),
                            unknown_object(made_record(0, 1, Verdict::unknown, 2.0))};
  EXPECT_EQ(records_csv(records, std::vector<std::string>{"mug", "a,b"}),
            "object,known,view,true_q,verdict,said,said_q,answer,evidence,required_evidence,confidence,"
            "pose_error,other_pose_error\r\n"
            "\"a,b\",1,3,30 -2.5,recognized,\"a,b\",31 -2,right,4.5,1.25,0.75,1,179\r\n"
            "mug,1,0,5,ambiguous,\"a,b\",,withheld,-1,0,0,,\r\n"
            "mug,1,0,,recognized,\"a,b\",,wrong,0,0,0,,\r\n"
            "mug,1,0,,nothing_found,,,withheld,,,,,\r\n"
            "mug,0,0,,ambiguous,\"a,b\",,accepted,2,0,0,,\r\n"
            "mug,0,0,,unknown,\"a,b\",,rejected,2,0,0,,\r\n");
}

TEST(CurveCsv, MarksThePointInUseWhereItsThresholdBelongs) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EvidenceCurve curve;
  curve.points = {{-1.0, 0.0, 1.0, 0.125}, {2.0, 0.25, 0.5, 0.0}, {infinity, 1.0, 0.0, 0.0}};
  curve.in_use = {2.0, 0.25, 0.5, 0.0};
  EXPECT_EQ(curve_csv(curve),
            "threshold,false_rejection,false_acceptance,answered_wrong,in_use\r\n"
            "-1,0,1,0.125,0\r\n"
            "2,0.25,0.5,0,1\r\n"
            "2,0.25,0.5,0,0\r\n"
            "inf,1,0,0,0\r\n");
  curve.in_use.threshold = infinity;
  EXPECT_THAT(curve_csv(curve), ::testing::EndsWith("inf,0.25,0.5,0,1\r\ninf,1,0,0,0\r\n"));
}

TEST(ReliabilityCsv, LeavesTheValuesOfAnEmptyBinEmpty) {
  Reliability reliability;
  reliability.bins[9] = {.regions = 4, .right = 3, .mean_confidence = 0.95};
  const std::string text = reliability_csv(reliability);
  EXPECT_THAT(text, ::testing::StartsWith("from,to,regions,right,mean_confidence,right_share\r\n"
                                          "0,0.1,0,0,,\r\n0.1,0.2,0,0,,\r\n"));
  EXPECT_THAT(text, ::testing::EndsWith("0.8,0.9,0,0,,\r\n0.9,1,4,3,0.95,0.75\r\n"));
}

}  // namespace
}  // namespace eigenpose
