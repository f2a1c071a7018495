#pragma once

/// Which object a region shows, and its pose with the misalignment undone: partial matching and alignment
/// together.
///
/// **Merit** of a pose orders the poses of one object. With v the share of the windows' weight that votes for
/// the pose, c its cost after alignment (AlignedPose), ν the noise of the model and n = 81 windows:
///
///     unoccluded:  merit = n·v − c/(2ν)
///     occluded:    merit = 2n·v − 0.15n·ln max(c, ν) − 0.1·u
///
/// where c is over the visible pixels and u the unexplained sum over all pixels (MaskedPose). The first is a
/// log-likelihood up to a constant if every window is one observation and c/ν is χ². The second is not: its
/// weights were chosen by measuring poses of learned views under synthetic occlusion. It may be compared
/// between objects.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/alignment/alignment.h"
#include "core/base/bounded_vector.h"
#include "core/model/parts_model.h"
#include "core/recognition/decision.h"

namespace eigenpose {

/// One object and pose that windows and alignment agree on.
struct PartsPose {
  PoseVector q;
  PoseCovariance q_covariance;  ///< infinite where a DOF is not observable
  Misalignment misalignment;
  double cost = 0.0;   ///< squared distance in the alignment eigenspace after alignment
  double votes = 0.0;  ///< share of the windows' weight that votes for this pose, 0…1
  double merit = 0.0;  ///< see above
  /// Share of the pixels that the pose leaves unexplained, where the object is occluded: u over its largest.
  double unexplained = 0.0;
};

/// The answer for one region.
struct PartsAnswer {
  std::size_t object = 0;
  BoundedVector<PartsPose, most_poses> poses;  ///< of `object`, best first, never empty
  double occluded = 0.0;                       ///< share of the windows that do not show the object, 0…1
  double foreign_likeness = 0.0;               ///< mean likeness κ of these, where the object is occluded
};

/// Which object an occluded region shows.
struct PartsIdentification {
  PartsAnswer best;
  std::optional<PartsAnswer> second;  ///< the next object
  OccludedMatch match;                ///< of the best
  /// Λ of the best, and of the next: less by what its pose has less merit. −∞ without a second.
  double evidence = 0.0;
  double second_evidence = 0.0;
};

/// Recognises normalised regions. Holds scratch memory: one thread at a time; both models outlive it.
///
/// Each step returns what the next one needs: look → vote → settle or identify_occluded. What a step returned
/// is valid until the recogniser takes that step again; using it later throws std::logic_error.
class PartsRecognizer {
 public:
  class Look;
  class Votes;

  /// @param decision its weights and constants are used; its thresholds are the caller's.
  PartsRecognizer(const PartsModel& model, const DecisionModel& decision);
  ~PartsRecognizer();
  PartsRecognizer(PartsRecognizer&&) noexcept;
  PartsRecognizer& operator=(PartsRecognizer&&) noexcept;

  /// Takes a square 8-bit picture with the model's bands.
  Look look(const cv::Mat& picture);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// One picture that the recogniser looked at.
class PartsRecognizer::Look {
 public:
  /// The picture, ready for alignment.
  [[nodiscard]] const PosePicture& pose_picture() const;
  /// Its colours compared with those of an object's views but some; nothing where views are grey.
  [[nodiscard]] std::optional<ColorMatch> color_match(std::size_t object,
                                                      std::span<const int> left_out = {}) const;
  /// Lets the windows vote for all objects, or for those of `shortlist` (indices, all of the model).
  [[nodiscard]] Votes vote(std::span<const std::size_t> shortlist = {}) const;

 private:
  friend class PartsRecognizer;
  Look(Impl& impl, std::uint64_t picture) : impl_(&impl), picture_(picture) {}
  [[nodiscard]] Impl& impl() const;

  Impl* impl_;
  std::uint64_t picture_;  ///< its serial number
};

/// The votes of one picture's windows.
class PartsRecognizer::Votes {
 public:
  /// All that were voted for, most votes first.
  [[nodiscard]] std::span<const PartialVote> ranked() const;
  /// Votes for one object, and for the best of the others. @throws std::invalid_argument for an object that
  /// was not voted for.
  [[nodiscard]] WindowsMatch match(std::size_t object) const;
  /// Share of the windows that do not show the view of an object with most votes, 0…1. @throws as match.
  [[nodiscard]] double occluded_share(std::size_t object) const;
  /// Poses of one object; on the visible pixels where more windows are foreign than in learned views.
  /// @throws as match.
  [[nodiscard]] PartsAnswer settle(std::size_t object) const;
  /// The object of a partly occluded region. Objects that are alike in what is visible are compared pixel by
  /// pixel.
  [[nodiscard]] PartsIdentification identify_occluded() const;
  /// How much better an occluded object's pose explains the pixels that it trusts than its best pose explains
  /// all of them: ln of the ratio of their costs. Where nothing hides the object, about 0.
  [[nodiscard]] double gain_of_masking(const PartsAnswer& answer) const;
  /// The votes of the same windows if some learned views of an object had not been learned; all its views:
  /// if the object had not. These votes are no longer valid. @throws as match.
  [[nodiscard]] Votes without(std::size_t object, std::span<const int> views) const;

 private:
  friend class PartsRecognizer::Look;
  Votes(Impl& impl, std::uint64_t vote) : impl_(&impl), vote_(vote) {}
  [[nodiscard]] Impl& impl() const;

  Impl* impl_;
  std::uint64_t vote_;  ///< its serial number
};

}  // namespace eigenpose
