#include <filesystem>

#include <gtest/gtest.h>
#include <unistd.h>

#include "core/base/error.h"
#include "core/learning/calibration/parts_calibration.h"
#include "core/model/model_file.h"
#include "core/recognition/parts_recognizer.h"
#include "tests/support/drawn_pictures.h"

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
  calibrate_parts(parts, views, {});
  model.parts = std::make_shared<const PartsModel>(std::move(parts));
  return model;
}

TEST(PartsFile, AModelReadBackGivesTheSameAnswersInEveryBit) {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("parts_file_test_" + std::to_string(::getpid()) + ".h5");
  const Model model = drawn_model();
  save_model(model, file);
  const Model read = load_model(file);
  std::filesystem::remove(file);
  ASSERT_NE(read.parts, nullptr);
  PartsRecognizer one(*model.parts);
  PartsRecognizer other(*read.parts);
  for (unsigned o = 0; o < 3; ++o) {
    const cv::Mat picture = test::DrawnObject(40 + o).view(71.0);
    one.look(picture);
    other.look(picture);
    const auto votes = one.vote();
    const auto again = other.vote();
    ASSERT_EQ(votes.front().object, again.front().object);
    EXPECT_EQ(votes.front().score, again.front().score);
    EXPECT_EQ(votes.front().object, o);
    const PartsAnswer answer = one.settle(o);
    const PartsAnswer same = other.settle(o);
    EXPECT_EQ(answer.score, same.score);
    ASSERT_EQ(answer.poses.size(), same.poses.size());
    EXPECT_EQ(answer.poses.front().q, same.poses.front().q);
    EXPECT_EQ(model.parts->calibration[o].rejection_score, read.parts->calibration[o].rejection_score);
    EXPECT_EQ(model.parts->calibration[o].covered_share, read.parts->calibration[o].covered_share);
  }
}

TEST(PartsCalibration, RefusesARateThatIsNone) {
  PartsModel parts;
  PartsCalibrationOptions options;
  options.rate = 0.7;
  EXPECT_THROW(calibrate_parts(parts, {}, options), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
