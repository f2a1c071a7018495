#include "core/windows/partial_match.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/base/statistics.h"

namespace eigenpose {
namespace {

/// Offset of an object that was not matched.
constexpr std::size_t absent = std::numeric_limits<std::size_t>::max();
/// Score of what was not learned: below that of every learned window.
constexpr std::int32_t no_score = std::numeric_limits<std::int32_t>::min();

/// exp(−x) for x ≥ 0 from a table: relative error below 1 %, 0 beyond 16.
float fast_exp_of_minus(float x) {
  constexpr int per_unit = 64;
  constexpr int size = 16 * per_unit;
  static const std::array<float, size> table = [] {
    std::array<float, size> made{};
    for (int i = 0; i < size; ++i) {
      made[static_cast<std::size_t>(i)] = std::exp(-(static_cast<float>(i) + 0.5F) / per_unit);
    }
    return made;
  }();
  if (!(x < static_cast<float>(size) / per_unit)) return 0.0F;
  const int i = static_cast<int>(x * per_unit);
  return i < 0 ? 1.0F : table[static_cast<std::size_t>(i)];
}

/// The largest of `count` ≥ 1 scores. Eight at a time, which the compiler makes vectors of.
std::int32_t largest(const std::int32_t* scores, std::size_t count) {
  std::array<std::int32_t, WindowStore::group> most{};
  most.fill(no_score);
  std::size_t i = 0;
  for (; i + most.size() <= count; i += most.size()) {
    for (std::size_t k = 0; k < most.size(); ++k) most[k] = std::max(most[k], scores[i + k]);
  }
  for (; i < count; ++i) most[0] = std::max(most[0], scores[i]);
  return *std::ranges::max_element(most);
}

}  // namespace

void make_query_windows(const OrientationGrid& map, const WindowSpace& space, const WindowScale& scale,
                        const VotingOptions& options, QueryWindows& out) {
  thread_local Eigen::MatrixXf coordinates;
  space.project(map, QueryWindows::stride, coordinates, &out.weights);
  out.windows.resize(static_cast<std::size_t>(coordinates.cols()));
  out.total_weight = 0.0F;
  for (Eigen::Index i = 0; i < coordinates.cols(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    out.windows[at] = quantize_query(coordinates.col(i).data(), scale);
    out.weights[at] = out.weights[at] / space.mean_mass() + options.floor_weight;
    out.total_weight += out.weights[at];
  }
}

PartialMatcher::PartialMatcher(std::span<const PartsObject> objects, const WindowScale& scale,
                               VotingOptions options)
    : objects_(objects), scale_(scale), options_(options) {
  one_lane_each_.reserve(objects.size());
  for (const PartsObject& object : objects) {
    bool each = object.lane_candidate.size() == object.candidates.size();
    for (std::size_t lane = 0; lane < object.lane_candidate.size() && each; ++lane)
      each = object.lane_candidate[lane] == lane;
    one_lane_each_.push_back(each);
  }
}

float PartialMatcher::likeness(float energy, std::int32_t score) const {
  const float squared = energy - 2.0F * scale_.product() * static_cast<float>(score);
  return fast_exp_of_minus(std::max(squared, 0.0F) / (2.0F * options_.width * options_.width));
}

void PartialMatcher::score_object(std::size_t object) {
  const PartsObject& parts = objects_[object];
  parts.store.best_scores(placed_, lanes_.data());
  const std::size_t lanes = parts.store.groups() * WindowStore::group;
  const std::size_t candidates = parts.candidates.size();
  for (std::size_t w = 0; w < query_->windows.size(); ++w) {
    const std::int32_t* lane_scores = lanes_.data() + w * lanes;
    std::int32_t* out = scores_.data() + w * row_length_ + offsets_[object];
    if (one_lane_each_[object]) {
      std::copy_n(lane_scores, candidates, out);
    } else {
      std::fill_n(out, candidates, no_score);
      for (std::size_t lane = 0; lane < parts.lane_candidate.size(); ++lane) {
        std::int32_t& best = out[parts.lane_candidate[lane]];
        best = std::max(best, lane_scores[lane]);
      }
    }
  }
}

void PartialMatcher::find_bests(std::size_t i) {
  const std::size_t candidates = objects_[shortlist_[i]].candidates.size();
  for (std::size_t w = 0; w < query_->windows.size(); ++w) {
    const std::int32_t* scores = scores_.data() + w * row_length_ + offsets_[shortlist_[i]];
    bests_[w * shortlist_.size() + i] = largest(scores, candidates);
  }
}

void PartialMatcher::readmit() {
  if (excluded_.empty()) return;
  for (const auto& [place, score] : excluded_) scores_[place] = score;
  excluded_.clear();
  find_bests(excluded_of_);
}

std::int32_t PartialMatcher::find_background(std::size_t window) {
  const auto rank = static_cast<std::size_t>(options_.background_rank);
  if (shortlist_.size() <= rank) return std::numeric_limits<std::int32_t>::min();
  const auto bests = std::span(bests_).subspan(window * shortlist_.size(), shortlist_.size());
  sorted_.assign(bests.begin(), bests.end());
  const std::int32_t floor = order_statistic(sorted_, rank - 1, std::greater<>());
  background_[window] = likeness(query_->windows[window].energy, floor);
  return floor;
}

void PartialMatcher::add_votes(std::size_t window, std::size_t i) {
  const PartsObject& object = objects_[shortlist_[i]];
  const std::int32_t* scores = scores_.data() + window * row_length_ + offsets_[shortlist_[i]];
  float* votes = votes_.data() + offsets_[shortlist_[i]];
  const std::size_t candidates = object.candidates.size();
  kappas_.resize(candidates);
  for (std::size_t c = 0; c < candidates; ++c)
    kappas_[c] = likeness(query_->windows[window].energy, scores[c]);
  for (std::size_t c = 0; c < candidates; ++c) {
    float kappa = kappas_[c];
    for (const int n : object.neighbours[c])
      if (n >= 0) kappa = std::max(kappa, options_.pooling * kappas_[static_cast<std::size_t>(n)]);
    votes[c] += query_->weights[window] * std::max(0.0F, kappa - background_[window]);
  }
}

std::span<const PartialVote> PartialMatcher::match(const QueryWindows& query,
                                                   std::span<const std::size_t> shortlist) {
  query_ = &query;
  shortlist_.assign(shortlist.begin(), shortlist.end());
  excluded_.clear();
  offsets_.assign(objects_.size(), absent);
  row_length_ = 0;
  std::size_t most_lanes = 0;
  for (const std::size_t o : shortlist) {
    offsets_[o] = row_length_;
    row_length_ += objects_[o].candidates.size();
    most_lanes = std::max(most_lanes, objects_[o].store.groups() * WindowStore::group);
  }
  const std::size_t count = query.windows.size();
  scores_.resize(count * row_length_);
  lanes_.resize(count * most_lanes);
  bests_.resize(count * shortlist_.size());
  placed_.place(query.windows, QueryWindows::stride, options_.tolerance, scale_);
  for (std::size_t i = 0; i < shortlist_.size(); ++i) {
    score_object(shortlist_[i]);
    find_bests(i);
  }
  return count_votes();
}

std::span<const PartialVote> PartialMatcher::match_without(std::size_t object,
                                                           std::span<const int> candidates) {
  const std::size_t offset = offset_of(object);
  readmit();
  excluded_of_ = static_cast<std::size_t>(std::ranges::find(shortlist_, object) - shortlist_.begin());
  for (std::size_t w = 0; w < query_->windows.size(); ++w)
    for (const int candidate : candidates) {
      const std::size_t place = w * row_length_ + offset + static_cast<std::size_t>(candidate);
      excluded_.emplace_back(place, scores_[place]);
      scores_[place] = no_score;
    }
  find_bests(excluded_of_);
  return count_votes();
}

std::span<const PartialVote> PartialMatcher::count_votes() {
  const std::size_t count = query_->windows.size();
  votes_.assign(row_length_, 0.0F);
  background_.assign(count, 0.0F);
  for (std::size_t w = 0; w < count; ++w) {
    const std::int32_t floor = find_background(w);
    for (std::size_t i = 0; i < shortlist_.size(); ++i)
      if (bests_[w * shortlist_.size() + i] > floor) add_votes(w, i);
  }

  result_.clear();
  for (const std::size_t o : shortlist_) {
    const float* votes = votes_.data() + offsets_[o];
    const float* best = std::max_element(votes, votes + objects_[o].candidates.size());
    result_.push_back({o, *best, static_cast<int>(best - votes)});
  }
  std::sort(result_.begin(), result_.end(), [](const PartialVote& a, const PartialVote& b) {
    return a.score != b.score ? a.score > b.score : a.object < b.object;
  });
  return result_;
}

std::size_t PartialMatcher::offset_of(std::size_t object) const {
  if (object >= offsets_.size() || offsets_[object] == absent)
    throw std::invalid_argument("object " + std::to_string(object) +
                                " was not matched: it is not on the shortlist of the last match");
  return offsets_[object];
}

void PartialMatcher::plain_votes(std::size_t object, std::vector<float>& votes) const {
  const std::size_t offset = offset_of(object);
  votes.assign(objects_[object].candidates.size(), 0.0F);
  for (std::size_t w = 0; w < query_->windows.size(); ++w) {
    const std::int32_t* scores = scores_.data() + w * row_length_ + offset;
    for (std::size_t c = 0; c < votes.size(); ++c)
      votes[c] += query_->weights[w] * likeness(query_->windows[w].energy, scores[c]);
  }
}

void PartialMatcher::window_likeness(std::size_t object, int candidate, std::vector<float>& likeness_of,
                                     std::vector<float>& background) const {
  const std::size_t offset = offset_of(object);
  const std::size_t count = query_->windows.size();
  likeness_of.resize(count);
  background = background_;
  for (std::size_t w = 0; w < count; ++w) {
    const std::int32_t* scores = scores_.data() + w * row_length_ + offset;
    float kappa = likeness(query_->windows[w].energy, scores[candidate]);
    for (const int n : objects_[object].neighbours[static_cast<std::size_t>(candidate)])
      if (n >= 0) kappa = std::max(kappa, likeness(query_->windows[w].energy, scores[n]));
    likeness_of[w] = kappa;
  }
}

}  // namespace eigenpose
