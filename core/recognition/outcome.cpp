#include "core/recognition/outcome.h"

#include <cmath>
#include <limits>
#include <utility>

#include "core/recognition/decision.h"

namespace eigenpose {

std::string_view verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::recognized:
      return "recognized";
    case Verdict::unknown:
      return "unknown";
    case Verdict::ambiguous:
      return "ambiguous";
    case Verdict::touches_border:
      return "touches_border";
    case Verdict::too_small:
      return "too_small";
  }
  return "unknown";
}

Verdict verdict_of(const Evidence& evidence, const Tuning& tuning) {
  if (evidence.best < evidence.required) return Verdict::unknown;
  const bool two =
      evidence.second > evidence.best - tuning.ambiguous_lead && evidence.second >= evidence.required;
  return two ? Verdict::ambiguous : Verdict::recognized;
}

void Outcome::decide(const Evidence& by, const Tuning& tuning) {
  verdict = verdict_of(by, tuning);
  evidence = by.best;
  required_evidence = by.required;
  confidence = confidence_of(by.best, by.second);
}

void Outcome::set_covariance(std::span<const double> covariance, double scale,
                             const std::vector<bool>& observable) {
  const std::size_t m = observable.size();
  q_sigma.clear();
  q_covariance.clear();
  for (std::size_t a = 0; a < m; ++a) {
    for (std::size_t b = 0; b < m; ++b) {
      const bool seen = observable[a] && observable[b];
      q_covariance.push_back(seen     ? scale * covariance[a * m + b]
                             : a == b ? std::numeric_limits<double>::infinity()
                                      : 0.0);
    }
    q_sigma.push_back(std::sqrt(q_covariance[a * m + a]));
  }
}

void HypothesisPool::fill(std::optional<Hypothesis>& hypothesis, const std::string& object,
                          std::span<const double> q, double distance) {
  if (!hypothesis && !spare_.empty()) {
    hypothesis = std::move(spare_.back());
    spare_.pop_back();
  }
  if (!hypothesis) hypothesis.emplace();
  hypothesis->object = object;
  hypothesis->q.assign(q.begin(), q.end());
  hypothesis->distance = distance;
}

void HypothesisPool::give_back(std::optional<Hypothesis>& hypothesis) {
  if (!hypothesis) return;
  spare_.push_back(std::move(*hypothesis));
  hypothesis.reset();
}

void HypothesisPool::clear(Outcome& outcome) {
  outcome.verdict = Verdict::unknown;
  outcome.box = {};
  give_back(outcome.best);
  give_back(outcome.runner_up);
  give_back(outcome.other_pose);
  outcome.q_sigma.clear();
  outcome.q_covariance.clear();
  outcome.evidence = 0.0;
  outcome.required_evidence = 0.0;
  outcome.covered_share = 0.0;
  outcome.confidence = 0.0;
  outcome.unfinished = false;
}

std::vector<std::vector<double>> covariance_rows(const Outcome& outcome) {
  const std::size_t m = outcome.q_sigma.size();
  std::vector<std::vector<double>> rows;
  rows.reserve(m);
  for (auto row = outcome.q_covariance.begin(); row != outcome.q_covariance.end();
       row += static_cast<std::ptrdiff_t>(m))
    rows.emplace_back(row, row + static_cast<std::ptrdiff_t>(m));
  return rows;
}

}  // namespace eigenpose
