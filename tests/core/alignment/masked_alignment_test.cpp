#include "core/alignment/masked_alignment.h"

#include <gtest/gtest.h>

#include "tests/support/drawn_pictures.h"

namespace eigenpose {
namespace {

constexpr double reach = 12.0 / 360.0;

AlignmentEigenspace learned(const test::DrawnObject& object) {
  const PartsViews views = test::turntable_views(object, 10.0);
  std::vector<PosePicture> pictures(views.count);
  for (std::size_t i = 0; i < views.count; ++i) make_pose_picture(views.view(i), pictures[i]);
  return AlignmentEigenspace::learn(views.axes, pictures);
}

/// 1 but for the pixels of a hidden square of the 64×64 picture.
std::vector<float> trust_without(const cv::Rect& hidden) {
  std::vector<float> trust(32 * 32, 1.0F);
  for (int r = 0; r < 32; ++r)
    for (int c = 0; c < 32; ++c)
      if (hidden.contains({2 * c, 2 * r})) trust[static_cast<std::size_t>(32 * r + c)] = 0.0F;
  return trust;
}

struct OccludedRegion {
  PosePicture picture;
  std::vector<float> trust;
};

OccludedRegion occluded(const test::DrawnObject& object, double angle, int brightness) {
  const cv::Rect hidden(10, 20, 24, 24);
  cv::Mat picture = object.view(angle);
  picture(hidden).setTo(brightness);
  OccludedRegion region;
  make_pose_picture(picture, region.picture);
  region.trust = trust_without(hidden);
  return region;
}

TEST(MaskedAligner, MovesToThePoseOfTheVisiblePixelsWhateverHidesTheOthers) {
  const test::DrawnObject object(21);
  const AlignmentEigenspace space = learned(object);
  MaskedAligner aligner({});
  for (const int brightness : {0, 120, 255})
    for (const double truth : {2.0, 95.0, 187.0, 275.0}) {
      const OccludedRegion region = occluded(object, truth, brightness);
      aligner.look(region.picture, space, region.trust);
      for (const double start : {truth - 8.0, truth + 8.0}) {
        MaskedPose pose = aligner.approach(std::span(&start, 1), reach);
        aligner.refine(pose, reach);
        EXPECT_LT(test::turn_error(pose.aligned.q[0], truth), 2.5)
            << "from " << start << " under brightness " << brightness;
        EXPECT_TRUE(pose.aligned.q_covariance[0] > 0.0 && pose.aligned.q_covariance[0] < 100.0);
      }
    }
}

TEST(MaskedAligner, LeavesLessUnexplainedAtTheRightPose) {
  const test::DrawnObject object(21);
  const AlignmentEigenspace space = learned(object);
  MaskedAligner aligner({});
  const OccludedRegion region = occluded(object, 95.0, 0);
  aligner.look(region.picture, space, region.trust);
  const double starts[] = {95.0, 215.0};
  MaskedPose poses[2];
  for (int i = 0; i < 2; ++i) {
    poses[i] = aligner.approach(std::span(&starts[i], 1), reach);
    aligner.refine(poses[i], reach);
  }
  EXPECT_LT(poses[0].unexplained, 0.5 * poses[1].unexplained);
  EXPECT_LT(poses[0].aligned.cost, poses[1].aligned.cost);
}

TEST(MaskedAligner, GivesTheSameResultWhateverItLookedAtBefore) {
  const test::DrawnObject object(21);
  const AlignmentEigenspace space = learned(object);
  const OccludedRegion first = occluded(object, 95.0, 0);
  const OccludedRegion other = occluded(object, 300.0, 255);
  const double start = 90.0;
  const auto settle = [&](MaskedAligner& aligner) {
    aligner.look(first.picture, space, first.trust);
    MaskedPose pose = aligner.approach(std::span(&start, 1), reach);
    aligner.refine(pose, reach);
    return pose.aligned;
  };
  MaskedAligner fresh({});
  MaskedAligner used({});
  used.look(other.picture, space, other.trust);
  MaskedPose before = used.approach(std::span(&start, 1), reach);
  used.refine(before, reach);
  const AlignedPose a = settle(fresh);
  const AlignedPose b = settle(used);
  EXPECT_EQ(a.q[0], b.q[0]);
  EXPECT_EQ(a.cost, b.cost);
}

TEST(MaskedAligner, ForgetsTheTrustAndTheObjectOfTheRegionBefore) {
  const test::DrawnObject object(21);
  const AlignmentEigenspace space = learned(object);
  const AlignmentEigenspace other_space = learned(test::DrawnObject(22));
  const OccludedRegion region = occluded(object, 95.0, 0);
  const std::vector<float> all(32UL * 32UL, 1.0F);
  const double start = 90.0;
  MaskedAligner fresh({});
  fresh.look(region.picture, space, region.trust);
  const AlignedPose expected = fresh.approach(std::span(&start, 1), reach).aligned;
  for (const auto& [before, trust] : {std::pair(&space, std::span<const float>(all)),
                                      std::pair(&other_space, std::span<const float>(region.trust))}) {
    MaskedAligner used({});
    used.look(region.picture, *before, trust);
    (void)used.approach(std::span(&start, 1), reach);
    used.look(region.picture, space, region.trust);
    const AlignedPose found = used.approach(std::span(&start, 1), reach).aligned;
    EXPECT_EQ(found.q[0], expected.q[0]);
    EXPECT_EQ(found.cost, expected.cost);
  }
}

TEST(MaskedAligner, FindsTheGainOfARegionWhoseEnergyIsMostlyTheOccluders) {
  const test::DrawnObject object(21);
  const AlignmentEigenspace space = learned(object);
  MaskedAligner aligner({});
  const double truth = 95.0;
  double gain[2];
  for (const int bright : {0, 1}) {
    const OccludedRegion region = occluded(object, truth, bright == 0 ? 0 : 255);
    aligner.look(region.picture, space, region.trust);
    gain[bright] = aligner.approach(std::span(&truth, 1), reach).first_gain;
  }
  EXPECT_LT(gain[0], 0.1) << "a dark occluder takes energy: the rest looks too bright";
  EXPECT_GT(gain[1], gain[0] + 0.1) << "a bright one adds energy: the rest looks too dark";
}

TEST(MaskedAligner, KeepsTheGainThatTheVisiblePixelsShow) {
  // At the true pose the first gain is right already: no round may add it again.
  const test::DrawnObject object(21);
  const AlignmentEigenspace space = learned(object);
  MaskedAligner aligner({});
  const double truth = 90.0;
  const OccludedRegion region = occluded(object, truth, 255);
  aligner.look(region.picture, space, region.trust);
  MaskedPose pose = aligner.approach(std::span(&truth, 1), reach);
  ASSERT_GT(pose.first_gain, 0.2);
  EXPECT_NEAR(pose.aligned.misalignment.gain, pose.first_gain, 0.25 * pose.first_gain);
  aligner.refine(pose, reach);
  EXPECT_NEAR(pose.aligned.misalignment.gain, pose.first_gain, 0.25 * pose.first_gain);
}

TEST(MaskedAligner, NeedsARegionFirst) {
  MaskedAligner aligner({});
  const double start = 0.0;
  MaskedPose pose;
  EXPECT_THROW((void)aligner.approach(std::span(&start, 1), reach), std::logic_error);
  EXPECT_THROW(aligner.refine(pose, reach), std::logic_error);
}

}  // namespace
}  // namespace eigenpose
