#pragma once

/// Where a simulated lab can be reached: what the service's status says of it.

#include <filesystem>

namespace eigenpose {

struct SimulationInfo {
  std::filesystem::path lab_socket;  ///< places objects, reports the truth
  int modbus_port = 0;               ///< of its drives, on 127.0.0.1
};

}  // namespace eigenpose
