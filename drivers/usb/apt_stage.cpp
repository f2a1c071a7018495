#include "drivers/usb/apt_stage.h"

#include <stdexcept>

namespace eigenpose {

const std::vector<AptStage>& apt_stages() {
  static const std::vector<AptStage> stages = {
      // DC servo stages on KDC101 or TDC001: the controller's velocity and acceleration numbers carry its
      // sampling
      // interval T = 2048 / 6 MHz: velocity = counts · T · 65536, acceleration = counts · T² · 65536.
      {"PRM1-Z8", "deg", false, 1919.6418578623391, 42941.66, 14.66, 10.0, 10.0},
      {"MTS25-Z8", "mm", false, 34304.0, 767367.49, 261.93, 2.0, 2.0},
      {"MTS50-Z8", "mm", false, 34304.0, 767367.49, 261.93, 2.0, 2.0},
      {"Z825B", "mm", false, 34304.0, 767367.49, 261.93, 2.0, 2.0},
      // Stepper stages with their controller inside.
      {"K10CR1", "deg", true, 136533.33, 7329109.0, 1502.0, 10.0, 10.0},
      {"LTS150", "mm", true, 409600.0, 21987328.0, 4506.0, 10.0, 10.0},
      {"LTS300", "mm", true, 409600.0, 21987328.0, 4506.0, 10.0, 10.0},
  };
  return stages;
}

const AptStage& apt_stage(std::string_view name) {
  std::string known;
  for (const AptStage& stage : apt_stages()) {
    if (stage.name == name) return stage;
    known += (known.empty() ? "" : ", ") + stage.name;
  }
  throw std::invalid_argument("APT stage \"" + std::string(name) + "\" is not known; known: " + known);
}

}  // namespace eigenpose
