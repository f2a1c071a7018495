#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>

#include <gmock/gmock.h>

#include "core/base/error.h"
#include "core/learning/parts_learning.h"
#include "core/model/model_check.h"
#include "core/model/model_file.h"
#include "core/recognition/parts_recognizer.h"
#include "tests/support/drawn_pictures.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

/// A model of three drawn objects whose whole-region part is a mere stand-in.
Model drawn_model() {
  Model model;
  model.normalization.size = 8;
  model.normalization.color = false;
  model.eigenspace.mean = Eigen::VectorXf::Zero(64);
  model.eigenspace.basis = Eigen::MatrixXf::Identity(64, 2);
  model.eigenspace.eigenvalues = Eigen::VectorXd::Ones(2);
  std::vector<PartsViews> views;
  for (unsigned o = 0; o < 3; ++o) {
    views.push_back(test::turntable_views(test::DrawnObject(40 + o), 30.0));
    ModelObject object{"object" + std::to_string(o), turntable_workspace(),
                       Manifold::interpolate(views.back().axes, Eigen::MatrixXd::Random(2, 12))};
    object.dof_observable = {true};
    model.objects.push_back(std::move(object));
  }
  PartsModel parts = learn_parts(views, {});
  model.parts = std::make_shared<const PartsModel>(std::move(parts));
  return model;
}

Model read_back(const Model& model) {
  const test::TemporaryFolder folder;
  save_model(model, folder.path() / "a.model");
  return load_model(folder.path() / "a.model");
}

/// The drawn model, its parts changed.
Model with_parts(const std::function<void(PartsModel&)>& change) {
  static const Model drawn = drawn_model();
  Model model = drawn;
  PartsModel parts = *model.parts;
  change(parts);
  model.parts = std::make_shared<const PartsModel>(std::move(parts));
  return model;
}

TEST(PartsFile, AModelReadBackGivesTheSameAnswersInEveryBit) {
  const Model model = with_parts([](PartsModel&) {});
  const Model read = read_back(model);
  ASSERT_NE(read.parts, nullptr);
  PartsRecognizer one(*model.parts, model.decision);
  PartsRecognizer other(*read.parts, read.decision);
  for (unsigned o = 0; o < 3; ++o) {
    const cv::Mat picture = test::DrawnObject(40 + o).view(71.0);
    const auto votes = one.look(picture).vote();
    const auto again = other.look(picture).vote();
    ASSERT_EQ(votes.ranked().front().object, again.ranked().front().object);
    EXPECT_EQ(votes.ranked().front().score, again.ranked().front().score);
    EXPECT_EQ(votes.ranked().front().object, o);
    const PartsAnswer answer = votes.settle(o);
    const PartsAnswer same = again.settle(o);
    ASSERT_EQ(answer.poses.size(), same.poses.size());
    EXPECT_EQ(answer.poses.front().q, same.poses.front().q);
    EXPECT_EQ(model.parts->calibration[o].typical_votes, read.parts->calibration[o].typical_votes);
    EXPECT_EQ(model.parts->calibration[o].foreign_share, read.parts->calibration[o].foreign_share);
  }
}

TEST(PartsFile, KeepsTheVotingOptions) {
  const Model model = with_parts([](PartsModel& parts) {
    parts.voting = {{.cells = 1, .penalty = 0.02F}, 0.4F, 0.8F, 3, 0.1F};
  });
  const VotingOptions read = read_back(model).parts->voting;
  EXPECT_EQ(read.tolerance.cells, 1);
  EXPECT_EQ(read.tolerance.penalty, 0.02F);
  EXPECT_EQ(read.width, 0.4F);
  EXPECT_EQ(read.pooling, 0.8F);
  EXPECT_EQ(read.background_rank, 3);
  EXPECT_EQ(read.floor_weight, 0.1F);
}

TEST(PartsFile, KeepsTheSizesOfObjectsBesideOthersThatCameReadyCut) {
  std::vector<std::vector<cv::Size>> extents(3, std::vector<cv::Size>(12));
  for (int v = 0; v < 12; ++v)
    extents[1][static_cast<std::size_t>(v)] = extents[2][static_cast<std::size_t>(v)] = {20 + v, 30};
  EXPECT_EQ(read_back(with_parts([&](PartsModel& parts) { parts.extents = extents; })).parts->extents,
            extents);
  for (auto& of_object : extents) of_object.clear();
  EXPECT_EQ(read_back(with_parts([&](PartsModel& parts) { parts.extents = extents; })).parts->extents,
            extents)
      << "all came ready-cut";
}

