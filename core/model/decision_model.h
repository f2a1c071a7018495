#pragma once

/// What decides whether a region shows the object it resembles most, or an unknown one: the weights of the
/// evidence, the threshold, and the two rates it holds.

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

namespace eigenpose {

/// Distances below this are measured as this: nothing is nearer than noise.
inline constexpr double least_distance = 1e-4;
/// The same for distances of colours.
inline constexpr double least_color_distance = 0.08;

/// Log-odds linear in what was measured (logistic regression). What each weight multiplies is defined by
/// `whole_terms`, `windows_terms` and `occluded_terms` of core/recognition/decision.h.
struct EvidenceWeights {
  std::array<double, 5> whole{};      ///< of the whole region alone
  std::array<double, 10> windows{};   ///< of the whole region and its windows together
  std::array<double, 11> occluded{};  ///< of a region that is partly occluded

  friend bool operator==(const EvidenceWeights&, const EvidenceWeights&) = default;
};

/// Two rates: shares of the regions that are decided wrongly.
struct DecisionRates {
  double false_rejection = 0.001;   ///< learned objects that are called unknown
  double false_acceptance = 0.005;  ///< unknown objects that get a name

  friend bool operator==(const DecisionRates&, const DecisionRates&) = default;
};

/// Constants of the decision that are neither derived nor learned. They are saved with a model, so that it
/// decides the same in a later program. How each was measured: core/recognition/README.md, "Constants".
struct Tuning {
  /// The whole region settles which object it shows when all others are this much less likely (natural
  /// logarithm).
  double settled_lead = 3.0;
  /// It is ambiguous which of two objects a region shows when the second is at most this much less likely:
  /// ln(0.7/0.3).
  double ambiguous_lead = 0.847;
  /// Windows cannot tell two objects apart when the second has at least this share of the first's votes: then
  /// the distance of the whole region does.
  double tied_votes = 0.97;
  /// Two poses are told apart when one is this much less likely: a factor of 20.
  double pose_lead = 3.0;
  /// The pose is not in doubt, without looking at windows, when all others are this much less likely.
  double settled_pose_lead = 8.0;
  /// The curvature of the cost underestimates σ of the pose: this many times.
  double sigma_inflation = 1.8;
  /// Components of a point that vary independently when a view is moved: its distance² spreads over so many.
  double effective_dimensions = 6.0;
  /// A region is not occluded where masking explains less: ln of the ratio of costs (a factor of e).
  double least_masking_gain = 1.0;
  /// A region that is occluded by more than this share is unknown.
  double most_occluded = 0.5;

  friend bool operator==(const Tuning&, const Tuning&) = default;
};

/// Calls `visit(name, constant)` for every constant of a Tuning.
template <typename SomeTuning, typename Visit>
void for_each_constant(SomeTuning&& tuning, const Visit& visit) {
  visit("settled_lead", tuning.settled_lead);
  visit("ambiguous_lead", tuning.ambiguous_lead);
  visit("tied_votes", tuning.tied_votes);
  visit("pose_lead", tuning.pose_lead);
  visit("settled_pose_lead", tuning.settled_pose_lead);
  visit("sigma_inflation", tuning.sigma_inflation);
  visit("effective_dimensions", tuning.effective_dimensions);
  visit("least_masking_gain", tuning.least_masking_gain);
  visit("most_occluded", tuning.most_occluded);
}

/// Learned once, immutable.
struct DecisionModel {
  EvidenceWeights weights;
  /// A region with less evidence (log-odds) for its best object is unknown.
  double required = std::numeric_limits<double>::infinity();
  /// The same of a region that is taken for a partly occluded object.
  double required_occluded = std::numeric_limits<double>::infinity();
  /// With this much evidence of the whole region alone, windows are not looked at; ≥ required.
  double settled = std::numeric_limits<double>::infinity();
  /// `required` is what the rate of false acceptances asks for, more than that of false rejections does.
  bool held_for_acceptance = false;
  DecisionRates set;       ///< by the user
  DecisionRates expected;  ///< what the learned views say that `required` holds
  /// Evidence of learned views shown as new, and of learned objects shown as unknown; rising. They are the
  /// curve of both rates: `rates_at`. Of occluded ones, what they have beyond `required_occluded` is added to
  /// `required`.
  std::vector<double> known;
  std::vector<double> unknown;
  Tuning tuning;

  /// The smallest rate of false rejections that the number of views can support, 1/(n + 1).
  [[nodiscard]] double smallest_rate() const { return 1.0 / (static_cast<double>(known.size()) + 1.0); }
  /// The distance at which a whole region alone has this evidence for an object of that typical distance, and
  /// of that typical distance of colours, with colours so far from it; infinite where evidence does not fall
  /// with distance.
  /// @param typical_color nothing where views have no colours.
  [[nodiscard]] double distance_of(double evidence, double typical,
                                   std::optional<double> typical_color = std::nullopt) const;
  /// The threshold holds the rate of false acceptances alone, and more known views are expected below it than
  /// were set, and than the number of views explains.
  [[nodiscard]] bool gives_up_false_rejection() const;
};

/// Both rates with `required` as the threshold, by the evidence in the model.
DecisionRates rates_at(const DecisionModel& decision, double required);

}  // namespace eigenpose
