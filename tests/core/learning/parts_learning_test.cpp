#include "core/learning/parts_learning.h"

#include <array>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/support/drawn_pictures.h"
#include "tests/support/serial_progress.h"

namespace eigenpose {
namespace {

std::vector<PartsViews> turns(unsigned objects, double step) {
  std::vector<PartsViews> views;
  for (unsigned o = 0; o < objects; ++o)
    views.push_back(test::turntable_views(test::DrawnObject(20 + o), step));
  return views;
}

TEST(PartsLearning, TakesViewsAcrossTheSeamOfATurnForNeighbours) {
  const PartsModel model = learn_parts(turns(1, 15.0), {});
  const auto& near = model.objects[0].neighbours;
  ASSERT_EQ(near.size(), 24U);
  for (int v = 0; v < 24; ++v) {
    EXPECT_EQ(near[static_cast<std::size_t>(v)], (std::array{(v + 1) % 24, (v + 23) % 24})) << v;
  }
}

TEST(PartsLearning, GivesTheEndsOfAnOpenAxisOneNeighbour) {
  PartsViews views = test::turntable_views(test::DrawnObject(20), 15.0);
  views.axes[0].dof.periodic = false;
  const auto near = learn_parts({views}, {}).objects[0].neighbours;
  EXPECT_EQ(near.front(), (std::array{1, -1}));
  EXPECT_EQ(near.back(), (std::array{-1, 22}));
  EXPECT_EQ(near[7], (std::array{8, 6}));
}

TEST(PartsLearning, TakesNeighboursAlongTheFastestAxisOfAGrid) {
  PartsViews views = test::turntable_views(test::DrawnObject(20), 15.0);
  SampleAxis turn = views.axes[0];
  turn.samples.resize(12);  // 2 × 12 × 1 views
  views.axes = {
      {{"light", "deg", 0.0, 90.0, false}, {0.0, 90.0}}, turn, {{"x", "mm", 0.0, 1.0, false}, {0.0}}};
  const auto near = learn_parts({views}, {}).objects[0].neighbours;
  EXPECT_EQ(near[0], (std::array{1, 11}));
  EXPECT_EQ(near[11], (std::array{0, 10}));
  EXPECT_EQ(near[12], (std::array{13, 23})) << "the second light has neighbours of its own";
}

TEST(PartsLearning, AddsForeshortenedAndMirroredCopiesOfSparseViews) {
  PartsLearningOptions options;
  options.threads = 1;
  const PartsModel dense = learn_parts(turns(1, 20.0), options);
  EXPECT_EQ(dense.objects[0].candidates.size(), 18U);
  EXPECT_EQ(dense.objects[0].store.views(), 18U);
  const PartsModel sparse = learn_parts(turns(1, 24.0), options);
  const PartsObject& object = sparse.objects[0];
  ASSERT_EQ(object.candidates.size(), 30U);
  EXPECT_EQ(object.store.views(), 90U);
  for (std::size_t c = 0; c < 30; ++c) {
    EXPECT_EQ(object.candidates[c].mirrored, c >= 15);
    EXPECT_EQ(object.candidates[c].view, static_cast<int>(c % 15));
    // The neighbours of a mirrored view are mirrored, too.
    for (const int n : object.neighbours[c]) EXPECT_EQ(n >= 15, c >= 15);
  }
  for (std::size_t lane = 0; lane < 90; ++lane) EXPECT_EQ(object.lane_candidate[lane], lane / 3);
}

TEST(PartsLearning, GivesMirroredCopiesAtTheEndsOfAnOpenAxisNoMoreNeighboursThanTheirViews) {
  // A sparse turn of 5 views at 3 places: the place runs fastest.
  PartsViews views = test::turntable_views(test::DrawnObject(20), 24.0);
  SampleAxis turn = views.axes[0];
  turn.samples = {0.0, 72.0, 144.0, 216.0, 288.0};
  views.axes = {turn, {{"x", "mm", 0.0, 2.0, false}, {0.0, 1.0, 2.0}}};
  const PartsModel model = learn_parts({views}, {});
  const PartsObject& object = model.objects[0];
  ASSERT_EQ(object.candidates.size(), 30U);
  for (int copy = 0; copy < 2; ++copy)
    for (int v = 0; v < 15; ++v) {
      const int c = v + 15 * copy;
      EXPECT_EQ(object.neighbours[static_cast<std::size_t>(c)],
                (std::array{v % 3 < 2 ? c + 1 : -1, v % 3 > 0 ? c - 1 : -1}))
          << c;
    }
}

TEST(PartsLearning, TakesTheTwoNearestViewsForNeighboursWherePosesAreNoGrid) {
  PartsViews views = test::turntable_views(test::DrawnObject(20), 60.0);
  // Whatever comes first: nearest, second nearest or farther.
  const std::vector<double> angles{0.0, 50.0, 10.0, 30.0, 200.0, 255.0};
  views.axes[0].samples = {0.0, 90.0, 180.0, 270.0};
  views.poses = Eigen::Map<const Eigen::RowVectorXd>(angles.data(), 6);
  const auto near = learn_parts({views}, {}).objects[0].neighbours;
  ASSERT_EQ(near.size(), 12U) << "mirrored ones too: the axis is sparse";
  EXPECT_EQ(near[0], (std::array{2, 3}));
  EXPECT_EQ(near[6], (std::array{8, 9}));
  EXPECT_EQ(near[1], (std::array{3, 2}));
  EXPECT_EQ(near[2], (std::array{0, 3}));
  EXPECT_EQ(near[3], (std::array{1, 2})) << "of equally near ones the first";
  EXPECT_EQ(near[4], (std::array{5, 1}));
  EXPECT_EQ(near[5], (std::array{4, 0})) << "across the seam";
}

TEST(PartsLearning, DoesNotDependOnThreads) {
  const auto views = turns(4, 20.0);
  std::vector<PartsModel> models;
  for (const unsigned threads : {1U, 4U}) {
    PartsLearningOptions options;
    options.threads = threads;
    models.push_back(learn_parts(views, options));
  }
  EXPECT_EQ(models[0].noise, models[1].noise);
  for (std::size_t o = 0; o < 4; ++o) {
    EXPECT_EQ(models[0].objects[o].store.values(), models[1].objects[o].store.values());
    EXPECT_EQ(models[0].poses[o].samples(), models[1].poses[o].samples());
  }
}

TEST(PartsLearning, ReportsProgressOneCallAtATime) {
  const auto views = turns(6, 30.0);
  test::SerialProgress heard;
  PartsLearningOptions options;
  options.threads = 4;
  (void)learn_parts(views, options, heard.listener());
  heard.expect_complete();
}

TEST(PartsLearning, EndsWhenAskedTo) {
  std::stop_source source;
  source.request_stop();
  const auto views = turns(2, 30.0);
  EXPECT_THROW(learn_parts(views, {}, {}, source.get_token()), Interrupted);
}

TEST(PartsLearning, RefusesObjectsWithoutViews) {
  EXPECT_THROW(learn_parts({}, {}), std::invalid_argument);
  EXPECT_THROW(learn_parts({PartsViews{}}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
