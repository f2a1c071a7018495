#pragma once

/// The decision: how much speaks for the object that a region resembles most, against an unknown one.
///
/// **Evidence** is the log-odds that a region shows object o rather than an unknown one, where both are
/// equally frequent, linear in what was measured (logistic regression; Berkson 1944):
///
///     Λ(o) = w · φ(o)
///
/// with the terms φ of one of three hypotheses, below. The distance d of a known view grows with its object's
/// own interpolation error s, that of an unknown one does not: with both logarithms normal, their likelihood
/// ratio is linear in ln d and ln s. Weights are learned from the model's own views (core/learning/
/// calibration). A region gets the name of the object that its windows or its distances choose
/// (parts_stage.h, recognizer.h), if the evidence for it is at least DecisionModel::required, or
/// required_occluded.
///
/// **Confidence** is the posterior that the best object b is right, beside the second best r and an unknown
/// object: e^Λ(b) / (e^Λ(b) + e^Λ(r) + 1).

#include <array>
#include <optional>

#include "core/model/decision_model.h"

namespace eigenpose {

/// Colours of one object compared with those of a region, or of what is visible of it.
struct ColorMatch {
  double distance = 0.0;  ///< h: Hellinger distance to the nearest learned view
  double typical = 0.0;   ///< that of new views of the object, mean
};

/// One object compared with the whole region, after alignment where the model aligns.
struct WholeMatch {
  double distance = 0.0;  ///< d: to the object's manifold in the universal eigenspace
  double typical = 0.0;   ///< s: root mean square of new views of the object
  double other = 2.0;     ///< to the nearest of the other manifolds
  std::optional<ColorMatch> color = std::nullopt;  ///< where views have colours
};

/// Votes of the windows for one object.
struct WindowsMatch {
  double votes = 0.0;           ///< share of the windows' weight for its best view, 0…1
  double typical_votes = 0.0;   ///< the same of new views of the object, mean
  double discriminating = 0.0;  ///< share beyond what many objects have in common
  std::optional<double> next;   ///< the same of the best of the other objects, if there are any
};

/// A pose of one object compared with what is visible of a region.
struct OccludedMatch {
  WindowsMatch windows;
  double occluded = 0.0;          ///< share of the windows that do not show the object, 0…1
  double merit = 0.0;             ///< of the pose, see parts_recognizer.h
  double unexplained = 0.0;       ///< share of the pixels that the pose leaves unexplained, 0…1
  double foreign_likeness = 0.0;  ///< mean likeness of the windows that do not show the object
  std::optional<ColorMatch> color = std::nullopt;  ///< of what is visible, where views have colours
};

std::array<double, 5> whole_terms(const WholeMatch& match);
std::array<double, 10> windows_terms(const WholeMatch& whole, const WindowsMatch& windows);
std::array<double, 11> occluded_terms(const OccludedMatch& match);

/// Λ of the three hypotheses.
double evidence_of(const EvidenceWeights& weights, const WholeMatch& match);
double evidence_of(const EvidenceWeights& weights, const WholeMatch& whole, const WindowsMatch& windows);
double evidence_of(const EvidenceWeights& weights, const OccludedMatch& match);

/// Log-odds of a distance over another, both of one region: the squared distances in units of their variance,
/// e·(d₂² − d₁²)/2s², with e effective dimensions and s the typical distance.
double lead_of_distance(const Tuning& tuning, double typical, double first, double second);

/// The posterior of the best object. @param second the evidence of the next; −∞ without.
double confidence_of(double best, double second);

/// Two poses are distinct when they differ by more than this share of a DOF's range.
inline constexpr double poses_apart = 1.0 / 12.0;

}  // namespace eigenpose
