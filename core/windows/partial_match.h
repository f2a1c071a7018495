#pragma once

/// Partial matching with appearance voting: every window of a region votes for the learned views it
/// resembles.
///
/// A query window is compared with the windows of each learned view within a few cells of its place; its
/// likeness is κ = exp(−d²/2σ²). What many objects show alike is background knowledge: the window votes only
/// with what exceeds the 7th best object's κ. The region shows the object whose best view has the largest sum
/// of votes.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/windows/window_store.h"

namespace eigenpose {

/// One thing a window may vote for: a learned view, or its mirror image.
struct Candidate {
  int view = 0;
  bool mirrored = false;
};

/// What partial matching knows of one object.
struct PartsObject {
  std::vector<Candidate> candidates;
  /// store's view → candidate; several where a candidate was also learned foreshortened.
  std::vector<std::uint32_t> lane_candidate;
  /// For each candidate up to two neighbours that share its votes, −1 for none.
  std::vector<std::array<int, 2>> neighbours;
  WindowStore store;
};

struct VotingOptions {
  PositionTolerance tolerance;
  float width = 0.35F;         ///< σ of κ, in window coordinates
  float pooling = 0.9F;        ///< share of the neighbours' κ that a view gets
  int background_rank = 7;     ///< the object whose κ is background; none with as many objects or fewer
  float floor_weight = 0.05F;  ///< weight of a window without any gradient
};

/// A window whose κ for the right view is below this shows something else: a cover, a neighbour, another
/// object.
inline constexpr float foreign_likeness = 0.3F;

/// Votes for one object.
struct PartialVote {
  std::size_t object = 0;
  float score = 0.0F;  ///< sum of weighted votes of the best candidate
  int candidate = 0;   ///< that candidate
};

/// The windows of one region, ready for matching: 9×9 at stride 2.
struct QueryWindows {
  static constexpr int stride = 2;
  static constexpr int per_side = (WindowGrid::side - 1) / stride + 1;
  static constexpr int count = per_side * per_side;
  std::vector<QueryWindow> windows;
  std::vector<float> weights;
  float total_weight = 0.0F;
};

/// Matches regions against objects. Holds scratch memory: one thread at a time.
class PartialMatcher {
 public:
  PartialMatcher(std::span<const PartsObject> objects, const WindowScale& scale, VotingOptions options = {});

  /// Votes of `query` for each of `shortlist` (indices of objects), most votes first. Valid until the next
  /// call.
  std::span<const PartialVote> match(const QueryWindows& query, std::span<const std::size_t> shortlist);

  /// After `match`: votes without background and pooling for each candidate of one object of the shortlist.
  void plain_votes(const QueryWindows& query, std::size_t object, std::vector<float>& votes) const;
  /// After `match`: κ of every window of the query for one candidate and its neighbours of an object of the
  /// shortlist, and the background κ of each window.
  void window_likeness(std::size_t object, int candidate, std::vector<float>& likeness,
                       std::vector<float>& background) const;

 private:
  [[nodiscard]] float likeness(float energy, std::int32_t score) const;

  std::span<const PartsObject> objects_;
  WindowScale scale_;
  VotingOptions options_;
  std::vector<bool> one_lane_each_;  ///< objects whose candidates are their lanes
  const QueryWindows* query_ = nullptr;
  std::vector<std::size_t> offsets_;  ///< object → its first candidate in a row of scores_
  std::size_t row_length_ = 0;
  std::vector<std::int32_t> scores_;  ///< [81][candidates of the shortlist's objects]
  PlacedQueries placed_;
  std::vector<std::int32_t> lanes_;  ///< [81][lanes of an object]
  std::vector<std::int32_t> bests_;  ///< [81][shortlist]
  std::vector<float> background_;    ///< [81] κ of the background
  std::vector<float> votes_;
  std::vector<std::int32_t> sorted_;  ///< best scores at one window
  std::vector<float> kappas_;         ///< of one object's candidates at one window
  std::vector<PartialVote> result_;
};

/// Projects and quantises the windows of a map.
void make_query_windows(const OrientationGrid& map, const WindowSpace& space, const WindowScale& scale,
                        const VotingOptions& options, QueryWindows& out);

}  // namespace eigenpose
