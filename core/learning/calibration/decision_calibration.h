#pragma once

/// From probes to the decision: weights, thresholds, and the rates that they hold.
///
/// **Weights.** Logistic regression of known against unknown probes, with a prior (`prior_weights`): a model
/// of one or two objects has the prior, one of many its own weights.
///
/// **Threshold.** The evidence of known probes below which the set share of false rejections lies; the
/// evidence of unknown probes above which that of false acceptances does. Both are quantiles of the sample,
/// and beyond its lowest (highest) twentieth of an exponential tail, as a few hundred probes do not show one
/// in a thousand. Where both rates can be held, the threshold is the one of false rejections. Where not, that
/// of false acceptances wins: a wrong name is worse than none. It is held for objects that were not learned:
/// the threshold is such that each object, judged by a threshold from the probes of the others, is accepted
/// at the rate. A log-odds bounds the rate of false acceptances by itself, P(Λ > t | unknown) ≤ e^−t; a share
/// of that t decides where there are few objects.

#include <optional>
#include <span>

#include "core/learning/calibration/probes.h"
#include "core/model/decision_model.h"

namespace eigenpose {

/// What views show beside brightness.
enum class ViewColors { none, some };

/// The weights before any view was seen. Measured: core/recognition/README.md, "Constants".
EvidenceWeights prior_weights(ViewColors colors);

/// @throws std::invalid_argument for rates out of range: 0…0.5 of false rejections, 0…1 of false acceptances.
void check_rates(const DecisionRates& rates);

/// The decision that the probes support.
/// @param without an object whose probes are not used, as if it had not been learned.
/// @throws as check_rates.
DecisionModel calibrate_decision(std::span<const Probe> probes, const DecisionRates& rates,
                                 std::optional<std::size_t> without = std::nullopt);

}  // namespace eigenpose
