#include "core/model/decision_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace eigenpose {

bool DecisionModel::gives_up_false_rejection() const {
  return held_for_acceptance && expected.false_rejection > std::max(set.false_rejection, smallest_rate());
}

double DecisionModel::distance_of(double evidence, double typical,
                                  std::optional<double> typical_color) const {
  const auto& [offset, slope, yardstick, color_slope, color_yardstick] = weights.whole;
  if (typical_color)
    evidence -= (color_slope + color_yardstick) * std::log(std::max(*typical_color, least_color_distance));
  if (slope >= 0.0) return std::numeric_limits<double>::infinity();
  return std::exp((evidence - offset - yardstick * std::log(std::max(typical, least_distance))) / slope);
}

DecisionRates rates_at(const DecisionModel& decision, double required) {
  // Of rising numbers, those below the threshold.
  const auto below = [required](const std::vector<double>& evidence) {
    return static_cast<double>(std::lower_bound(evidence.begin(), evidence.end(), required) -
                               evidence.begin());
  };
  const auto share = [](double count, std::size_t of) {
    return of == 0 ? 0.0 : count / static_cast<double>(of);
  };
  return {
      share(below(decision.known), decision.known.size()),
      share(static_cast<double>(decision.unknown.size()) - below(decision.unknown), decision.unknown.size())};
}

}  // namespace eigenpose
