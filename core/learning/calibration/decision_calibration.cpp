#include "core/learning/calibration/decision_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/statistics.h"
#include "core/learning/calibration/logistic_fit.h"

namespace eigenpose {
namespace {

/// Standard deviation of a weight before any view was seen, as a share of it; and the least.
constexpr double prior_spread = 0.5;
constexpr double least_spread = 0.5;
/// Views of one object are correlated: however many there are, they weigh as much as so many independent
/// ones.
constexpr double views_that_differ = 5.0;
/// Shares of the false acceptances of regions that are visible as a whole: may be settled by the whole region
/// alone, and may be taken for occluded objects.
constexpr double settled_share = 0.1;
constexpr double occluded_share = 0.3;
/// What unknown probes of few objects are worth.
struct FewObjects {
  std::size_t enough;  ///< probes of fewer objects do not show what unknown objects are like
  double share;        ///< of the evidence that log-odds ask for, what is asked for then
};
/// With models of 1, 2, 4 and 8 of 50 objects, of 3000 views of the others none had more than 1.2 where a
/// rate of 1 % asks for 4.6.
constexpr FewObjects few_visible{8, 0.5};
/// What looks like an occluded object has more: up to 7.5 where a rate of 1 % asks for 4.6. With these,
/// models of 8 objects accept 0.6 % of other objects where 1 % is set (7 draws; 1.5 % with 16 in place of
/// 24), and answer nine in ten known views with a fifth hidden. Measured with probes that were not tinted.
constexpr FewObjects few_occluded{24, 1.2};
/// A rejected view must not have been settled by the whole region alone: of the known views, this many times
/// the rate of false rejections are left to the windows.
constexpr double left_to_windows = 2.0;

/// Two objects are alike where half of the views of one, as the other, have more evidence than this share of
/// its views have as themselves.
constexpr double alike_share = 0.25;
/// The fewest samples that an exponential tail is fitted to.
constexpr std::size_t least_tail = 10;
/// Rates below this are held as this: no number of views shows that something never happens.
constexpr double least_rate = 1e-6;
/// Less evidence than this is no evidence at all.
constexpr double least_evidence = -30.0;

constexpr double infinity = std::numeric_limits<double>::infinity();

using Probes = std::vector<const Probe*>;

/// One hypothesis: its terms of a probe, where it has any.
template <std::size_t n, typename TermsOf>
std::array<double, n> fit(const Probes& probes, const std::array<double, n>& prior, double objects,
                          const TermsOf& terms_of) {
  std::vector<std::array<double, n>> terms;
  LogisticSamples samples;
  for (const Probe* probe : probes)
    if (const std::optional<std::array<double, n>> found = terms_of(*probe)) {
      terms.push_back(*found);
      samples.positive.push_back(probe->known);
    }
  const auto rows = static_cast<Eigen::Index>(n);
  samples.terms.resize(rows, static_cast<Eigen::Index>(terms.size()));
  for (std::size_t i = 0; i < terms.size(); ++i)
    samples.terms.col(static_cast<Eigen::Index>(i)) =
        Eigen::Map<const Eigen::VectorXd>(terms[i].data(), rows);
  samples.most_weight = views_that_differ * objects;
  const Eigen::VectorXd mean = Eigen::Map<const Eigen::VectorXd>(prior.data(), rows);
  const Eigen::VectorXd sigma = (prior_spread * mean.cwiseAbs()).cwiseMax(least_spread);
  const Eigen::VectorXd weights = fit_log_odds(samples, mean, sigma);
  std::array<double, n> result{};
  std::copy_n(weights.data(), n, result.begin());
  return result;
}

/// @param prior of views of the same kind.
EvidenceWeights fit_weights(const Probes& probes, const EvidenceWeights& prior, double objects) {
  EvidenceWeights weights;
  weights.whole = fit(probes, prior.whole, objects, [](const Probe& probe) {
    return probe.hidden ? std::nullopt : std::optional(whole_terms(probe.whole));
  });
  weights.windows = fit(probes, prior.windows, objects, [](const Probe& probe) {
    return probe.windows ? std::optional(windows_terms(probe.windows->whole, probe.windows->windows))
                         : std::nullopt;
  });
  // A known view that is not hidden is no example of an occluded one.
  weights.occluded = fit(probes, prior.occluded, objects, [](const Probe& probe) {
    return probe.occluded && (probe.hidden || !probe.known)
               ? std::optional(occluded_terms(probe.occluded->match))
               : std::nullopt;
  });
  return weights;
}

/// What the recogniser will have as evidence for a probe that is visible as a whole.
double visible_evidence(const DecisionModel& decision, const Probe& probe) {
  const double whole = evidence_of(decision.weights, probe.whole);
  if (!probe.windows) return whole;
  const double windows = evidence_of(decision.weights, probe.windows->whole, probe.windows->windows);
  return whole >= decision.settled ? std::max(whole, windows) : windows;
}

/// The number that a share `rate` of all numbers falls below, estimated from a sample in rising order: within
/// the sample the k-th smallest with k = rate·(n + 1); below its lowest twentieth by an exponential tail,
/// whose mean is that of what lies below the twentieth (peaks over threshold: Pickands 1975).
double lower_tail(const std::vector<double>& rising, double rate) {
  const auto n = static_cast<double>(rising.size());
  const auto tail = std::min(std::max<std::size_t>(rising.size() / 20, least_tail), rising.size());
  const double share = static_cast<double>(tail) / (n + 1.0);
  if (rate >= share) {
    const auto rank = static_cast<std::size_t>(rate * (n + 1.0));
    return rising[std::min(rank, rising.size()) - 1];
  }
  const double begin = rising[tail - 1];
  double excess = 0.0;
  for (std::size_t i = 0; i < tail; ++i) excess += begin - std::max(rising[i], least_evidence);
  return begin - excess / static_cast<double>(tail) * std::log(share / rate);
}

/// The number that a share `rate` exceeds, likewise.
double upper_tail(const std::vector<double>& rising, double rate) {
  std::vector<double> falling(rising.rbegin(), rising.rend());
  for (double& number : falling) number = -number;
  return -lower_tail(falling, rate);
}

std::vector<double> sorted_evidence(const Probes& probes, const auto& wanted, const auto& evidence_of_probe) {
  std::vector<double> evidence;
  for (const Probe* probe : probes)
    if (wanted(*probe)) evidence.push_back(evidence_of_probe(*probe));
  std::ranges::sort(evidence);
  return evidence;
}

/// The evidence of one unknown region for the object it is taken for.
struct UnknownEvidence {
  double evidence = 0.0;
  std::size_t object = 0;
  std::size_t taken_for = 0;
};

/// In rising order.
using UnknownSample = std::vector<UnknownEvidence>;

/// @param judged of a probe: its evidence, and the object that it is for.
UnknownSample unknown_sample(const Probes& probes, const auto& wanted, const auto& judged) {
  UnknownSample sample;
  for (const Probe* probe : probes)
    if (wanted(*probe)) {
      const auto [evidence, taken_for] = judged(*probe);
      sample.push_back({evidence, probe->object, taken_for});
    }
  std::ranges::sort(sample, {}, &UnknownEvidence::evidence);
  return sample;
}

std::vector<double> evidence_without(const UnknownSample& unknown, std::optional<std::size_t> object) {
  std::vector<double> evidence;
  for (const UnknownEvidence& one : unknown)
    if (one.object != object && one.taken_for != object) evidence.push_back(one.evidence);
  return evidence;
}

/// The share of the regions that is accepted where the threshold of each is what the other objects reach at
/// the rate (leave one out).
double accepted_of_new_objects(const UnknownSample& unknown, double rate) {
  std::map<std::size_t, double> thresholds;
  std::size_t accepted = 0;
  for (const UnknownEvidence& one : unknown) {
    auto [at, fresh] = thresholds.try_emplace(one.object, infinity);
    if (fresh) {
      const std::vector<double> others = evidence_without(unknown, one.object);
      if (!others.empty()) at->second = upper_tail(others, rate);
    }
    if (one.evidence >= at->second) ++accepted;
  }
  return static_cast<double>(accepted) / static_cast<double>(unknown.size());
}

/// The rate to set among objects that were learned so that it holds for one that was not: a few objects cause
/// most false acceptances, and the worst is not among those that were seen.
double rate_for_new_objects(const UnknownSample& unknown, double rate) {
  if (unknown.empty() || accepted_of_new_objects(unknown, rate) <= rate) return rate;
  constexpr int halvings = 8;
  double holds = std::log(rate / 32.0);
  double fails = std::log(rate);
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (holds + fails);
    (accepted_of_new_objects(unknown, std::exp(middle)) <= rate ? holds : fails) = middle;
  }
  return std::exp(holds);
}

/// The evidence that unknown regions reach at the rate, by what was seen of them, and by what log-odds mean.
double accepted_at(const UnknownSample& unknown, double rate, std::size_t objects,
                   const FewObjects& few = few_visible) {
  const double by_odds = -few.share * std::log(rate);
  if (unknown.empty()) return by_odds;
  const double seen = upper_tail(evidence_without(unknown, std::nullopt), rate);
  if (objects >= few.enough) return seen;
  const double trust = static_cast<double>(objects) / static_cast<double>(few.enough);
  return trust * seen + (1.0 - trust) * by_odds;
}

void set_settled(const Probes& probes, std::size_t objects, DecisionModel& decision) {
  const auto visible = [](bool known) {
    return [known](const Probe& probe) { return probe.known == known && !probe.hidden; };
  };
  const auto whole = [&](const Probe& probe) { return evidence_of(decision.weights, probe.whole); };
  const UnknownSample unknown = unknown_sample(
      probes, visible(false), [&](const Probe& probe) { return std::pair(whole(probe), probe.taken_for); });
  const std::vector<double> known = sorted_evidence(probes, visible(true), whole);
  decision.settled = accepted_at(
      unknown, rate_for_new_objects(unknown, settled_share * decision.set.false_acceptance), objects);
  if (!known.empty())
    decision.settled =
        std::max(decision.settled, lower_tail(known, left_to_windows * decision.set.false_rejection));
}

/// Takes the unknown probes of objects out that resemble another as much as themselves: such an object is no
/// example of an unknown one. That it is one of the two can be said, and which cannot.
void leave_out_twins(const DecisionModel& decision, Probes& probes) {
  std::map<std::size_t, std::array<std::vector<double>, 2>> evidence;  // of each object, unknown and known
  for (const Probe* probe : probes)
    if (!probe->hidden)
      evidence[probe->object][probe->known ? 1 : 0].push_back(visible_evidence(decision, *probe));
  std::erase_if(probes, [&](const Probe* probe) {
    auto& [unknown, known] = evidence[probe->object];
    return !probe->known && !unknown.empty() && !known.empty() &&
           upper_median(unknown) >= quantile(known, alike_share);
  });
}

/// The evidence that unknown regions reach as occluded objects at the rate where a part is hidden, and at
/// their share of it where nothing is.
void set_occlusion(const Probes& probes, std::size_t objects, DecisionModel& decision) {
  double least = -infinity;
  for (const bool hidden : {false, true}) {
    const double rate = (hidden ? 1.0 : occluded_share) * decision.set.false_acceptance;
    const auto of_kind = [hidden](const Probe& probe) {
      return !probe.known && probe.hidden == hidden && (probe.windows || probe.hidden);
    };
    const auto shown = std::ranges::count_if(probes, [&](const Probe* probe) { return of_kind(*probe); });
    const UnknownSample evidence = unknown_sample(
        probes, [&](const Probe& probe) { return of_kind(probe) && probe.occluded; },
        [&](const Probe& probe) {
          return std::pair(evidence_of(decision.weights, probe.occluded->match), probe.occluded->taken_for);
        });
    // Regions that are not taken for occluded ones are not accepted as such: of the others, a larger share
    // may be.
    const double share = shown == 0 ? 1.0 : static_cast<double>(evidence.size()) / static_cast<double>(shown);
    if (shown == 0 || rate < share)
      least = std::max(least, accepted_at(evidence, rate / share, objects, few_occluded));
  }
  if (!std::isfinite(least))
    least = accepted_at({}, occluded_share * decision.set.false_acceptance, objects, few_occluded);
  decision.required_occluded = least;
}

/// Both thresholds, and the rates they hold. @param windows whether any probe was shown to windows: then the
/// others show nothing of a decision by windows.
void set_required(const Probes& probes, bool windows, std::size_t objects, DecisionModel& decision) {
  const auto shown = [windows](bool known) {
    return
        [windows, known](const Probe& p) { return p.known == known && !p.hidden && (!windows || p.windows); };
  };
  const auto visible = [&](const Probe& probe) { return visible_evidence(decision, probe); };
  const UnknownSample unknown = unknown_sample(probes, shown(false), [&](const Probe& probe) {
    return std::pair(visible(probe), probe.windows ? probe.windows->taken_for : probe.taken_for);
  });
  decision.known = sorted_evidence(probes, shown(true), visible);
  const double left = windows ? 1.0 - occluded_share : 1.0;
  decision.required =
      accepted_at(unknown, rate_for_new_objects(unknown, left * decision.set.false_acceptance), objects);
  decision.held_for_acceptance = true;
  if (!decision.known.empty()) {
    const double held_for_rejection = lower_tail(decision.known, decision.set.false_rejection);
    decision.held_for_acceptance = decision.required > held_for_rejection;
    decision.required = std::max(decision.required, held_for_rejection);
  }
  if (windows) set_occlusion(probes, objects, decision);
  decision.settled = std::max(decision.settled, decision.required);
  decision.unknown = sorted_evidence(probes, shown(false), [&](const Probe& probe) {
    const double evidence = visible(probe);
    if (!probe.occluded) return evidence;
    const double beyond = evidence_of(decision.weights, probe.occluded->match) - decision.required_occluded;
    return std::max(evidence, decision.required + beyond);
  });
  decision.expected = rates_at(decision, decision.required);
}

}  // namespace

