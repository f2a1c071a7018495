#include "core/recognition/decision.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace eigenpose {
namespace {

/// Shares below this are measured as this.
constexpr double least_share = 0.01;
/// Other objects farther than this are all the same: not near.
constexpr double far = 0.3;
/// The gap where there is no other object: the usual one of a view of a known object.
constexpr double usual_gap = -1.0;

template <std::size_t n>
double dot(const std::array<double, n>& a, const std::array<double, n>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

double log_distance(double distance) {
  return std::log(std::max(distance, least_distance));
}

/// ln of the next object's votes over the own.
double vote_gap(const WindowsMatch& match) {
  if (!match.next) return usual_gap;
  return std::log(std::max(*match.next, least_share) / std::max(match.discriminating, least_share));
}

/// Zeros where there are no colours.
std::array<double, 2> color_terms(const std::optional<ColorMatch>& match) {
  if (!match) return {};
  const auto log_of = [](double h) { return std::log(std::max(h, least_color_distance)); };
  return {log_of(match->distance), log_of(match->typical)};
}

template <std::size_t n>
std::array<double, n + 2> joined(const std::array<double, n>& terms, const std::array<double, 2>& colors) {
  std::array<double, n + 2> all{};
  std::ranges::copy(terms, all.begin());
  std::ranges::copy(colors, all.begin() + n);
  return all;
}

}  // namespace

std::array<double, 5> whole_terms(const WholeMatch& match) {
  return joined(std::array{1.0, log_distance(match.distance), log_distance(match.typical)},
                color_terms(match.color));
}

std::array<double, 10> windows_terms(const WholeMatch& whole, const WindowsMatch& windows) {
  return joined(std::array{1.0, log_distance(whole.distance), log_distance(whole.typical),
                           log_distance(std::min(whole.other, far)), windows.votes, windows.typical_votes,
                           windows.discriminating, vote_gap(windows)},
                color_terms(whole.color));
}

std::array<double, 11> occluded_terms(const OccludedMatch& match) {
  return joined(
      std::array{1.0, match.windows.votes, match.windows.typical_votes, match.windows.discriminating,
                 vote_gap(match.windows), match.occluded, 0.01 * match.merit,
                 // An occluder hides windows and pixels alike; what differs in colour only changes windows.
                 std::abs(match.occluded - match.unexplained),
                 // An occluder is nothing like the object; another object may be a little.
                 match.foreign_likeness},
      color_terms(match.color));
}

double evidence_of(const EvidenceWeights& weights, const WholeMatch& match) {
  return dot(weights.whole, whole_terms(match));
}

double evidence_of(const EvidenceWeights& weights, const WholeMatch& whole, const WindowsMatch& windows) {
  return dot(weights.windows, windows_terms(whole, windows));
}

double evidence_of(const EvidenceWeights& weights, const OccludedMatch& match) {
  return dot(weights.occluded, occluded_terms(match));
}

double lead_of_distance(const Tuning& tuning, double typical, double first, double second) {
  const double s = std::max(typical, least_distance);
  return 0.5 * tuning.effective_dimensions * (second * second - first * first) / (s * s);
}

double confidence_of(double best, double second) {
  // The largest exponent is taken out: none overflows.
  const double most = std::max({best, second, 0.0});
  const double own = std::exp(best - most);
  return own / (own + std::exp(second - most) + std::exp(-most));
}

}  // namespace eigenpose