TEST(PartsFile, KeepsLanesOfMoreCandidatesThanSixteenBitsCount) {
  const Model model = with_parts([](PartsModel& parts) {
    parts.objects[0].candidates.resize(70'000, {0, true});
    parts.objects[0].neighbours.resize(70'000, {-1, -1});
    parts.objects[0].lane_candidate.back() = 69'999;
  });
  EXPECT_EQ(read_back(model).parts->objects[0].lane_candidate.back(), 69'999U);
}

/// With colours as if its grey views had some.
void color(PartsModel& parts) {
  parts.bands = 3;
  parts.space =
      WindowSpace::from_parts(Eigen::VectorXf::Zero(window_length(3)),
                              Eigen::MatrixXf::Identity(window_length(3), parts.space.basis().cols()), 1.0F);
  for (std::size_t o = 0; o < 3; ++o) {
    std::vector<ChromaticityMap> maps(12);
    for (std::size_t v = 0; v < maps.size(); ++v) {
      maps[v].u.fill(static_cast<std::uint8_t>(10 * o + v));
      maps[v].v.fill(static_cast<std::uint8_t>(100 + v));
      maps[v].brightness[v] = 255;
    }
    parts.colors.emplace_back(std::move(maps));
    parts.calibration[o].typical_color = 0.1 * static_cast<double>(o);
  }
}

TEST(PartsFile, KeepsTheColoursOfTheViews) {
  const Model model = with_parts(color);
  const Model read = read_back(model);
  ASSERT_EQ(read.parts->colors.size(), 3U);
  for (std::size_t o = 0; o < 3; ++o) {
    EXPECT_TRUE(std::ranges::equal(read.parts->colors[o].maps(), model.parts->colors[o].maps()));
    EXPECT_EQ(read.parts->calibration[o].typical_color, model.parts->calibration[o].typical_color);
  }
  EXPECT_TRUE(read_back(with_parts([](PartsModel&) {})).parts->colors.empty()) << "of grey views";
}

TEST(PartsFile, RefusesPartsThatCannotBe) {
  const double nan = std::nan("");
  struct Spoiled {
    std::string said;
    std::function<void(PartsModel&)> spoil;
  };
  const std::vector<Spoiled> all = {
      {"the noise of alignment is -1", [](PartsModel& p) { p.noise = -1.0; }},
      {"the noise of alignment is nan", [&](PartsModel& p) { p.noise = nan; }},
      {"the step of learned windows is 0", [](PartsModel& p) { p.scale.learned = 0.0F; }},
      {"the step of query windows is inf",
       [](PartsModel& p) { p.scale.query = std::numeric_limits<float>::infinity(); }},
      {"the background of windows is -1", [](PartsModel& p) { p.background[1] = -1.0F; }},
      {"neither of colour nor of grey", [](PartsModel& p) { p.bands = 2; }},
      {"the width of likeness is 0", [](PartsModel& p) { p.voting.width = 0.0F; }},
      {"the pooling of neighbours is 2", [](PartsModel& p) { p.voting.pooling = 2.0F; }},
      {"the rank of the background is 0", [](PartsModel& p) { p.voting.background_rank = 0; }},
      {"the reach of windows (cells) is 99", [](PartsModel& p) { p.voting.tolerance.cells = 99; }},
      {"object \"object1\": the typical votes is nan",
       [&](PartsModel& p) { p.calibration[1].typical_votes = nan; }},
      {"the typical votes is 1.5", [](PartsModel& p) { p.calibration[0].typical_votes = 1.5; }},
      {"the share of foreign windows is -1", [](PartsModel& p) { p.calibration[2].foreign_share = -1.0; }},
      {"the typical distance of colours is 2", [](PartsModel& p) { p.calibration[2].typical_color = 2.0; }},
      {"the windows do not fit the objects",
       [](PartsModel& p) {
         color(p);
         p.colors.pop_back();
       }},
      {"the windows do not fit the objects",
       [](PartsModel& p) {
         color(p);
         p.bands = 1;
       }},
      {"object \"object1\": the colours do not fit the views",
       [](PartsModel& p) {
         color(p);
         p.colors[1] = ColorViews(std::vector<ChromaticityMap>(11));
       }},
      {"a view that was not learned", [](PartsModel& p) { p.objects[0].candidates[0].view = 12; }},
      {"the poses of views do not fit its degrees of freedom",
       [](PartsModel& p) { p.view_poses[1] = Eigen::MatrixXd::Zero(2, 12); }},
      {"the poses of views: not every number is finite", [&](PartsModel& p) { p.view_poses[1](0, 3) = nan; }},
      {"the windows do not fit the objects", [](PartsModel& p) { p.view_poses.pop_back(); }},
      {"the windows do not fit together", [](PartsModel& p) { p.objects[0].neighbours.pop_back(); }},
      {"the windows do not fit the objects", [](PartsModel& p) { p.poses.pop_back(); }},
      {"the sizes of regions do not fit the views",
       [](PartsModel& p) {
         p.extents = {std::vector<cv::Size>(12, {3, 3}), {}, {}};
       }},
  };
  for (const Spoiled& spoiled : all)
    EXPECT_THAT([&] { check_model(with_parts(spoiled.spoil)); },
                ::testing::ThrowsMessage<std::invalid_argument>(::testing::HasSubstr(spoiled.said)));
}

}  // namespace
}  // namespace eigenpose