EvidenceWeights prior_weights(ViewColors colors) {
  if (colors == ViewColors::none)
    return {{-5.4, -7.1, 3.3, 0.0, 0.0},
            {-11.0, -6.7, 3.3, -3.0, 3.4, -4.3, 2.7, -3.5, 0.0, 0.0},
            {0.0, 2.7, -3.4, 1.9, -2.1, 9.7, 2.6, -7.3, -14.0, 0.0, 0.0}};
  return {{0.0, -4.7, 4.0, -6.9, 5.3},
          {-4.0, -3.8, 2.5, -1.8, -1.7, -2.8, 4.7, -2.5, -5.9, 4.5},
          {-7.0, 6.1, -4.6, -0.2, -1.9, 14.8, 4.9, -4.1, -18.0, -2.7, 0.5}};
}

void check_rates(const DecisionRates& rates) {
  if (!(rates.false_rejection >= 0.0 && rates.false_rejection <= 0.5 && rates.false_acceptance >= 0.0 &&
        rates.false_acceptance <= 1.0))
    throw std::invalid_argument("the rate of false rejections is " + std::to_string(rates.false_rejection) +
                                ", allowed are 0 to 0.5; that of false acceptances is " +
                                std::to_string(rates.false_acceptance) + ", allowed are 0 to 1");
}

DecisionModel calibrate_decision(std::span<const Probe> probes, const DecisionRates& rates,
                                 std::optional<std::size_t> without) {
  check_rates(rates);
  Probes used;
  std::set<std::size_t> objects;
  bool windows = false;
  ViewColors colors = ViewColors::none;
  for (const Probe& probe : probes) {
    if (probe.whole.color) colors = ViewColors::some;
    const bool of_it = probe.object == without || probe.taken_for == without ||
                       (probe.windows && probe.windows->taken_for == without) ||
                       (probe.occluded && probe.occluded->taken_for == without);
    if (of_it) continue;
    used.push_back(&probe);
    objects.insert(probe.object);
    windows = windows || probe.windows;
  }
  DecisionModel decision;
  decision.set = {std::max(rates.false_rejection, least_rate), std::max(rates.false_acceptance, least_rate)};
  decision.weights = prior_weights(colors);
  leave_out_twins(decision, used);
  decision.weights = fit_weights(used, decision.weights, static_cast<double>(objects.size()));
  set_settled(used, objects.size(), decision);
  set_required(used, windows, objects.size(), decision);
  decision.set = rates;
  return decision;
}

}  // namespace eigenpose
