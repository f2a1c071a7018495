#pragma once

/// Learned views shown to the model as if they were new: of their own object, and of an unknown one.
///
/// **Known.** A view is perturbed at random, aligned and compared with its own object. What a new view would
/// show, which is half a step from a learned one, lies between what is seen with the view among the learned
/// ones and without it. Distance: squared, d² + e/g, where d is the distance to the manifold through all
/// views, e what the manifold of every second view misses more, and g the growth of e when the step doubles
/// (thinned_manifolds.h). Votes, and distances of colours: v + c·(v₁ − v), where v₁ leaves the view out, and
/// c = ½ᵖ is the share of a whole step that half a step makes, by the power law through none, one and two
/// steps (yardsticks.h).
///
/// **Unknown.** The same view, with its object taken out of everything it is compared with.
///
/// Of many views, an even sample is shown to the windows: a few hundred probes settle the rates.

#include <cstddef>
#include <span>
#include <stop_token>
#include <vector>

#include "core/base/progress.h"
#include "core/learning/calibration/calibration_record.h"
#include "core/learning/calibration/yardsticks.h"
#include "core/learning/training_views.h"
#include "core/model/model.h"

namespace eigenpose {

struct ProbeOptions {
  std::size_t shown = 400;    ///< views shown to the windows, of all objects together
  std::size_t hidden = 250;   ///< of these, views shown with a part hidden
  double hidden_share = 0.2;  ///< of the picture
  unsigned threads = 0;
  /// What was shown before: see show_views. Empty: nothing.
  const CalibrationRecord* kept = nullptr;
};

/// Shows the views: every one as known, and as unknown where there is another object. Of objects that have a
/// record, the views that were shown before are shown again in the same way, or, where their probes were
/// kept, these are brought up to date with the yardsticks.
/// @param model with yardsticks; the weights of its decision choose the object that an unknown view is taken
/// for. @throws Interrupted.
std::vector<ShownProbes> show_views(const Model& model, const TrainingViews& views,
                                    const Yardsticks& yardsticks, const ProbeOptions& options,
                                    const Progress& progress, const std::stop_token& stop);

/// The probes of all views, one after the other.
std::vector<Probe> probes_of(std::span<const ShownProbes> shown);

}  // namespace eigenpose
