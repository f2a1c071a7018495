#include "core/evaluation/evidence_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/base/statistics.h"

namespace eigenpose {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// The evidence that was required of regions, the upper median.
double usual_requirement(std::span<const RegionRecord> records) {
  std::vector<double> required;
  for (const RegionRecord& record : records)
    if (record.matched()) required.push_back(record.required_evidence);
  return required.empty() ? infinity : upper_median(required);
}

/// What a record has beyond what was required of it, on the scale of the usual requirement; −∞ where there is
/// no evidence.
double evidence_of(const RegionRecord& record, double usual) {
  if (!record.matched() || std::isnan(record.evidence)) return -infinity;
  if (record.required_evidence == usual) return record.evidence;
  return record.evidence - record.required_evidence + usual;
}

/// How many of `sorted` reach the threshold.
std::size_t reaching(const std::vector<double>& sorted, double threshold) {
  return static_cast<std::size_t>(sorted.end() - std::ranges::lower_bound(sorted, threshold));
}

EvidenceCurve::Point point_in_use(std::span<const RegionRecord> records, double usual,
                                  const EvidenceCurve& curve) {
  std::size_t rejected = 0;
  std::size_t accepted = 0;
  std::size_t wrong = 0;
  for (const RegionRecord& record : records) {
    const bool reached = record.matched() && record.evidence >= record.required_evidence;
    if (record.known && !reached) ++rejected;
    if (record.known && reached && !record.best_is_right()) ++wrong;
    if (!record.known && reached) ++accepted;
  }
  return {usual, rate_of(rejected, curve.known), rate_of(accepted, curve.unknown),
          rate_of(wrong, curve.known)};
}

}  // namespace

EvidenceCurve evidence_curve(std::span<const RegionRecord> records) {
  const double usual = usual_requirement(records);
  std::vector<double> known;
  std::vector<double> wrong;
  std::vector<double> unknown;
  for (const RegionRecord& record : records) {
    const double evidence = evidence_of(record, usual);
    (record.known ? known : unknown).push_back(evidence);
    if (record.known && !record.best_is_right()) wrong.push_back(evidence);
  }
  if (known.empty() || unknown.empty())
    throw std::invalid_argument("a curve of both errors needs known and unknown objects, there are " +
                                std::to_string(known.size()) + " and " + std::to_string(unknown.size()) +
                                " views of them");
  for (std::vector<double>* values : {&known, &wrong, &unknown}) std::ranges::sort(*values);
  std::vector<double> thresholds(known.size() + unknown.size());
  std::ranges::merge(known, unknown, thresholds.begin());
  thresholds.erase(thresholds.begin(), std::ranges::upper_bound(thresholds, -infinity));
  thresholds.erase(std::unique(thresholds.begin(), thresholds.end()), thresholds.end());

  EvidenceCurve curve;
  curve.known = known.size();
  curve.unknown = unknown.size();
  for (const double threshold : thresholds)
    curve.points.push_back({threshold, rate_of(known.size() - reaching(known, threshold), known.size()),
                            rate_of(reaching(unknown, threshold), unknown.size()),
                            rate_of(reaching(wrong, threshold), known.size())});
  curve.points.push_back({infinity, 1.0, 0.0, 0.0});
  curve.in_use = point_in_use(records, usual, curve);
  return curve;
}

}  // namespace eigenpose
