#pragma once

/// The second stage of recognition: alignment of the whole region and, where that does not settle it, partial
/// matching, turned into an outcome.

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
  /// @pre model.parts is set. The model, `search`, over its manifolds, and the pool outlive the stage.
  PartsStage(const Model& model, const ManifoldSearch& search, HypothesisPool& pool);

  /// Fills everything of `outcome` but its box.
  /// @param picture as the normaliser makes it. @param nearest the object whose manifold is nearest.
  /// @return the object of outcome.best.
  std::size_t judge(std::span<const float> picture, std::size_t nearest, Outcome& outcome);
  /// A region judged to show `object` that is larger than the object was learned: it may show more.
  [[nodiscard]] bool too_large(const cv::Size& region, std::size_t object, const Outcome& outcome) const {
    return fused_.too_large(region, object, outcome.best->q);
  }
  /// Of a region that `judge` did not know, or that is too large: the objects that make it up, where they
  /// touch or overlap. @param cut the region's pixels. @return what is valid until the next call.
  const TakenApart& take_apart(const cv::Mat& cut, const Background& background) {
    return fused_.take_apart(cut, background);
  }
  /// Fills everything of `outcome` but its box.
  void describe(const FusedObject& object, Outcome& outcome);

 private:
  /// One pose of one object, wherever it was found.
  struct Finding {
    std::size_t object = 0;
    std::span<const PartsPose> poses;
    RealignedDistance distance;
    double covered = 0.0;
    double runner_up_share = 0.0;  ///< of votes; 0 where the whole region settled it
    double margin = 1.0;           ///< how clearly the votes' answer was accepted: ½ at the threshold, …1
    bool tie = false;
  };

  /// The whole region alone. True when it left no doubt, and `outcome` is filled.
  bool settle(std::span<const float> picture, std::size_t object, Outcome& outcome);
  /// Its windows as well. @return the object.
  std::size_t vote(std::span<const float> picture, Outcome& outcome);
  void describe(const PartsIdentification& found, const RealignedDistance& distance, bool accepted,
                std::span<const float> picture, Outcome& outcome);
  void describe(const Finding& finding, bool accepted, Outcome& outcome);
  /// Distance once a pose of the answer's object is undone, the best one.
  RealignedDistance distance_of(std::span<const float> picture, const PartsAnswer& answer);
  [[nodiscard]] bool accepted(const PartsIdentification& found, const RealignedDistance& distance) const;
  [[nodiscard]] bool apart(std::size_t object, std::span<const double> a, std::span<const double> b) const;

  const Model& model_;
  HypothesisPool& pool_;
  PartsRecognizer recognizer_;
  AlignedMatch match_;
  TouchingObjects fused_;
  cv::Mat picture_;
  std::vector<PartsPose> poses_;
};

}  // namespace eigenpose
