#pragma once

/// Partial matching with appearance voting: every window of a region votes for the learned views it
/// resembles.
///
/// A query window w is compared with the windows of each learned view v within a few cells of its place; with
/// d² the smallest squared distance of their coordinates, its likeness is κ(w, v) = exp(−d²/2σ²). What many
/// objects have in common does not discriminate (background knowledge): with κ₀(w) the 7th best object's κ,
/// the window votes max(0, κ − κ₀) times its weight. A view also gets a share of its neighbours' κ (pooling).
/// The region shows the object whose best view has the largest sum of votes.

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/windows/window_store.h"

namespace eigenpose {

/// What a window may vote for: a learned view, or its mirror image.
struct Candidate {
  int view = 0;
  bool mirrored = false;
};

/// What partial matching knows of one object.
struct PartsObject {
  std::vector<Candidate> candidates;
  /// View of the store → candidate; several views where a candidate was also learned foreshortened.
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

/// A window whose κ for the right view is below this shows something else: an occluding or another object.
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
  /// call, as long as the query stays. @pre the shortlist is not empty.
  std::span<const PartialVote> match(const QueryWindows& query, std::span<const std::size_t> shortlist);

  /// The same votes once more, as if some candidates of one object had not been learned. They stay excluded
  /// until the next call of either function. @throws std::invalid_argument for an object that was not on the
  /// shortlist of the last match.
  std::span<const PartialVote> match_without(std::size_t object, std::span<const int> candidates);

  /// Votes of the query matched last for each candidate of one object, without background and pooling.
  /// @throws std::invalid_argument for an object that was not on its shortlist.
  void plain_votes(std::size_t object, std::vector<float>& votes) const;
  /// κ of every window of the query matched last for one candidate of an object or its neighbours, and the
  /// background κ of each window. @throws as plain_votes.
  void window_likeness(std::size_t object, int candidate, std::vector<float>& likeness,
                       std::vector<float>& background) const;

 private:
  [[nodiscard]] float likeness(float energy, std::int32_t score) const;
  /// Scores of all windows for the candidates of the shortlist's i-th object.
  void score_object(std::size_t object);
  /// The best score of each window for the shortlist's i-th object.
  void find_bests(std::size_t i);
  /// Votes of all windows, from their scores.
  std::span<const PartialVote> count_votes();
  /// Gives the candidates that are excluded their scores back.
  void readmit();
  /// The background score of one window, and its κ; no votes at or below that score.
  std::int32_t find_background(std::size_t window);
  /// Adds the votes of one window for the shortlist's i-th object.
  void add_votes(std::size_t window, std::size_t i);
  /// Where the object's scores of window 0 begin in scores_. @throws as plain_votes.
  [[nodiscard]] std::size_t offset_of(std::size_t object) const;

  std::span<const PartsObject> objects_;
  WindowScale scale_;
  VotingOptions options_;
  std::vector<bool> one_lane_each_;  ///< objects whose candidates are their lanes
  const QueryWindows* query_ = nullptr;
  std::vector<std::size_t> shortlist_;  ///< of the last match
  std::vector<std::size_t> offsets_;    ///< object → its first candidate in a row of scores_
  std::size_t row_length_ = 0;
  std::vector<std::int32_t> scores_;  ///< [81][candidates of the shortlist's objects]
  PlacedQueries placed_;
  std::vector<std::int32_t> lanes_;  ///< [81][lanes of an object]
  std::vector<std::int32_t> bests_;  ///< [81][shortlist]
  /// Scores of the excluded candidates, and where they belong.
  std::vector<std::pair<std::size_t, std::int32_t>> excluded_;
  std::size_t excluded_of_ = 0;    ///< place of their object on the shortlist
  std::vector<float> background_;  ///< [81] κ of the background
  std::vector<float> votes_;
  std::vector<std::int32_t> sorted_;  ///< best scores at one window
  std::vector<float> kappas_;         ///< of one object's candidates at one window
  std::vector<PartialVote> result_;
};

/// Projects and quantises the windows of a map.
void make_query_windows(const OrientationGrid& map, const WindowSpace& space, const WindowScale& scale,
                        const VotingOptions& options, QueryWindows& out);

}  // namespace eigenpose
