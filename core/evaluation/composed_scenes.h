#pragma once

/// Scenes composed of pictures of single objects: several objects at known places, apart or one before the
/// other, to measure recognition on.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "core/dataset/image_set.h"
#include "core/image/segmentation.h"
#include "core/recognition/outcome.h"

namespace eigenpose {

struct SceneOptions {
  std::size_t count = 0;  ///< scenes, of 2 to 4 objects each; none unless asked for
  /// Absent: objects stand apart. Else each but the first touches another, and no object is covered by more
  /// than this share.
  std::optional<double> overlap;
  unsigned seed = 1;
};

/// A view of a set.
struct SetView {
  std::size_t set = 0;
  std::size_t view = 0;
};

struct ComposedScene {
  struct Placed {
    SetView shown;
    cv::Rect box;  ///< of all its pixels, covered or not
  };
  cv::Mat picture;
  std::vector<Placed> objects;
};

/// Composes scenes. One thread at a time; the sets must stay.
class SceneComposer {
 public:
  /// @param views what may be shown. @throws std::invalid_argument without any, or for an overlap outside
  /// 0…0.9.
  SceneComposer(std::span<const ImageSet> sets, std::span<const SetView> views, SceneOptions options,
                const SegmentationOptions& segmentation);

  /// Scene number `index`, the same whenever it is asked for. Pictures in which nothing is found are passed
  /// over; so it may show fewer than two objects. @throws what ImageSet::load throws.
  ComposedScene compose(std::size_t index);

 private:
  struct Cut {
    cv::Mat pixels;
    cv::Mat mask;  ///< filled outline, 255 inside
    cv::Scalar background;
  };
  [[nodiscard]] std::optional<Cut> cut(const SetView& shown);

  std::span<const ImageSet> sets_;
  std::span<const SetView> views_;
  SceneOptions options_;
  Segmenter segmenter_;
};

/// What was said of composed scenes.
struct SceneReport {
  std::size_t scenes = 0;
  std::size_t objects = 0;
  std::size_t found = 0;            ///< objects with a box of their own: half of the two boxes' union or more
  std::size_t right = 0;            ///< of these, those whose nearest object is the true one
  std::size_t recognized = 0;       ///< of these, those neither unknown nor ambiguous
  std::size_t extra = 0;            ///< boxes where no object stands
  std::vector<double> pose_errors;  ///< |error| of the first DOF in its unit, of the right ones
};

/// Adds what was said of one scene.
void count_scene(const ComposedScene& scene, std::span<const ImageSet> sets,
                 std::span<const Outcome> outcomes, SceneReport& report);

}  // namespace eigenpose
