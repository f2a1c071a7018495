#pragma once

/// Objects that touch or overlap, in one region.
///
/// If the camera has not moved since the views were learned, an object at a pose has a known size. The
/// region's bounding box touches its objects on all four sides, so at least one object stands in a corner:
/// boxes of learned sizes are tried there and matched as occluded objects. The best is removed, and the rest
/// is searched in the same way. The result counts only if the evidence for every object is sufficient and
/// together they explain the region.

#include <optional>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "core/image/normalization.h"
#include "core/image/segmentation.h"
#include "core/model/model.h"
#include "core/recognition/limits.h"
#include "core/recognition/parts_recognizer.h"
#include "core/recognition/view_extents.h"

namespace eigenpose {

/// One of several touching objects.
struct TouchingObject {
  cv::Rect box;                ///< in the cut-out, pixels; may reach beyond it
  std::vector<float> picture;  ///< as the normaliser makes it of that box
  PartsIdentification found;
  double required =
      0.0;  ///< the evidence that was asked of it: more or less than of a region that stands alone
};

/// A region split into its objects.
struct SplitRegion {
  std::vector<TouchingObject> objects;  ///< none when the region could not be split
  /// Boxes in the cut-out where an unknown object may stand.
  std::vector<cv::Rect> unknown;
  /// A limit ended the search: the stop token, the time, or the number of looks.
  bool unfinished = false;
};

/// Splits regions of touching objects. Holds scratch memory: one thread at a time.
class TouchingObjects {
 public:
  /// @param model has parts. @param extents of their views. @param recognizer of them; the three outlive
  /// this.
  TouchingObjects(const Model& model, const ViewExtents& extents, PartsRecognizer& recognizer);

  /// The object in this pose was learned so much smaller that the region may show another beside it.
  [[nodiscard]] bool too_large(const cv::Size& region, std::size_t object, std::span<const double> q) const;
  /// @param cut the region's pixels, in its box. @return valid until the next call.
  const SplitRegion& split(const cv::Mat& cut, const Background& background, const RecognitionLimits& limits);

 private:
  /// A box that may hold an object.
  struct Trial {
    cv::Rect box;
    std::size_t extent = 0;
    double votes = 0.0;
  };

  /// Whether one more box may be looked at; else the search is unfinished.
  bool may_look();
  /// Makes the picture of a box of `work_`, and shows it to the recogniser. Nothing where it is black, or a
  /// limit is reached.
  std::optional<PartsRecognizer::Look> look(const cv::Rect& box, std::vector<float>& picture);
  enum class Places { corners, all };
  /// Boxes in the corners of `outline`, or all over it, most promising first.
  /// @param visible share of an object's votes that it must get.
  std::vector<Trial> trials(const cv::Rect& outline, double visible, Places places);
  /// The size of the learned view nearest to a pose; empty where the object came ready-cut.
  [[nodiscard]] cv::Size learned_size(std::size_t object, std::span<const double> q) const;
  /// The object in a box, and its box corrected by the misalignment found.
  TouchingObject settle(const cv::Rect& box, std::span<const std::size_t> shortlist);
  /// Objects in `outline` with enough evidence, most evidence first: in its corners, or away from them where
  /// no corner holds any. @param visible as in trials.
  std::vector<TouchingObject> candidates(const cv::Rect& outline, double visible);
  /// Of these boxes.
  std::vector<TouchingObject> candidates(std::span<const Trial> trials);
  /// Mask of the pixels of `work_` that an object occupies.
  cv::Mat silhouette(const TouchingObject& object) const;
  /// Adds to one first object what else is found, until nothing remains. @return the share of the region that
  /// is explained.
  double complete(TouchingObject first, const cv::Mat& foreground, SplitRegion& way);
  /// Of all ways to split the region, the one that explains most of it, into result_. @return the share
  /// explained.
  double search(const cv::Mat& cut, const cv::Mat& foreground, const cv::Rect& outline);
  /// Matches each object of result_ once more, with the others removed from its picture.
  void match_again(const cv::Mat& cut);
  /// Keeps the objects of result_ if all have enough evidence; else those whose evidence is beyond doubt.
  void accept(double explained);

  const NormalizationOptions& normalization_;
  const PartsModel& parts_;
  const DecisionModel& decision_;
  PartsRecognizer& recognizer_;
  Normalizer normalizer_;
  const ViewExtents& extents_;
  Background background_;
  cv::Mat work_;  ///< the cut-out without the objects found so far
  cv::Mat crop_;
  cv::Mat picture_;  ///< bytes of the box looked at
  int looks_left_ = 0;
  const RecognitionLimits* limits_ = nullptr;  ///< within `split`
  TimePoint deadline_;                         ///< likewise
  bool unfinished_ = false;
  SplitRegion result_;
};

}  // namespace eigenpose
