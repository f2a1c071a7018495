#pragma once

/// Which object a region shows, and its pose with the misalignment undone: partial matching and alignment
/// together.

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/alignment/alignment.h"
#include "core/model/parts_model.h"

namespace eigenpose {

/// One object and pose that windows and alignment agree on.
struct PartsPose {
  PoseNumbers q;
  PoseSquare q_covariance;  ///< infinite where a DOF cannot be seen
  Misalignment misalignment;
  double cost = 0.0;   ///< squared distance in the pose space after alignment
  double votes = 0.0;  ///< share of the windows' weight that votes for this pose, 0…1
  double merit = 0.0;  ///< log-likelihood up to a constant: votes and distance together; of covered objects
                       ///< comparable between objects
};

/// The answer for one region.
struct PartsAnswer {
  std::size_t object = 0;
  BoundedVector<PartsPose, most_poses> poses;  ///< of `object`, best first, never empty
  double score = 1.0;    ///< 1 − votes of the best pose; compare with the object's rejection score
  double covered = 0.0;  ///< share of the windows' weight that does not belong to the object, 0…1
};

/// Which object the windows show.
struct PartsIdentification {
  PartsAnswer best;
  std::optional<PartsAnswer> second;  ///< the next object
  double second_share = 0.0;          ///< its votes over those of the best, ≥ 0
  /// Where the best is covered: how much speaks for it that is hardly seen of strangers. Compare with the
  /// model's covered_evidence.
  double evidence = 0.0;
  bool tie = false;  ///< which of the two it is cannot be said
};

/// Recognises normalised regions. Holds scratch memory: one thread at a time; the model outlives it.
class PartsRecognizer {
 public:
  explicit PartsRecognizer(const PartsModel& model);
  ~PartsRecognizer();
  PartsRecognizer(PartsRecognizer&&) noexcept;
  PartsRecognizer& operator=(PartsRecognizer&&) noexcept;

  /// Takes a square 8-bit picture with the model's bands. Call before the others.
  void look(const cv::Mat& picture);
  /// The picture looked at, ready for alignment.
  [[nodiscard]] const PosePicture& pose_picture();
  /// Votes of all objects (or of `shortlist`), most first.
  std::span<const PartialVote> vote(std::span<const std::size_t> shortlist = {});
  /// Share of the windows' weight that the best view of one object gets, background or not, 0…1. Once the
  /// picture looked at has been voted on.
  [[nodiscard]] double share_of(std::size_t object) const;
  /// Pose of one object in the picture looked at, once it has been voted on.
  /// @param covered take it as covered, whatever its windows say: merits of such answers can be compared.
  PartsAnswer settle(std::size_t object, bool covered = false);
  /// Votes and settles. Objects that are alike where a covered region is to be seen are told apart pixel by
  /// pixel.
  /// @param covered take all of them as covered.
  PartsIdentification identify(std::span<const std::size_t> shortlist = {}, bool covered = false);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace eigenpose
