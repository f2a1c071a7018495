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
///
/// **Evidence** for an occluded object, with o the occluded share of the windows and v₂/v the votes of the
/// next object over its own:
///
///     evidence = 5·v/(1 − o) − ln max(c, ν) − v₂/v
///
/// It orders regions by the log-odds that they show the object rather than an unknown one. It has no zero of
/// its own: the model's covered_evidence is the value that unknown views reach at the rate of false
/// acceptances (see occlusion_calibration.h).

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/alignment/alignment.h"
#include "core/base/bounded_vector.h"
#include "core/model/parts_model.h"

namespace eigenpose {

/// One object and pose that windows and alignment agree on.
struct PartsPose {
  PoseVector q;
  PoseCovariance q_covariance;  ///< infinite where a DOF is not observable
  Misalignment misalignment;
  double cost = 0.0;   ///< squared distance in the alignment eigenspace after alignment
  double votes = 0.0;  ///< share of the windows' weight that votes for this pose, 0…1
  double merit = 0.0;  ///< see above
};

/// The answer for one region.
struct PartsAnswer {
  std::size_t object = 0;
  BoundedVector<PartsPose, most_poses> poses;  ///< of `object`, best first, never empty
  double score = 1.0;     ///< 1 − votes of the best pose; compare with the object's rejection score
  double occluded = 0.0;  ///< share of the windows that do not show the object, 0…1
};

/// Which object the windows show.
struct PartsIdentification {
  PartsAnswer best;
  std::optional<PartsAnswer> second;  ///< the next object
  double second_share = 0.0;          ///< its votes over those of the best, ≥ 0
  double evidence = 0.0;              ///< where the best is occluded: see above
  bool tie = false;                   ///< which of the two it is cannot be decided
};

/// Whether a region is treated as occluded.
enum class Occlusion {
  measured,  ///< where more windows are foreign than in learned views
  assumed,   ///< in any case: the merits of such answers can be compared
};

/// Recognises normalised regions. Holds scratch memory: one thread at a time; the model outlives it.
///
/// Each step returns what the next one needs: look → vote → settle. What a step returned is valid until the
/// recogniser takes that step again; using it later throws std::logic_error.
class PartsRecognizer {
 public:
  class Look;
  class Votes;

  explicit PartsRecognizer(const PartsModel& model);
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
  /// Lets the windows vote for all objects, or for those of `shortlist` (indices, all of the model).
  [[nodiscard]] Votes vote(std::span<const std::size_t> shortlist = {}) const;
  /// Votes and settles. Objects that are alike in the visible part of an occluded region are compared pixel
  /// by pixel.
  [[nodiscard]] PartsIdentification identify(std::span<const std::size_t> shortlist = {},
                                             Occlusion occlusion = Occlusion::measured) const;

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
  /// Share of the windows' weight that the best view of one object gets, background included, 0…1.
  /// @throws std::invalid_argument for an object that was not voted for.
  [[nodiscard]] double share_of(std::size_t object) const;
  /// Pose of one object. @throws as share_of.
  [[nodiscard]] PartsAnswer settle(std::size_t object, Occlusion occlusion = Occlusion::measured) const;

 private:
  friend class PartsRecognizer::Look;
  Votes(Impl& impl, std::uint64_t vote) : impl_(&impl), vote_(vote) {}
  [[nodiscard]] Impl& impl() const;

  Impl* impl_;
  std::uint64_t vote_;  ///< its serial number
};

}  // namespace eigenpose
