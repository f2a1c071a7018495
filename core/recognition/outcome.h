#pragma once

/// The result of recognition for one region of a picture.

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core.hpp>

#include "core/model/decision_model.h"

namespace eigenpose {

/// Recognised, or why not. Everything but `recognized` is an ordinary result, not an error.
enum class Verdict {
  recognized,
  unknown,         ///< too little evidence for any learned object
  ambiguous,       ///< two objects fit about as well
  touches_border,  ///< part of it may lie outside the picture
  too_small,       ///< fewer pixels than the model needs
};

/// "recognized", "unknown", "ambiguous", "touches_border", "too_small": stable names used in JSON.
std::string_view verdict_name(Verdict verdict);

/// Log-odds against an unknown object.
struct Evidence {
  double best = 0.0;                                         ///< for the best object
  double second = -std::numeric_limits<double>::infinity();  ///< for the next, if there is any
  double required = 0.0;                                     ///< with less the region is unknown
};

/// The decision.
Verdict verdict_of(const Evidence& evidence, const Tuning& tuning);

/// One object and pose that fits a region.
struct Hypothesis {
  std::string object;
  std::vector<double> q;  ///< pose: m values in the units of the object's workspace, canonical
  /// Euclidean in the eigenspace, between unit-energy appearances, 0…2; smaller is nearer. With a model that
  /// knows windows (the default), after alignment.
  double distance = 0.0;
};

/// The answer for one region.
struct Outcome {
  Verdict verdict = Verdict::unknown;
  cv::Rect box;  ///< in the frame, pixels
  /// The best fit. Present also when the verdict is `unknown` or `ambiguous`, then as information only.
  std::optional<Hypothesis> best;
  /// The best fit among the *other* objects, when one lies within reach of the search.
  std::optional<Hypothesis> runner_up;
  /// The same object in another pose that fits about as well (symmetric or nearly symmetric objects).
  std::optional<Hypothesis> other_pose;
  /// 1-sigma uncertainty of each value of `best->q`, in its unit; infinite where the DOF is not observable.
  std::vector<double> q_sigma;
  /// Of `best->q`, m × m, row by row; its diagonal is q_sigma².
  std::vector<double> q_covariance;
  /// Log-odds (natural logarithm) that the region shows the best object rather than an unknown one.
  double evidence = 0.0;
  /// The region is unknown with less evidence than this: it holds the two rates that were set.
  double required_evidence = 0.0;
  /// Share of the region that does not show the best object: something occludes it, or stands beside it. A
  /// partly occluded object is recognised by its windows, whatever its distance.
  double covered_share = 0.0;
  /// The posterior that the best object is right, 0…1, where learned and unknown objects are equally
  /// frequent: see decision.h.
  double confidence = 0.0;
  /// The search for touching objects in this region was ended by a limit: it may show more objects, or
  /// others.
  bool unfinished = false;

  /// Sets verdict, evidence, required_evidence and confidence.
  void decide(const Evidence& by, const Tuning& tuning);
  /// Sets q_covariance to the m × m values of `covariance` times `scale`, and q_sigma. A DOF that is not
  /// `observable` gets an infinite variance and no covariance with others.
  void set_covariance(std::span<const double> covariance, double scale, const std::vector<bool>& observable);
};

/// Hypotheses taken out of outcomes, with their memory, for the next frame's.
class HypothesisPool {
 public:
  void fill(std::optional<Hypothesis>& hypothesis, const std::string& object, std::span<const double> q,
            double distance);
  void give_back(std::optional<Hypothesis>& hypothesis);
  /// Makes `outcome` that of a region of which nothing is known.
  void clear(Outcome& outcome);

 private:
  std::vector<Hypothesis> spare_;
};

/// q_covariance, one list a row.
std::vector<std::vector<double>> covariance_rows(const Outcome& outcome);

}  // namespace eigenpose
