#include "core/alignment/alignment.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/drawn_pictures.h"

namespace eigenpose {
namespace {

std::vector<PosePicture> pictures_of(const PartsViews& views) {
  std::vector<PosePicture> pictures(views.count);
  for (std::size_t i = 0; i < views.count; ++i) make_pose_picture(views.view(i), pictures[i]);
  return pictures;
}

AlignmentEigenspace learn(const test::DrawnObject& object, double step) {
  const PartsViews views = test::turntable_views(object, step);
  return AlignmentEigenspace::learn(views.axes, pictures_of(views));
}

TEST(PoseScale, HasTheDerivativesOfItsWarp) {
  PosePicture picture;
  make_pose_picture(test::DrawnObject(5).view(20.0), picture);
  PoseScale scale;
  scale.side = 32;
  Misalignment at{0.05, 0.01, -0.02, 0.02, 0.03};
  Eigen::MatrixXf middle;
  scale.warp(picture, at, true, middle);
  const double steps[] = {1e-2, 5e-3, 5e-3, 1e-2, 1e-2};
  for (int k = 0; k < Misalignment::unknowns; ++k) {
    Eigen::MatrixXf sides[2];
    for (const int s : {0, 1}) {
      Misalignment moved = at;
      (&moved.gain)[k] += (s == 0 ? -1.0 : 1.0) * steps[k];
      scale.warp(picture, moved, false, sides[s]);
    }
    const Eigen::VectorXf difference =
        (sides[1].col(0) - sides[0].col(0)) / static_cast<float>(2.0 * steps[k]);
    // Energy is held at one by the warp but not by its tangents; and differences of a sampled picture are
    // coarse.
    EXPECT_LT((difference - middle.col(k + 1)).norm(), 0.3F * difference.norm() + 0.3F) << "unknown " << k;
  }
}

TEST(PoseAligner, FindsThePoseBetweenLearnedViews) {
  const test::DrawnObject object(7);
  const AlignmentEigenspace space = learn(object, 10.0);
  PoseAligner aligner({});
  for (const double truth : {5.0, 123.0, 358.0}) {
    PosePicture picture;
    make_pose_picture(object.view(truth), picture);
    EXPECT_LT(test::turn_error(aligner.align(picture, space).front().q[0], truth), 1.0) << truth;
  }
}

TEST(PoseAligner, IsNotMisledByShiftAndScale) {
  const test::DrawnObject object(8);
  const AlignmentEigenspace space = learn(object, 10.0);
  PoseAligner aligner({});
  for (const double truth : {15.0, 216.0}) {
    PosePicture picture;
    make_pose_picture(object.view(truth, 64, 1.0, -1.0, 1.03), picture);
    const AlignedPose& found = aligner.align(picture, space).front();
    EXPECT_LT(test::turn_error(found.q[0], truth), 2.0) << truth;
    // A pixel of 64 to the right and up; half a pixel is what the grid allows to see.
    EXPECT_NEAR(found.misalignment.dx * 64.0, 1.0, 0.5);
    EXPECT_NEAR(found.misalignment.dy * 64.0, -1.0, 0.5);
    EXPECT_NEAR(found.misalignment.scale, 0.03, 0.015);
  }
}

/// Prior so narrow that nothing but the pose can move.
AlignmentOptions pose_alone() {
  AlignmentOptions options;
  options.prior = {1e-9, 1e-9, 1e-9, 1e-9};
  return options;
}

TEST(PoseAligner, IsWithinAThirdOfTheLearnedStepAtEveryAngleAndAcrossTheSeam) {
  constexpr double step = 15.0;
  const test::DrawnObject object(7);
  const AlignmentEigenspace space = learn(object, step);
  PoseAligner aligner({});
  PosePicture picture;
  for (double truth = 0.5; truth < 361.0; truth += 6.5) {
    make_pose_picture(object.view(truth), picture);
    const double found = aligner.align(picture, space).front().q[0];
    EXPECT_LT(test::turn_error(found, truth), step / 3.0) << truth;
    EXPECT_TRUE(found >= 0.0 && found < 360.0) << found;
  }
}

TEST(PoseAligner, ReportsTheVarianceOfTheInformationInTheManifold) {
  // Where misalignment is known, the covariance is variance/‖∂M/∂q‖², with the variance of one of D
  // coordinates the larger of cost and noise, over D.
  const test::DrawnObject object(7);
  const AlignmentEigenspace space = learn(object, 10.0);
  AlignmentOptions options = pose_alone();
  options.noise = 1e-2;  // above all costs
  PoseAligner aligner(options);
  PosePicture picture;
  for (const double truth : {20.0, 110.0, 200.0, 290.0}) {
    make_pose_picture(object.view(truth), picture);
    const AlignedPose& found = aligner.align(picture, space).front();
    ASSERT_LT(test::turn_error(found.q[0], truth), 1.0);
    ASSERT_LT(found.cost, options.noise);
    const Eigen::VectorXd slope = space.coarse_manifold().evaluate_with_jacobian(found.q).jacobian.col(0);
    const double expected =
        options.noise / (static_cast<double>(space.coarse().basis.cols()) * slope.squaredNorm());
    EXPECT_NEAR(found.q_covariance[0] / expected, 1.0, 0.25) << truth;
  }
}

TEST(PoseAligner, ReportsPoseAndVarianceInTheUnitOfTheDof) {
  // The same turn in degrees and in turns.
  const test::DrawnObject object(7);
  const PartsViews views = test::turntable_views(object, 10.0);
  SampleAxis turns{{"table", "turns", 0.0, 1.0, true}, {}};
  for (const double degrees : views.axes[0].samples) turns.samples.push_back(degrees / 360.0);
  const std::vector<PosePicture> pictures = pictures_of(views);
  const AlignmentEigenspace by_degrees = AlignmentEigenspace::learn(views.axes, pictures);
  const AlignmentEigenspace by_turns = AlignmentEigenspace::learn({turns}, pictures);
  PoseAligner aligner(pose_alone());
  PosePicture picture;
  make_pose_picture(object.view(123.0), picture);
  const AlignedPose in_degrees = aligner.align(picture, by_degrees).front();
  const AlignedPose in_turns = aligner.align(picture, by_turns).front();
  EXPECT_NEAR(in_turns.q[0] * 360.0, in_degrees.q[0], 1e-2);
  EXPECT_NEAR(in_turns.q_covariance[0] * 360.0 * 360.0 / in_degrees.q_covariance[0], 1.0, 1e-2);
}

TEST(PoseAligner, UndoesNoMoreThanFourSigmaOfAMisalignment) {
  const test::DrawnObject object(8);
  const AlignmentEigenspace space = learn(object, 10.0);
  PosePicture picture;
  make_pose_picture(object.view(100.0, 64, 3.0, -3.0), picture);
  // Almost no noise: the prior itself hardly pulls.
  AlignmentOptions options;
  options.noise = 1e-9;
  options.prior.shift = 2.0 / 64.0;
  PoseAligner wide(options);
  const Misalignment whole = wide.align(picture, space).front().misalignment;
  EXPECT_NEAR(whole.dx * 64.0, 3.0, 1.0);
  EXPECT_NEAR(whole.dy * 64.0, -3.0, 1.0);
  options.prior.shift = 0.25 / 64.0;
  PoseAligner narrow(options);
  const auto& poses = narrow.align(picture, space);
  EXPECT_NEAR(poses.front().misalignment.dx * 64.0, 1.0, 1e-9);
  EXPECT_NEAR(poses.front().misalignment.dy * 64.0, -1.0, 1e-9);
  for (const AlignedPose& pose : poses) {
    EXPECT_LE(std::fabs(pose.misalignment.dx) * 64.0, 1.0 + 1e-9);
    EXPECT_LE(std::fabs(pose.misalignment.dy) * 64.0, 1.0 + 1e-9);
  }
}

TEST(PoseAligner, ReportsNoPoseTwice) {
  const test::DrawnObject object(7);
  const AlignmentEigenspace space = learn(object, 10.0);
  AlignmentOptions options;
  options.hopeless = 1e9;  // all minima are followed; several end at one pose
  PoseAligner aligner(options);
  PosePicture picture;
  for (double truth = 4.0; truth < 360.0; truth += 22.0) {
    make_pose_picture(object.view(truth), picture);
    const auto& found = aligner.align(picture, space);
    for (std::size_t i = 0; i < found.size(); ++i)
      for (std::size_t k = 0; k < i; ++k)
        EXPECT_GT(test::turn_error(found[i].q[0], found[k].q[0]), 3.6) << truth;
  }
}

TEST(PoseAligner, ReportsTheSpreadOfPosesUnderNoise) {
  const test::DrawnObject object(7);
  const AlignmentEigenspace space = learn(object, 10.0);
  AlignmentOptions options = pose_alone();
  options.noise = 1e-9;  // the noise of the picture is what counts
  PoseAligner aligner(options);
  cv::RNG random(5);
  PosePicture picture;
  double squares = 0.0;
  double predicted = 0.0;
  double sum = 0.0;
  constexpr int pictures = 200;
  constexpr double truth = 110.0;
  for (int i = 0; i < pictures; ++i) {
    cv::Mat noise(64, 64, CV_16SC1);
    random.fill(noise, cv::RNG::NORMAL, 0, 25);
    cv::Mat noisy = object.view(truth);
    cv::add(noisy, noise, noisy, cv::noArray(), CV_8U);
    make_pose_picture(noisy, picture);
    const AlignedPose& found = aligner.align(picture, space).front();
    const double error = std::remainder(found.q[0] - truth, 360.0);
    sum += error;
    squares += error * error;
    predicted += found.q_covariance[0];
  }
  const double variance = squares / pictures - sum * sum / pictures / pictures;
  // Blurred noise is correlated, and part of the cost is interpolation: it never promises more than is kept,
  // and is of the order.
  EXPECT_GT(predicted / pictures, variance);
  EXPECT_LT(predicted / pictures, 8.0 * variance);
}

TEST(PoseAligner, FindsBothPosesOfAnObjectThatLooksTheSameFromBehind) {
  const test::DrawnObject object(9);
  SampleAxis axis{turntable_workspace()[0], {}};
  std::vector<PosePicture> pictures(24);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    axis.samples.push_back(15.0 * static_cast<double>(i));
    make_pose_picture(object.view(2.0 * axis.samples.back()), pictures[i]);
  }
  const AlignmentEigenspace space = AlignmentEigenspace::learn({axis}, pictures);
  PoseAligner aligner({});
  PosePicture picture;
  for (const double truth : {3.0, 50.0, 170.0}) {
    make_pose_picture(object.view(2.0 * truth), picture);
    const auto& found = aligner.align(picture, space);
    ASSERT_GE(found.size(), 2U) << truth;
    const double first = test::turn_error(found[0].q[0], truth);
    const double second = test::turn_error(found[1].q[0], truth);
    EXPECT_LT(std::min(first, second), 2.5) << truth;
    EXPECT_GT(std::max(first, second), 177.5) << truth;
  }
}

/// Stripes finer than the coarse scale shows, on the front alone, over a body that looks the same from
/// behind.
cv::Mat striped(const test::DrawnObject& body, double angle) {
  cv::Mat picture = body.view(2.0 * angle);
  const double front = std::cos(angle * std::numbers::pi / 180.0);
  for (int r = 16; r < 48; ++r)
    for (int c = 16; c < 48; ++c) {
      const double stripe = (r % 3 == 0 ? 60.0 : -30.0) * front;
      picture.at<std::uint8_t>(r, c) =
          cv::saturate_cast<std::uint8_t>(picture.at<std::uint8_t>(r, c) + stripe);
    }
  return picture;
}

AlignmentEigenspace learn_striped(const test::DrawnObject& body) {
  SampleAxis axis{turntable_workspace()[0], {}};
  std::vector<PosePicture> pictures(24);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    axis.samples.push_back(15.0 * static_cast<double>(i));
    make_pose_picture(striped(body, axis.samples.back()), pictures[i]);
  }
  return AlignmentEigenspace::learn({axis}, pictures);
}

