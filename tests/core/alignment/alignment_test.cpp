#include "core/alignment/alignment.h"

#include <gtest/gtest.h>

#include "core/simd/dense_kernels.h"
#include "tests/support/drawn_pictures.h"

namespace eigenpose {
namespace {

AlignmentEigenspace learn(const test::DrawnObject& object, double step) {
  const PartsViews views = test::turntable_views(object, step);
  std::vector<PosePicture> pictures(views.count);
  for (std::size_t i = 0; i < views.count; ++i) make_pose_picture(views.view(i), pictures[i]);
  return AlignmentEigenspace::learn(views.axes, pictures);
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

TEST(DenseKernels, AgreeWithPlainSums) {
  const Eigen::MatrixXf matrix = Eigen::MatrixXf::Random(77, 5);
  const Eigen::MatrixXf vectors = Eigen::MatrixXf::Random(77, 6);
  Eigen::MatrixXf out = Eigen::MatrixXf::Constant(7, 6, 3.0F);
  multiply_transposed_six(matrix.data(), 77, 5, vectors.data(), out.data(), 7);
  EXPECT_LT((out.topRows(5) - matrix.transpose() * vectors).norm(), 1e-4F);
  EXPECT_EQ(out.bottomRows(2).minCoeff(), 3.0F) << "what lies between the columns is left alone";
  EXPECT_EQ(out.bottomRows(2).maxCoeff(), 3.0F);
  float squared = 0.0F;
  float products[5];
  residual_products(matrix.data(), vectors.data(), 77, squared, products);
  const Eigen::VectorXf r = matrix.col(0) - vectors.col(0);
  EXPECT_NEAR(squared, r.squaredNorm(), 1e-3F);
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(products[i], r.dot(vectors.col(i + 1)), 1e-3F);
}

}  // namespace
}  // namespace eigenpose
