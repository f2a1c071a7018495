#pragma once

/// Everything a camera could see of the lab at one moment. The renderer turns it into a picture.
///
/// World frame: millimetres, origin on the table's surface at its axis; x to the right in the picture, y away
/// from the camera, z up. Angles are counter-clockwise seen from above.

#include <optional>
#include <string>
#include <vector>

namespace eigenpose::sim {

/// One object as it stands at that moment.
struct PosedObject {
  std::string name;
  double angle_deg = 0.0;  ///< about its own vertical axis, in the world
  double x_mm = 0.0;
  double y_mm = 0.0;
  double z_mm = 0.0;  ///< above the table; not 0 only while a hand carries it

  friend bool operator==(const PosedObject&, const PosedObject&) = default;
};

struct SceneState {
  std::vector<PosedObject> objects;
  /// Where the lamp stands. Azimuth 0 is in front of the table to the left, 45° from the camera; +45° is
  /// above the camera. Elevation is measured from the table plane.
  double light_azimuth_deg = 0.0;
  double light_elevation_deg = 50.0;
  double lamp_level = 1.0;     ///< 0 dark … 1 full
  std::optional<double> hand;  ///< how far it reaches in: 0 outside the picture … 1 at the table's centre

  friend bool operator==(const SceneState&, const SceneState&) = default;
};

}  // namespace eigenpose::sim
