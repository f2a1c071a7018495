#include "core/learning/calibration/probes.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/learning/learning.h"
#include "tests/support/learned_world.h"
#include "tests/support/parts_world.h"

namespace eigenpose {
namespace {

TEST(Probes, ShowEveryViewAsKnownAndAsUnknown) {
  const auto& world = testing::parts_world();
  const auto& probes = world.report.probes;
  const std::size_t views = 3 * 36;
  const auto count = [&](bool known, bool hidden) {
    return static_cast<std::size_t>(std::ranges::count_if(
        probes, [&](const Probe& probe) { return probe.known == known && probe.hidden == hidden; }));
  };
  EXPECT_EQ(count(true, false), views);
  EXPECT_EQ(count(false, false), views);
  EXPECT_GT(count(true, true), 0U);
  EXPECT_EQ(count(false, true), count(true, true));
  EXPECT_GT(std::ranges::count_if(
                probes, [](const Probe& probe) { return probe.known && probe.hidden && probe.occluded; }),
            0);
  for (const Probe& probe : probes) {
    if (probe.occluded) {
      EXPECT_EQ(probe.known, probe.occluded->taken_for == probe.object);
    }
    if (probe.hidden) continue;
    ASSERT_TRUE(probe.windows) << "few views: all are shown to the windows";
    EXPECT_EQ(probe.known, probe.taken_for == probe.object);
    EXPECT_EQ(probe.known, probe.windows->taken_for == probe.object);
    EXPECT_GT(probe.whole.distance, 0.0);
    EXPECT_GT(probe.whole.typical, 0.0);
  }
}

TEST(Probes, MeasureEachObjectByItsOwnYardstick) {
  for (const auto* world : {&testing::parts_world().report, &testing::learned_world().report}) {
    const Model& model = world == &testing::parts_world().report ? *testing::parts_world().model
                                                                 : *testing::learned_world().model;
    int other = 0;
    for (const Probe& probe : world->probes) {
      if (probe.hidden) continue;
      EXPECT_EQ(probe.whole.typical, model.objects[probe.taken_for].typical_distance);
      if (!probe.windows) continue;
      const std::size_t object = probe.windows->taken_for;
      EXPECT_EQ(probe.windows->whole.typical, model.objects[object].typical_distance);
      EXPECT_EQ(probe.windows->windows.typical_votes, model.parts->calibration[object].typical_votes);
      other += object != probe.taken_for ? 1 : 0;
    }
    EXPECT_TRUE(!model.parts || other > 0) << "or the two are never different objects";
  }
}

TEST(Probes, KnownViewsLieNearerAndHaveMoreVotesThanUnknownOnes) {
  double known = 0.0;
  double unknown = 0.0;
  double own_votes = 0.0;
  double other_votes = 0.0;
  for (const Probe& probe : testing::parts_world().report.probes) {
    if (probe.hidden) continue;
    (probe.known ? known : unknown) += probe.whole.distance;
    (probe.known ? own_votes : other_votes) += probe.windows->windows.votes;
  }
  EXPECT_LT(2.0 * known, unknown);
  EXPECT_LT(other_votes, own_votes);
}

TEST(Probes, HaveTheColoursOfTheObjectThatTheyAreTakenFor) {
  const auto& world = testing::parts_world();
  const auto typical = [&](std::size_t object) {
    return world.model->parts->calibration[object].typical_color;
  };
  double known = 0.0;
  double unknown = 0.0;
  for (const Probe& probe : world.report.probes) {
    if (probe.occluded) {
      ASSERT_TRUE(probe.occluded->match.color);
      EXPECT_EQ(probe.occluded->match.color->typical, typical(probe.occluded->taken_for));
    }
    if (probe.hidden) continue;
    ASSERT_TRUE(probe.whole.color);
    EXPECT_EQ(probe.whole.color->typical, typical(probe.taken_for));
    ASSERT_TRUE(probe.windows->whole.color);
    EXPECT_EQ(probe.windows->whole.color->typical, typical(probe.windows->taken_for));
    (probe.known ? known : unknown) += probe.whole.color->distance;
  }
  EXPECT_GT(known, 0.0);
  EXPECT_LT(2.0 * known, unknown);
}

TEST(Probes, ExpectOfANewViewTheColoursBetweenThoseWithTheViewAndWithoutIt) {
  const auto& world = testing::parts_world();
  for (std::size_t o = 0; o < world.model->objects.size(); ++o) {
    double sum = 0.0;
    int count = 0;
    for (const Probe& probe : world.report.probes)
      if (probe.known && !probe.hidden && probe.object == o) {
        sum += probe.whole.color->distance;
        ++count;
      }
    const double typical = world.model->parts->calibration[o].typical_color;
    EXPECT_GT(typical, 0.0);
    EXPECT_NEAR(sum / count, typical, 0.5 * typical) << "displaced a little more";
  }
}

TEST(Probes, OfAModelWithoutWindowsShowTheWholeRegionAlone) {
  const auto& report = testing::learned_world().report;
  ASSERT_FALSE(report.probes.empty());
  for (const Probe& probe : report.probes) {
    EXPECT_FALSE(probe.windows);
    EXPECT_FALSE(probe.occluded);
    EXPECT_FALSE(probe.hidden);
  }
}

TEST(Probes, DoNotDependOnThreads) {
  const auto& world = testing::parts_world();
  std::vector<LearningReport> reports(2);
  LearningOptions options = testing::PartsWorld::options();
  for (unsigned i = 0; i < 2; ++i) {
    options.threads = 1 + 2 * i;
    (void)learn(all_views(world.sets), options, &reports[i]);
  }
  ASSERT_EQ(reports[0].probes.size(), reports[1].probes.size());
  for (std::size_t i = 0; i < reports[0].probes.size(); ++i) {
    const Probe& a = reports[0].probes[i];
    const Probe& b = reports[1].probes[i];
    EXPECT_EQ(a.taken_for, b.taken_for);
    EXPECT_EQ(a.whole.distance, b.whole.distance);
    ASSERT_EQ(a.occluded.has_value(), b.occluded.has_value());
    if (a.occluded) {
      EXPECT_EQ(occluded_terms(a.occluded->match), occluded_terms(b.occluded->match));
    }
    if (a.windows) {
      EXPECT_EQ(windows_terms(a.windows->whole, a.windows->windows),
                windows_terms(b.windows->whole, b.windows->windows));
    }
  }
}

}  // namespace
}  // namespace eigenpose
