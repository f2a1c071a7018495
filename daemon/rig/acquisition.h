#pragma once

/// Acquiring a learning set: the rig visits every pose of a plan, the camera looks, the view goes to disk.

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "core/base/clock.h"
#include "core/base/progress.h"
#include "core/base/workspace.h"
#include "core/dataset/image_set.h"
#include "daemon/rig/frame_hub.h"
#include "daemon/rig/plan.h"
#include "daemon/rig/rig.h"

namespace eigenpose {

struct AcquisitionRequest {
  std::string object;
  Plan plan;                                          ///< made for the rig's axes
  Workspace workspace;                                ///< of the plan
  std::filesystem::path image_sets;                   ///< the new set is a folder in here
  Duration frame_timeout = std::chrono::seconds(10);  ///< to wait for a frame exposed after arrival
  /// How often one view is taken again because an axis did not stay where it was put or a lamp may have been
  /// without its level. Then the run fails.
  int most_retakes = 3;
};

/// How far it came. Filled as it goes, so that it is true also when the acquisition fails.
struct AcquisitionReport {
  std::filesystem::path folder;
  std::size_t kept = 0;     ///< views that stood there from an earlier, interrupted run
  std::size_t taken = 0;    ///< views taken now
  std::size_t retaken = 0;  ///< pictures thrown away because an axis moved or a lamp was interrupted
  std::size_t total = 0;    ///< views of the plan
  /// Why axes do not stand where they stood before the run. The set is complete all the same.
  std::optional<std::string> not_returned;
};

/// What an acquisition works with. All outlive it.
struct AcquisitionDevices {
  Rig& rig;
  FrameHub& camera;
  const Clock& clock;
};

/// Visits the grid of the plan and takes one raw picture a pose: with every lamp lit, after every moved axis
/// has arrived and settled, from a frame exposed after that, and only if afterwards each axis still stands
/// there and no lamp has been connected anew or lost its level. Each view is on disk before the next move,
/// with the pose read back beside the pose of the plan. The set records where every actuator of the rig stood
/// when it was begun.
///
/// A set that an earlier run has begun is continued: views it has are not taken again. It is refused if an
/// axis or lamp that the plan does not move stands elsewhere than it stood then: its views would not be
/// alike.
///
/// At the end each axis of the plan returns to where it stood before this run (the nearest end of its range,
/// if it stood beyond), or to the plan's first pose if that is not known; a failure to return is reported and
/// does not fail the set.
/// @throws FileError (a complete set of that name, one begun with another state of the rig, a full disk)
/// before or between moves, DeviceError and its kinds, Interrupted. Whatever ends it: no motion is left
/// running, and what was taken is kept.
void acquire(const AcquisitionRequest& request, const AcquisitionDevices& devices, AcquisitionReport& report,
             const Progress& progress, const std::stop_token& stop);

/// The poses of the plan that none of `views` shows, canonical, in the plan's order. Costs O(n log n) for n
/// views.
std::vector<std::vector<double>> missing_poses(const Plan& plan, const Workspace& workspace,
                                               std::span<const ViewRecord> views);

}  // namespace eigenpose
