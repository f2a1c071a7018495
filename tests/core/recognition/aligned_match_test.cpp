#include "core/recognition/aligned_match.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/image/segmentation.h"
#include "tests/support/parts_world.h"

namespace eigenpose {
namespace {

constexpr double everywhere = std::numeric_limits<double>::infinity();

/// A view of an object, normalised.
std::vector<float> picture_of(const Model& model, int kind, double angle) {
  const cv::Mat scene = testing::scene_with(kind, angle, testing::PartsWorld::knobs(), 5);
  Segmenter segmenter(model.normalization.segmentation);
  EXPECT_EQ(segmenter.segment(scene).size(), 1U);
  Normalizer normalizer(model.normalization);
  std::vector<float> picture(picture_length(model.normalization));
  normalizer.normalize(segmenter.cut_out(scene, 0), segmenter.background().level, picture);
  return picture;
}

TEST(SeparateSearches, LookAtOneManifoldEach) {
  const ModelSearches searches(*testing::parts_world().model);
  const Eigen::VectorXf point = searches.manifolds[1].evaluate({{100.0}}).cast<float>();
  for (std::size_t o = 0; o < searches.manifolds.size(); ++o) {
    const auto found = searches.separate[o].nearest(point, 10);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].distance < 1e-5, o == 1);
    EXPECT_EQ(searches.separate[o].manifolds().data(), &searches.manifolds[o]);
  }
}

TEST(AlignedMatch, MeasuresToTheOwnManifoldAndToTheNearestOther) {
  const auto& world = testing::parts_world();
  const ModelSearches searches(*world.model);
  AlignedMatch match(*world.model, searches, everywhere);
  for (const auto& [kind, name] : {std::pair{1, "one"}, std::pair{2, "two"}, std::pair{3, "three"}}) {
    const std::size_t own = world.index_of(name);
    const auto picture = picture_of(*world.model, kind, 77.0);
    for (std::size_t o = 0; o < 3; ++o) {
      const RealignedDistance found = match.distance(picture, {}, {o});
      EXPECT_NEAR(found.own, searches.separate[o].nearest(match.point())[0].distance, 1e-6);
      ASSERT_TRUE(found.other);
      EXPECT_NE(found.other->manifold, o);
      if (o == own) {
        EXPECT_LT(found.own, 0.5 * found.other->distance) << name;
      } else {
        EXPECT_EQ(found.other->manifold, own) << name;
      }
    }
  }
}

TEST(AlignedMatch, LooksForOthersWithinItsReachOnly) {
  const auto& world = testing::parts_world();
  const ModelSearches searches(*world.model);
  const std::size_t own = world.index_of("one");
  const auto picture = picture_of(*world.model, 1, 77.0);
  AlignedMatch far(*world.model, searches, everywhere);
  const RealignedDistance all = far.distance(picture, {}, {own});
  for (const double reach : {0.99 * all.other->distance, 1.01 * all.other->distance}) {
    AlignedMatch match(*world.model, searches, reach);
    const RealignedDistance found = match.distance(picture, {}, {own});
    EXPECT_EQ(found.other.has_value(), reach > all.other->distance);
    EXPECT_NEAR(found.own, all.own, 1e-6) << "the own distance is known at any reach";
  }
}

TEST(AlignedMatch, AnAbsentObjectIsNoRival) {
  const auto& world = testing::parts_world();
  const ModelSearches searches(*world.model);
  AlignedMatch match(*world.model, searches, everywhere);
  const std::size_t own = world.index_of("one");
  const auto picture = picture_of(*world.model, 1, 77.0);
  for (std::size_t o = 0; o < 3; ++o) {
    if (o == own) continue;
    ASSERT_EQ(match.distance(picture, {}, {o}).other->manifold, own);
    const RealignedDistance without = match.distance(picture, {}, {o, own});
    ASSERT_TRUE(without.other);
    EXPECT_EQ(without.other->manifold, 3 - o - own);
    EXPECT_NEAR(without.own, match.distance(picture, {}, {o}).own, 1e-9);
  }
}

TEST(AlignedMatch, IsNearerOnceTheMisalignmentIsUndone) {
  const auto& world = testing::parts_world();
  const ModelSearches searches(*world.model);
  const std::size_t own = world.index_of("two");
  AlignedMatch match(*world.model, searches, everywhere);
  const auto picture = picture_of(*world.model, 2, 140.0);
  const int size = world.model->normalization.size;
  std::vector<float> moved(picture.size());
  undo_misalignment(picture, size, 3, {0.0, 0.03, -0.02, 0.03, 0.05}, moved);
  std::vector<std::uint8_t> bytes(moved.size());
  quantize(moved, bytes);
  PosePicture pose_picture;
  make_pose_picture(cv::Mat(size, size, CV_8UC3, bytes.data()), pose_picture);
  const AlignedPose& pose = match.align(pose_picture, own).front();
  const double before = match.distance(moved, {}, {own}).own;
  const double after = match.distance(moved, pose.misalignment, {own}).own;
  EXPECT_LT(after, 0.5 * before);
  EXPECT_NEAR(std::remainder(pose.q[0] - 140.0, 360.0), 0.0, 3.0);
}

/// The same with the gains of blue and of red.
std::vector<float> tinted(std::vector<float> picture, float blue, float red) {
  for (std::size_t i = 0; i < picture.size(); i += 3) {
    picture[i] *= blue;
    picture[i + 2] *= red;
  }
  return picture;
}

/// To the object's manifold, with nothing undone.
double plain_distance(const Model& model, const ModelSearches& searches, const std::vector<float>& picture,
                      std::size_t object) {
  AppearanceMaker maker(model.normalization);
  Eigen::VectorXf appearance(model.eigenspace.length());
  const float energy = maker.make(picture, {appearance.data(), static_cast<std::size_t>(appearance.size())});
  const Eigen::VectorXf point =
      model.eigenspace.basis.transpose() * appearance / energy - searches.mean_point;
  return searches.separate[object].nearest(point)[0].distance;
}

TEST(AlignedMatch, UndoesATintAndNoMore) {
  const auto& world = testing::parts_world();
  const ModelSearches searches(*world.model);
  AlignedMatch match(*world.model, searches, everywhere);
  for (const auto& [kind, name] : {std::pair{1, "one"}, std::pair{2, "two"}}) {
    const std::size_t own = world.index_of(name);
    const auto picture = picture_of(*world.model, kind, 77.0);
    const double plain = match.distance(picture, {}, {own}).own;
    const auto slightly = tinted(picture, 0.95F, 1.06F);
    const double added = plain_distance(*world.model, searches, slightly, own) - plain;
    EXPECT_GT(added, 0.01) << name;
    EXPECT_LT(match.distance(slightly, {}, {own}).own, plain + 0.2 * added) << name;
    EXPECT_GT(match.distance(tinted(picture, 0.6F, 1.4F), {}, {own}).own, 3.0 * plain) << name;
  }
}

TEST(AlignedMatch, UndoesTheTintBesideTheObjectItIsComparedWith) {
  // Whatever it was compared with before.
  const auto& world = testing::parts_world();
  const ModelSearches searches(*world.model);
  AlignedMatch match(*world.model, searches, everywhere);
  const auto picture = tinted(picture_of(*world.model, 1, 77.0), 1.05F, 0.95F);
  const std::size_t own = world.index_of("one");
  const double alone = match.distance(picture, {}, {own}).own;
  (void)match.distance(picture, {}, {world.index_of("two")});
  EXPECT_EQ(match.distance(picture, {}, {own}).own, alone);
}

}  // namespace
}  // namespace eigenpose
