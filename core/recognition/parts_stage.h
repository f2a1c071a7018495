#pragma once

/// The second stage of recognition: partial matching and alignment of one region, turned into an outcome.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include <opencv2/core.hpp>

#include "core/model/model.h"
#include "core/parts/parts_recognizer.h"
#include "core/recognition/outcome.h"

namespace eigenpose {

/// Another pose counts as another when it is this share of a DOF's range away: 30° of a turn.
inline constexpr double poses_apart = 1.0 / 12.0;

/// Judges regions by windows and alignment. Holds scratch memory: one thread at a time.
class PartsStage {
 public:
  /// @pre model.parts is set. The model outlives the stage.
  explicit PartsStage(const Model& model);

  /// Fills everything of `outcome` but its box.
  /// @param picture as the normaliser makes it. @param sure the object that the whole region shows beyond
  /// doubt, if there is one: then the others are only asked when alignment does not agree.
  void judge(std::span<const float> picture, std::optional<std::size_t> sure, Outcome& outcome);

 private:
  void describe(const PartsAnswer& answer, double runner_up_share, Outcome& outcome) const;
  [[nodiscard]] bool accepted(const PartsAnswer& answer, double runner_up_share) const;

  const Model& model_;
  PartsRecognizer recognizer_;
  cv::Mat picture_;
};

}  // namespace eigenpose
