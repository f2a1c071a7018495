#include "core/recognition/object_eigenspace_index.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/image/appearance_maker.h"
#include "core/image/segmentation.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

/// The appearance of one object in a scene.
std::vector<float> appearance_of(const Model& model, int kind, double angle) {
  const cv::Mat scene = testing::scene_with(kind, angle, {}, 77);
  Segmenter segmenter(model.normalization.segmentation);
  EXPECT_EQ(segmenter.segment(scene).size(), 1U);
  Normalizer normalizer(model.normalization);
  std::vector<float> picture(picture_length(model.normalization));
  normalizer.normalize(segmenter.cut_out(scene, 0), segmenter.background().level, picture);
  std::vector<float> appearance(appearance_length(model.normalization));
  AppearanceMaker(model.normalization).make(picture, appearance);
  return appearance;
}

TEST(ObjectEigenspaceIndex, MeasuresTheDistanceBetweenWholePictures) {
  const Model& model = *testing::learned_world().model;
  const ObjectEigenspaceIndex index(model);
  ReducedRegion region;
  for (int kind = 1; kind <= 3; ++kind)
    for (const double angle : {11.0, 200.0}) {
      const auto appearance = appearance_of(model, kind, angle);
      index.reduce(appearance, region);
      const NormalizationOptions& options = model.normalization;
      Eigen::VectorXf reduced(static_cast<Eigen::Index>(reduced_side(options)) * reduced_side(options) *
                              appearance_bands(options));
      shrink_appearance(appearance, options.size, appearance_bands(options), reduced_side(options),
                        {reduced.data(), static_cast<std::size_t>(reduced.size())});
      reduced.normalize();
      for (std::size_t o = 0; o < model.objects.size(); ++o) {
        ASSERT_TRUE(index.has(o));
        const ClosestPoint found = index.closest(o, region);
        EXPECT_EQ(found.manifold, o);
        // Distance from the picture to the interpolated view at the pose found, pixel by pixel.
        const ObjectEigenspace& space = *model.objects[o].space;
        const double q = found.q[0];
        const Eigen::VectorXd view = space.eigenspace.mean.cast<double>() +
                                     space.eigenspace.basis.cast<double>() * space.manifold.evaluate({&q, 1});
        EXPECT_NEAR(found.distance, (reduced.cast<double>() - view).norm(), 1e-4);
        // No other pose is nearer.
        for (double other = 0.0; other < 360.0; other += 5.0) {
          const Eigen::VectorXd at =
              space.eigenspace.mean.cast<double>() +
              space.eigenspace.basis.cast<double>() * space.manifold.evaluate({&other, 1});
          EXPECT_LE(found.distance, (reduced.cast<double>() - at).norm() + 1e-4);
        }
      }
    }
}

TEST(ObjectEigenspaceIndex, IsNearestToTheObjectShownWhateverItsEnergy) {
  const Model& model = *testing::learned_world().model;
  const ObjectEigenspaceIndex index(model);
  ReducedRegion region;
  const char* names[] = {"", "one", "two", "three"};
  for (int kind = 1; kind <= 3; ++kind) {
    auto appearance = appearance_of(model, kind, 130.0);
    std::vector<double> distances[2];
    for (const int dimmed : {0, 1}) {
      index.reduce(appearance, region);
      for (std::size_t o = 0; o < model.objects.size(); ++o)
        distances[dimmed].push_back(index.closest(o, region).distance);
      for (float& x : appearance) x *= 0.3F;
    }
    const auto nearest = std::ranges::min_element(distances[0]) - distances[0].begin();
    EXPECT_EQ(model.objects[static_cast<std::size_t>(nearest)].name, names[kind]);
    for (std::size_t o = 0; o < distances[0].size(); ++o) EXPECT_NEAR(distances[0][o], distances[1][o], 1e-5);
  }
}

TEST(ObjectEigenspaceIndex, KnowsWhichObjectsHaveAnEigenspaceOfTheirOwn) {
  Model model = *testing::learned_world().model;
  model.objects[1].space.reset();
  const ObjectEigenspaceIndex index(model);
  for (std::size_t o = 0; o < model.objects.size(); ++o) EXPECT_EQ(index.has(o), o != 1);
}

}  // namespace
}  // namespace eigenpose
