#pragma once

/// What a stage's gears and encoder make of the controller's counts.

#include <string>
#include <string_view>
#include <vector>

namespace eigenpose {

/// Figures from the tables of "Thorlabs Motion Controllers Host-Controller Communications Protocol", section
/// "Conversion between position, velocity and acceleration values in standard physical units and APT units".
struct AptStage {
  std::string name;      ///< "PRM1-Z8"
  std::string unit;      ///< "deg" or "mm"
  bool stepper = false;  ///< answers the stepper's status request instead of the DC servo's
  double counts_per_unit = 0.0;
  double velocity_per_unit = 0.0;      ///< controller's number for 1 unit/s
  double acceleration_per_unit = 0.0;  ///< controller's number for 1 unit/s²
  double speed = 0.0;         ///< unit/s, what the stage is driven with unless the rig says otherwise
  double acceleration = 0.0;  ///< unit/s²
};

/// Every stage that is known.
const std::vector<AptStage>& apt_stages();

/// @throws std::invalid_argument naming the known ones.
const AptStage& apt_stage(std::string_view name);

}  // namespace eigenpose
