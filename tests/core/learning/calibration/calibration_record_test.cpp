#include "core/learning/calibration/calibration_record.h"

#include <gtest/gtest.h>

#include "core/recognition/model_searches.h"
#include "tests/support/parts_world.h"

namespace eigenpose {
namespace {

using Place = std::optional<std::size_t>;

/// Eight objects; a view of each, taken for the next one as unknown.
CalibrationRecord record_of_eight() {
  CalibrationRecord record;
  record.measured_among = 8;
  for (std::size_t o = 0; o < 8; ++o) {
    record.objects.emplace_back().misalignments.resize(1);
    record.objects[o].votes.foreign = static_cast<double>(o);
    ShownProbes shown{o, 0, true, false, {}, {(o + 1) % 8}};
    shown.probes.push_back({o, o, true});
    shown.probes.push_back({o, (o + 1) % 8, false});
    shown.probes.back().windows = WindowsProbe{(o + 1) % 8, {}, {}};
    record.shown.push_back(shown);
  }
  return record;
}

TEST(CalibrationRecord, FollowsTheObjectsToTheirNewPlaces) {
  std::vector<Place> places;
  for (std::size_t o = 0; o < 8; ++o)
    places.emplace_back(8 - o);  // one joins as the first, the order turns round
  const CalibrationRecord moved = carry_over(record_of_eight(), places, 9);
  ASSERT_EQ(moved.objects.size(), 9U);
  EXPECT_EQ(moved.changes, 1U);
  EXPECT_EQ(moved.measured_among, 8U);
  EXPECT_TRUE(moved.objects[0].misalignments.empty()) << "it joined";
  for (std::size_t o = 1; o < 9; ++o) EXPECT_EQ(moved.objects[o].votes.foreign, static_cast<double>(8 - o));
  ASSERT_EQ(moved.shown.size(), 8U);
  for (std::size_t i = 0; i < 8; ++i) {
    const ShownProbes& shown = moved.shown[i];
    EXPECT_EQ(shown.object, i + 1) << "in the order of the objects";
    const std::size_t next = i == 0 ? 8 : i;
    EXPECT_EQ(shown.rivals, std::vector<std::size_t>{next});
    ASSERT_EQ(shown.probes.size(), 2U);
    EXPECT_EQ(shown.probes[1].object, i + 1);
    EXPECT_EQ(shown.probes[0].taken_for, i + 1);
    EXPECT_EQ(shown.probes[1].taken_for, next);
    EXPECT_EQ(shown.probes[1].windows->taken_for, next);
  }
}

TEST(CalibrationRecord, DropsTheProbesThatWereComparedWithAnObjectThatLeft) {
  std::vector<Place> places{0, 1, 2, {}, 3, 4, 5, 6};
  const CalibrationRecord rest = carry_over(record_of_eight(), places, 7);
  ASSERT_EQ(rest.shown.size(), 7U);
  for (const ShownProbes& shown : rest.shown) {
    EXPECT_EQ(shown.probes.empty(), shown.object == 2) << shown.object;
    EXPECT_TRUE(shown.windows) << "it is shown again as it was";
  }
  EXPECT_EQ(rest.changes, 1U);
}

TEST(CalibrationRecord, ARivalAloneDropsThemToo) {
  CalibrationRecord record = record_of_eight();
  record.shown[0].rivals = {1, 5};
  const std::vector<Place> places{0, 1, 2, 3, 4, {}, 5, 6};
  EXPECT_TRUE(carry_over(record, places, 7).shown[0].probes.empty());
}

TEST(CalibrationRecord, HoldsForChangesOfAQuarterOfTheObjectsAndNotForMore) {
  const std::vector<Place> all{0, 1, 2, 3, 4, 5, 6, 7};
  CalibrationRecord record = record_of_eight();
  EXPECT_EQ(carry_over(record, all, 10).changes, 2U);
  EXPECT_TRUE(carry_over(record, all, 11).objects.empty());
  EXPECT_TRUE(carry_over(record, all, 11).shown.empty());
  record.changes = 1;
  EXPECT_FALSE(carry_over(record, all, 9).objects.empty());
  EXPECT_TRUE(carry_over(record, all, 10).objects.empty());
  const std::vector<Place> fewer{0, 1, 2, 3, 4, 5, 6, {}};
  EXPECT_FALSE(carry_over(record, fewer, 7).objects.empty());
  EXPECT_TRUE(carry_over(record, fewer, 8).objects.empty()) << "one left, one joined";
}

TEST(CalibrationRecord, NothingIsCarriedOverFromNothing) {
  EXPECT_TRUE(carry_over({}, std::vector<Place>{0, 1}, 3).objects.empty());
}

TEST(CalibrationRecord, DropsTheProbesOfViewsWhoseNearestOtherObjectJoined) {
  const auto& world = testing::parts_world();
  const std::vector<TrainingSet> sets = all_views(world.sets);
  const TrainingViews views(sets, {world.model->normalization}, {}, {});
  const Eigen::MatrixXd points = project_all(views, world.model->eigenspace, 0);
  const ModelSearches searches(*world.model);
  for (std::size_t joined = 0; joined < 3; ++joined) {
    CalibrationRecord record;
    record.objects.resize(3);
    for (std::size_t o = 0; o < 3; ++o) {
      if (o == joined) continue;
      record.objects[o].misalignments.resize(36);
      for (std::size_t v = 0; v < 36; ++v)
        record.shown.push_back({o, v, true, false, {Probe{o, o, true}}, {}});
    }
    drop_within_reach(record, *world.model, views, points);
    for (const ShownProbes& shown : record.shown) {
      const auto view = static_cast<Eigen::Index>(views.objects()[shown.object].first + shown.view);
      const auto distance = [&](std::size_t object) {
        return searches.separate[object].nearest(points.col(view).cast<float>(), 1).front().distance;
      };
      const std::size_t third = 3 - joined - shown.object;
      EXPECT_EQ(shown.probes.empty(), distance(joined) < distance(third))
          << shown.object << " " << shown.view;
    }
  }
}

}  // namespace
}  // namespace eigenpose