TEST(PoseAligner, ChoosesBetweenPosesByWhatTheFineScaleShows) {
  const test::DrawnObject body(9);
  const AlignmentEigenspace space = learn_striped(body);
  PoseAligner fine({});
  AlignmentOptions options;
  options.fine = false;
  PoseAligner coarse(options);
  PosePicture picture;
  double least_fine = 1.0;
  double least_coarse = 1.0;
  for (const double truth : {0.0, 20.0, 160.0, 180.0, 200.0, 340.0}) {
    make_pose_picture(striped(body, truth), picture);
    const auto& found = fine.align(picture, space);
    EXPECT_LT(test::turn_error(found.front().q[0], truth), 5.0) << truth;
    ASSERT_GE(found.size(), 2U);
    least_fine = std::min(least_fine, found[1].fine_cost - found[0].fine_cost);
    const auto& rough = coarse.align(picture, space);
    ASSERT_GE(rough.size(), 2U);
    for (const AlignedPose& pose : rough) EXPECT_EQ(pose.fine_cost, pose.cost);
    least_coarse = std::min(least_coarse, rough[1].cost - rough[0].cost);
  }
  EXPECT_GT(least_fine, 2.0 * least_coarse) << "the fine scale separates the two poses better";
}

TEST(PoseAligner, TakesPosesThatAreNotComparedFinelyToChangeAsTheBestDoes) {
  const test::DrawnObject body(9);
  const AlignmentEigenspace space = learn_striped(body);
  AlignmentOptions options;
  options.close = 0.0;  // none but the best is compared
  PoseAligner aligner(options);
  PosePicture picture;
  for (const double truth : {20.0, 160.0}) {
    make_pose_picture(striped(body, truth), picture);
    const auto& found = aligner.align(picture, space);
    ASSERT_GE(found.size(), 2U);
    const double finer = found[0].fine_cost - found[0].cost;
    EXPECT_GT(std::fabs(finer), 1e-6) << "or the sign does not show";
    for (const AlignedPose& pose : found) EXPECT_NEAR(pose.fine_cost - pose.cost, finer, 1e-12);
  }
}

