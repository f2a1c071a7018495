#pragma once

/// From the configuration's names to devices. devices.cpp holds the one table that names real and simulated
/// devices side by side; nothing else in the daemon knows which is which.

#include <memory>
#include <optional>
#include <vector>

#include "config/config.h"
#include "core/base/clock.h"
#include "daemon/api/simulation_info.h"
#include "daemon/rig/frame_hub.h"
#include "daemon/rig/rig.h"

namespace eigenpose {

/// Everything the configuration names, not opened yet.
struct Devices {
  std::shared_ptr<void> lab;  ///< keeps the simulated lab; outlives what `camera`, `axes` and `lamps` open
  std::optional<SimulationInfo> simulation;
  FrameHub::OpenCamera camera;  ///< empty: none is configured
  std::vector<RigAxis> axes;
  std::vector<RigLamp> lamps;
};

/// Starts the simulated lab if there is a [sim] section; opens no device. The clock must outlive everything
/// returned.
/// @throws ConfigError for a driver this program was built without, FileError for a profile or a lab socket.
Devices make_devices(const Config& config, const Clock& clock);

}  // namespace eigenpose
