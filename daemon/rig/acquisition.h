#pragma once

/// Acquiring a learning set: the rig visits every pose of a plan, the camera looks, the view goes to disk.

#include <cstddef>
#include <filesystem>
#include <stop_token>
#include <string>

#include "core/base/clock.h"
#include "core/base/progress.h"
#include "core/base/workspace.h"
#include "daemon/rig/frame_hub.h"
#include "daemon/rig/plan.h"
#include "daemon/rig/rig.h"

namespace eigenpose {

struct AcquisitionRequest {
  std::string object;
  Plan plan;                                          ///< checked against the rig's axes
  Workspace workspace;                                ///< of the plan
  std::filesystem::path image_sets;                   ///< the new set is a folder in here
  Duration frame_timeout = std::chrono::seconds(10);  ///< to wait for a frame exposed after arrival
};

/// How far it came. Filled as it goes, so that it is true also when the acquisition fails.
struct AcquisitionReport {
  std::filesystem::path folder;
  std::size_t kept = 0;   ///< views that stood there from an earlier, interrupted run
  std::size_t taken = 0;  ///< views taken now
  std::size_t total = 0;  ///< views of the plan
};

/// Visits the grid of the plan and takes one raw picture a pose, after every moved axis has arrived and
/// settled, from a frame exposed after that. Each view is on disk before the next move; views an earlier run
/// has taken are not taken again. At the end the axes return to the plan's first pose.
/// @throws FileError (a complete set of that name, a full disk) before or between moves, DeviceError and its
/// kinds, Interrupted. Whatever ends it: no motion is left running, and what was taken is kept.
void acquire(const AcquisitionRequest& request, Rig& rig, FrameHub& camera, const Clock& clock,
             AcquisitionReport& report, const Progress& progress, std::stop_token stop);

}  // namespace eigenpose