/// A body that turns, before a background lit from the side: two DOFs.
AlignmentEigenspace learn_two_dofs(const test::DrawnObject& object, bool turn_first) {
  const SampleAxis turn{turntable_workspace()[0], {0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330}};
  const SampleAxis shift{{"x", "mm", 0.0, 8.0, false}, {0.0, 2.0, 4.0, 6.0, 8.0}};
  const std::vector<SampleAxis> axes =
      turn_first ? std::vector<SampleAxis>{turn, shift} : std::vector<SampleAxis>{shift, turn};
  std::vector<PosePicture> pictures;
  for (const double first : axes[0].samples)
    for (const double second : axes[1].samples)
      make_pose_picture(object.view(turn_first ? first : second, 64, (turn_first ? second : first) - 4.0),
                        pictures.emplace_back());
  return AlignmentEigenspace::learn(axes, pictures);
}

TEST(PoseAligner, ComparesPosesOfSeveralDofsFinelyInEveryDof) {
  const test::DrawnObject object(11);
  PoseAligner aligner(pose_alone());
  PosePicture picture;
  make_pose_picture(object.view(75.0, 64, 1.1), picture);
  for (const bool turn_first : {true, false}) {
    const AlignmentEigenspace space = learn_two_dofs(object, turn_first);
    const auto& found = aligner.align(picture, space);
    ASSERT_GE(found.size(), 2U);
    const AlignedPose& best = found.front();
    // The least cost around the pose, by brute force: the misalignment is 0, so it is a plain distance.
    Eigen::MatrixXf warped;
    space.fine().warp(picture, {}, false, warped);
    const Eigen::VectorXd region =
        (space.fine().basis.transpose() * warped.col(0) - space.fine().mean).cast<double>();
    const auto axes = space.fine_manifold().axes();
    double least = 1e9;
    double along_first = 1e9;
    for (int i = -5; i <= 5; ++i)
      for (int k = -5; k <= 5; ++k) {
        const double q[] = {best.q[0] + i * axes[0].dof.period() / 360.0,
                            best.q[1] + k * axes[1].dof.period() / 360.0};
        const double cost = (space.fine_manifold().evaluate(q) - region).squaredNorm();
        least = std::min(least, cost);
        if (k == 0) along_first = std::min(along_first, cost);
      }
    // Axis by axis it need not reach the least of all, but it must gain along each.
    EXPECT_LT(best.fine_cost, least + 0.5 * (along_first - least) + 1e-6) << turn_first;
    EXPECT_GE(best.fine_cost, least - 1e-6) << turn_first;
  }
}

