#pragma once

/// Objects that touch or overlap, in one region.
///
/// Where the camera stands as it stood when the views were learned, an object at a pose has a known size. The
/// outline of the region's box belongs to one object or another, so each object but those in the middle
/// stands in one of its corners: boxes of learned sizes are tried there and matched as covered objects. The
/// best is taken out, and what remains is looked at in the same way. The answer counts only if all objects
/// are sure and together make up the region.

#include <vector>

#include <opencv2/core.hpp>

#include "core/image/normalization.h"
#include "core/image/segmentation.h"
#include "core/recognition/parts_recognizer.h"

namespace eigenpose {

/// One object of a fused region.
struct FusedObject {
  cv::Rect box;                ///< in the cut-out, pixels; may reach beyond it
  std::vector<float> picture;  ///< as the normaliser makes it of that box
  PartsIdentification found;
};

/// What a fused region shows.
struct TakenApart {
  std::vector<FusedObject> objects;  ///< none when it cannot be said
  /// In the cut-out, where something else may stand that is not known.
  std::vector<cv::Rect> unknown;
};

/// Takes fused regions apart. Holds scratch memory: one thread at a time.
class TouchingObjects {
 public:
  /// Both outlive it. @param recognizer of the model's parts.
  TouchingObjects(const NormalizationOptions& normalization, const PartsModel& parts,
                  PartsRecognizer& recognizer);

  /// An object in this pose was learned so much smaller that the region may show another beside it.
  [[nodiscard]] bool too_large(const cv::Size& region, std::size_t object, std::span<const double> q) const;
  /// @param cut the region's pixels, in its box. @return what is valid until the next call.
  const TakenApart& take_apart(const cv::Mat& cut, const Background& background);

 private:
  /// Learned views of about the same size.
  struct Extent {
    cv::Size size;
    std::vector<std::size_t> objects;
  };
  /// A box that may hold an object.
  struct Trial {
    cv::Rect box;
    std::size_t extent = 0;
    double votes = 0.0;
  };

  void group_extents(double same);
  /// A region as large as this may be two objects.
  [[nodiscard]] bool possible(const cv::Size& region) const;
  /// Makes the picture of a box of `work_`, and shows it to the recogniser. False where it is black.
  bool look(const cv::Rect& box, std::vector<float>& picture);
  enum class Places { corners, all };
  /// Boxes in the corners of `outline`, or all over it, most promising first.
  /// @param visible share of an object's votes that it must get.
  std::vector<Trial> trials(const cv::Rect& outline, double visible, Places places);
  /// The size of the learned view nearest to a pose; empty where the object came ready-cut.
  [[nodiscard]] cv::Size learned_size(std::size_t object, std::span<const double> q) const;
  /// The object in a box, its box set right by what alignment found.
  FusedObject settle(const cv::Rect& box, std::span<const std::size_t> shortlist);
  /// What may stand in `outline` and is sure enough, surest first; where no corner holds anything, away from
  /// them. @param visible as in trials.
  std::vector<FusedObject> candidates(const cv::Rect& outline, double visible);
  /// Of these boxes.
  std::vector<FusedObject> candidates(std::span<const Trial> trials);
  /// The foreground pixels that an object takes up.
  cv::Mat silhouette(const FusedObject& object) const;
  /// Follows one first object until nothing remains. Returns the share of the region that is explained.
  double complete(FusedObject first, const cv::Mat& foreground, TakenApart& way);

  const NormalizationOptions& normalization_;
  const PartsModel& parts_;
  PartsRecognizer& recognizer_;
  Normalizer normalizer_;
  std::vector<Extent> extents_;
  cv::Size least_;
  Background background_;
  cv::Mat work_;  ///< the cut-out without the objects that were found
  cv::Mat crop_;
  cv::Mat picture_;     ///< bytes of the box looked at
  int looks_left_ = 0;  ///< so that no region takes for ever
  TakenApart result_;
};

}  // namespace eigenpose
