#pragma once

/// Recognition of one region with windows: alignment of the whole region, then partial matching where that
/// leaves a doubt, then the decision.

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "core/base/bounded_vector.h"
#include "core/model/model.h"
#include "core/recognition/aligned_match.h"
#include "core/recognition/outcome.h"
#include "core/recognition/parts_recognizer.h"
#include "core/recognition/recognition_index.h"
#include "core/recognition/touching_objects.h"
#include "core/search/search.h"

namespace eigenpose {

/// One object that a region may show, aligned and compared with all of it.
struct WholeCandidate {
  std::size_t object = 0;
  PoseVector q;               ///< its best pose
  Misalignment misalignment;  ///< of that pose
  RealignedDistance distance;
  std::optional<ColorMatch> color;  ///< where views have colours
  WindowsMatch windows;             ///< once the windows have voted
  double evidence = 0.0;            ///< likewise
};

/// The one or two candidates of a region, the more likely first.
using WholeCandidates = BoundedVector<WholeCandidate, 2>;

/// Judges regions. Holds scratch memory: one thread at a time.
class PartsStage {
 public:
  /// @pre the model has parts. The index and the pool outlive the stage.
  PartsStage(const RecognitionIndex& index, HypothesisPool& pool);

  /// Fills everything of `outcome` but its box.
  /// @param picture as the normaliser makes it. @param nearest the object whose manifold is nearest.
  /// @return the object of outcome.best.
  std::size_t judge(std::span<const float> picture, std::size_t nearest, Outcome& outcome);
  /// A region judged to show `object` is larger than the object was learned: it may show more.
  [[nodiscard]] bool too_large(const cv::Size& region, std::size_t object, const Outcome& outcome) const {
    return touching_.too_large(region, object, outcome.best->q);
  }
  /// The touching or overlapping objects of a region that `judge` called unknown, or that is too large.
  /// @param cut the region's pixels. @return valid until the next call.
  const SplitRegion& split(const cv::Mat& cut, const Background& background,
                           const RecognitionLimits& limits) {
    return touching_.split(cut, background, limits);
  }
  /// Fills everything of `outcome` but its box.
  void describe(const TouchingObject& object, Outcome& outcome);

 private:
  /// What is said of a region.
  struct Finding {
    std::size_t object = 0;
    std::span<const PartsPose> poses;  ///< of the object, best first
    RealignedDistance distance;
    double occluded = 0.0;
    Evidence evidence;
  };

  /// The decision by the whole region alone, where it leaves no doubt. @param nearest with its `aligned`
  /// poses.
  bool settle(const PartsRecognizer::Look& look, std::span<const AlignedPose> aligned,
              const WholeCandidate& nearest, Outcome& outcome);
  /// Decides by the windows as well. @return the object.
  std::size_t vote(const PartsRecognizer::Look& look, std::span<const float> picture,
                   const WholeCandidate& nearest, Outcome& outcome);
  /// Fills everything of `outcome` but its box.
  void describe(const Finding& finding, Outcome& outcome);
  /// @param required the evidence that is asked of it.
  void describe_occluded(const PartsIdentification& found, std::span<const float> picture, double required,
                         Outcome& outcome);
  [[nodiscard]] bool apart(std::size_t object, std::span<const double> a, std::span<const double> b) const;

  const Model& model_;
  HypothesisPool& pool_;
  PartsRecognizer recognizer_;
  AlignedMatch match_;
  TouchingObjects touching_;
  cv::Mat picture_;
  std::vector<PartsPose> poses_;
};

/// A region as the whole-region match takes it.
struct WholeRegion {
  std::span<const float> picture;     ///< as the normaliser makes it
  std::optional<std::size_t> absent;  ///< an object that counts as not learned
};

/// Aligns a region with an object, and measures the distance after alignment.
WholeCandidate align_whole(const PartsRecognizer::Look& look, AlignedMatch& match, const WholeRegion& region,
                           std::size_t object);

/// The two objects with most votes, compared with the whole region. The windows choose between them; where
/// they see about as much of both, the distance does. @param aligned a candidate that need not be aligned
/// again.
WholeCandidates compare_whole(const Model& model, const PartsRecognizer::Look& look,
                              const PartsRecognizer::Votes& votes, AlignedMatch& match,
                              const WholeRegion& region, const WholeCandidate& aligned);

/// Log-odds of the first of two candidates over the second: n·(b₁ − b₂), with n windows as independent
/// observations and b their discriminating votes; where these are tied, and what their distances say.
double lead_of(const Model& model, const WholeCandidate& first, const WholeCandidate& second);

/// The object of a region that may be partly occluded: some windows of the object with most votes are
/// foreign, not too many, and masking explains the region much better. Nothing otherwise.
std::optional<PartsIdentification> identify_if_occluded(const Model& model,
                                                        const PartsRecognizer::Votes& votes);

/// What the decision weighs of a distance, and of colours.
WholeMatch whole_match(const Model& model, std::size_t object, const RealignedDistance& distance,
                       const std::optional<ColorMatch>& color);
inline WholeMatch whole_match(const Model& model, const WholeCandidate& candidate) {
  return whole_match(model, candidate.object, candidate.distance, candidate.color);
}

}  // namespace eigenpose
