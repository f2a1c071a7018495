#pragma once

/// What `eigenpose doctor` looks at, and what it says to do about what it finds.

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "config/config.h"
#include "core/base/clock.h"
#include "daemon/devices.h"
#include "daemon/hardware/inventory.h"

namespace eigenpose {

enum class Health {
  good,
  note,   ///< works, but may surprise
  fault,  ///< does not work; `remedy` says what to do
};

struct Finding {
  Health health = Health::good;
  std::string subject;  ///< "camera", "axis table", "udev rules", …
  std::string what;
  std::string remedy;  ///< empty when good
};

using Report = std::function<void(const Finding&)>;

/// Who asks, and where. The defaults are this machine and this user.
struct Machine {
  std::filesystem::path root = "/";
  std::string user;                 ///< empty: the present one
  std::vector<std::string> groups;  ///< empty: the present ones
  bool is_root = false;             ///< only looked at when `user` is given
};

/// Folders, groups, udev rules, the service's user, ports and nodes that the configuration names. Opens no
/// device.
void check_machine(const Machine& machine, const Config& config, const Inventory& inventory,
                   const Report& report);

/// The same of all that is plugged in, where there is no configuration to say what is needed.
void check_found(const Machine& machine, const Inventory& inventory, const Report& report);

/// Opens every configured device, one after the other, and reads what it reports: the camera takes
/// pictures, each drive reports its state, each lamp is set dark. Moves nothing. Stops between two
/// devices on request (throws Interrupted).
void check_devices(const Devices& devices, const Clock& clock, const std::stop_token& stop,
                   const Report& report);

/// Whether a service answers on the results socket.
bool is_service_running(const Config& config);

}  // namespace eigenpose
