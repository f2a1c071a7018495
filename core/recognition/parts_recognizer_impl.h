#pragma once

/// What parts_recognizer.cpp (votes, poses of visible objects) and occluded_region.cpp (occluded ones) share.
/// Elsewhere, include parts_recognizer.h.

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "core/alignment/alignment.h"
#include "core/alignment/masked_alignment.h"
#include "core/color/chromaticity.h"
#include "core/recognition/parts_recognizer.h"
#include "core/windows/orientation_grid.h"
#include "core/windows/partial_match.h"

namespace eigenpose {

/// Windows of a picture that do not show an object.
struct ForeignWindows {
  double share = 0.0;          ///< of all windows
  double mean_likeness = 0.0;  ///< their mean κ
};

/// A pose of an occluded object that is being followed.
struct OccludedStart {
  MaskedPose pose;
  double votes = 0.0;
  double merit = 0.0;
};

/// An object that may be partly visible in an occluded region.
struct OccludedAnswer {
  PartsAnswer answer;
  std::vector<float> trust;           ///< of the pixels, by the object's best view
  std::vector<OccludedStart> starts;  ///< best first, not empty
};

struct PartsRecognizer::Impl {
  Impl(const PartsModel& learned, const DecisionModel& rule)
      : model(learned),
        decision(rule),
        mapper(learned.background),
        matcher(learned.objects, learned.scale, learned.voting),
        rematcher(learned.objects, learned.scale, learned.voting),
        aligner([&] {
          options.noise = learned.noise;
          return options;
        }()),
        masked_aligner(options) {
    everything.resize(learned.objects.size());
    std::iota(everything.begin(), everything.end(), std::size_t{0});
  }

  const PartsModel& model;
  const DecisionModel& decision;
  AlignmentOptions options;
  OrientationGridMaker mapper;
  PartialMatcher matcher;    ///< of the picture as it is
  PartialMatcher rematcher;  ///< of the picture aligned with one pose
  PoseAligner aligner;
  MaskedAligner masked_aligner;
  std::vector<std::size_t> everything;
  cv::Mat picture;
  cv::Mat pixels;  ///< the picture as floats, once they were asked for
  bool pixels_made = false;
  cv::Mat aligned_pixels;
  cv::Mat aligned;
  OrientationGrid map;
  QueryWindows windows;  ///< of the picture, once they were asked for
  bool windows_made = false;
  QueryWindows aligned_windows;
  PosePicture pose_picture;  ///< likewise
  bool pose_picture_made = false;
  ChromaticityMap colors;  ///< likewise
  ChromaticityRoots color_roots{};
  bool colors_made = false;
  std::uint64_t pictures = 0;  ///< looked at so far
  std::uint64_t votes = 0;     ///< taken so far
  /// Views that do not vote, and that colours are not compared with.
  std::size_t left_out_object = 0;
  std::vector<int> left_out_views;
  std::span<const PartialVote> ranked;
  std::vector<float> plain_votes;    ///< of one object's views, in the picture
  std::vector<float> aligned_votes;  ///< the same in the aligned one
  std::vector<float> likeness;
  std::vector<float> background;

  const PosePicture& posed();
  void make_colors();
  std::optional<ColorMatch> color_match(std::size_t object, std::span<const int> left_out);
  /// Of the pixels that are visible. @param trust of them, as pixel_trust gives it.
  std::optional<ColorMatch> color_match_of_visible(std::size_t object, std::span<const float> trust);
  void vote(std::span<const std::size_t> shortlist);
  void vote_without(std::size_t object, std::span<const int> views);
  WindowsMatch match_of(std::size_t object, const std::vector<float>& plain) const;
  /// Poses of one object on the visible pixels. @param occluded its share.
  PartsAnswer find_occluded_poses(std::size_t object, const std::vector<float>& plain, double occluded);
  PartsIdentification identify_occluded();
  /// ln of the cost of the best pose over all pixels, over that of the best pose over the visible ones.
  double gain_of_masking(const PartsAnswer& answer);
  const std::vector<float>& votes_of(std::size_t object);
  double share_after_alignment(std::size_t object, const PartsPose& pose);
  /// How much of the picture one candidate, or its neighbours, do not explain. Leaves κ in `likeness`.
  ForeignWindows foreign_windows(std::size_t object, int candidate);
  /// The foreign share for the view with most votes.
  double occluded_share(std::size_t object, const std::vector<float>& plain);
  PartsAnswer find_poses(std::size_t object, const std::vector<float>& plain, double occluded);
  OccludedAnswer approach_occluded(std::size_t object, const std::vector<float>& plain, double occluded);
  /// Follows the starts of this merit and more to the end.
  void refine_occluded(OccludedAnswer& found, double hopeless);
  /// Objects that may be occluded here, best first, each with a pose. The second is there if any other was
  /// voted for.
  std::vector<OccludedAnswer> find_rivals();
  /// The pose of a candidate, moved by the parabola through its neighbours' votes.
  [[nodiscard]] PoseVector voted_pose(std::size_t object, const std::vector<float>& plain,
                                      int candidate) const;
  [[nodiscard]] std::vector<float> pixel_trust() const;
};

}  // namespace eigenpose