TEST(AlignmentEigenspace, HasASampleForEveryViewHoweverManyThereAre) {
  // A turn of 720 views, more than the 360 samples that are enough otherwise.
  constexpr int views = 720;
  SampleAxis axis{turntable_workspace()[0], {}};
  Eigen::MatrixXd points(2, views);
  for (int i = 0; i < views; ++i) {
    axis.samples.push_back(0.5 * i);
    points(0, i) = std::cos(i * std::numbers::pi / 360.0);
    points(1, i) = std::sin(i * std::numbers::pi / 360.0);
  }
  const Manifold manifold = Manifold::interpolate({axis}, points);
  const auto scale = [](int side) {
    PoseScale made;
    made.side = side;
    made.basis = Eigen::MatrixXf::Identity(side * side, 2);
    made.mean = Eigen::VectorXf::Zero(2);
    return made;
  };
  const AlignmentEigenspace space = AlignmentEigenspace::from_parts(
      scale(32), scale(48), Eigen::VectorXf::Zero(32 * 32), manifold, manifold);
  EXPECT_EQ(space.sample_grid().size(), static_cast<std::size_t>(views));
  EXPECT_EQ(space.samples().cols(), views);
  EXPECT_DOUBLE_EQ(space.sample_poses()(0, views - 1), 359.5);
}

TEST(AlignmentEigenspace, SamplesATurnByDegreesAndAnOpenAxisToItsEnds) {
  const AlignmentEigenspace turn = learn(test::DrawnObject(7), 15.0);
  EXPECT_EQ(turn.sample_grid().size(), 360U);
  EXPECT_DOUBLE_EQ(turn.sample_poses()(0, 1) - turn.sample_poses()(0, 0), 1.0);
  const AlignmentEigenspace both = learn_two_dofs(test::DrawnObject(11), true);
  const Eigen::MatrixXd& poses = both.sample_poses();
  EXPECT_DOUBLE_EQ(poses.row(1).minCoeff(), 0.0);
  EXPECT_DOUBLE_EQ(poses.row(1).maxCoeff(), 8.0);
  EXPECT_LT(poses.row(0).maxCoeff(), 360.0);
  EXPECT_LE(both.sample_grid().size(), 4096U);
}

}  // namespace
}  // namespace eigenpose
