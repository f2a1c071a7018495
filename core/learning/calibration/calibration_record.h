#pragma once

/// What calibration measured at each view, kept so that a model that objects join or leave is calibrated
/// without measuring all of it again.
///
/// Two kinds of measurements depend on other objects in so far as these change what the windows have in
/// common, and the eigenspaces: how a view is misaligned and what its own object's windows vote (little), and
/// what the view was taken for (where an object that joins or left is like it). The first are kept as they
/// are. Of the second, views near an object that joined, or that were compared with one that left, are shown
/// again (probes.h). After many changes nothing is kept: `carry_over`.

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/alignment/misalignment.h"
#include "core/learning/training_views.h"
#include "core/model/model.h"
#include "core/recognition/decision.h"

namespace eigenpose {

/// One object compared with a region by windows.
struct WindowsProbe {
  std::size_t taken_for = 0;
  WholeMatch whole;
  WindowsMatch windows;
};

/// One object compared with what is visible of a region.
struct OccludedProbe {
  std::size_t taken_for = 0;
  OccludedMatch match;
};

/// One view, shown once.
struct Probe {
  std::size_t object = 0;     ///< whose view it is
  std::size_t taken_for = 0;  ///< the object whose manifold is nearest: `object` where known
  bool known = false;
  bool hidden = false;    ///< a part of it was hidden: only `occluded` counts
  WholeMatch whole = {};  ///< with `taken_for`
  std::optional<WindowsProbe> windows =
      {};  ///< with the most likely object; where it was shown to the windows
  std::optional<OccludedProbe> occluded = {};  ///< likewise, where it may be occluded (identify_if_occluded)
};

/// All that a view was shown as.
struct ShownProbes {
  std::size_t object = 0;
  std::size_t view = 0;  ///< of the object
  bool windows = false;  ///< it was shown to the windows
  bool hidden = false;   ///< it was shown with a part hidden
  std::vector<Probe> probes;
  std::vector<std::size_t> rivals;  ///< the other objects that it was compared with
};

/// Votes for one object of its own views, with learned views at least 0, 1 and 2 steps away.
struct VotesOfViews {
  std::vector<std::array<double, 3>> votes;
  /// Distances of the colours, of views displaced a little: to all learned views, and to the others. Empty
  /// where views are grey.
  std::vector<std::array<double, 2>> colors;
  double foreign = 0.0;  ///< largest share of foreign windows, one step away, halved
};

/// What was measured of one object's views with the object alone.
struct ObjectRecord {
  std::vector<Misalignment> misalignments;  ///< of each view, perturbed; empty where they are not known
  VotesOfViews votes;                       ///< empty likewise
};

struct CalibrationRecord {
  std::vector<ObjectRecord> objects;  ///< in the order of the model's; empty where nothing was kept
  std::vector<ShownProbes> shown;     ///< ordered by object and view
  std::size_t measured_among = 0;     ///< objects when all views were shown last
  std::size_t changes = 0;            ///< objects that joined or left since
};

/// What of a record is good for a model of other objects. Nothing (no objects, nothing shown) where too many
/// of the objects have changed since all views were shown: more than a quarter of those there were.
/// @param places for each object of the record its place among those of the new model; nothing: it left.
/// @param objects of the new model; those without a place joined. They get empty records. What was compared
/// with an object that left keeps no probes: it is to be shown again.
CalibrationRecord carry_over(const CalibrationRecord& kept,
                             std::span<const std::optional<std::size_t>> places, std::size_t objects);

/// Drops the probes of views to which an object that joined is the nearest of the others: they are to be
/// shown again. @param points K × M: projections of the views.
void drop_within_reach(CalibrationRecord& record, const Model& model, const TrainingViews& views,
                       const Eigen::MatrixXd& points);

}  // namespace eigenpose
