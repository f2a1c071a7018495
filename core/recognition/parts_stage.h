#pragma once

/// The second stage of recognition: alignment of the whole region and, where the aligned distance leaves a
/// doubt, partial matching, turned into an outcome.

#include <memory>
#include <optional>
#include <span>

#include <opencv2/core.hpp>

#include "core/model/model.h"
#include "core/recognition/aligned_match.h"
#include "core/recognition/outcome.h"
#include "core/recognition/parts_recognizer.h"
#include "core/recognition/touching_objects.h"
#include "core/search/search.h"

namespace eigenpose {

/// Judges regions. Holds scratch memory: one thread at a time.
class PartsStage {
 public:
  /// @pre model.parts is set. The model, the searches over its manifolds, and the pool outlive the stage.
  PartsStage(const Model& model, const ManifoldSearch& all, const SeparateSearches& separate,
             HypothesisPool& pool);

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
  /// One pose of one object, wherever it was found.
  struct Finding {
    std::size_t object = 0;
    std::span<const PartsPose> poses;
    RealignedDistance distance;
    double occluded = 0.0;
    double runner_up_share = 0.0;  ///< of votes; 0 where the whole region decided
    double margin = 1.0;           ///< 1/(1 + L) of the rejection threshold: ½ there, → 1 far within
    bool tie = false;
  };

  /// Decides by the whole region alone. True when it left no doubt, and `outcome` is filled.
  bool settle(const PartsRecognizer::Look& look, std::span<const float> picture, std::size_t object,
              Outcome& outcome);
  /// Decides by the windows as well. @return the object.
  std::size_t vote(const PartsRecognizer::Look& look, std::span<const float> picture, Outcome& outcome);
  void describe(const PartsIdentification& found, const RealignedDistance& distance, bool accepted,
                std::span<const float> picture, Outcome& outcome);
  void describe(const Finding& finding, bool accepted, Outcome& outcome);
  /// Distance of the region with the misalignment of the answer's best pose undone.
  RealignedDistance distance_of(std::span<const float> picture, const PartsAnswer& answer);
  [[nodiscard]] bool accepted(const PartsIdentification& found, const RealignedDistance& distance) const;
  [[nodiscard]] bool apart(std::size_t object, std::span<const double> a, std::span<const double> b) const;

  const Model& model_;
  HypothesisPool& pool_;
  PartsRecognizer recognizer_;
  AlignedMatch match_;
  TouchingObjects touching_;
  cv::Mat picture_;
  std::vector<PartsPose> poses_;
};

}  // namespace eigenpose
