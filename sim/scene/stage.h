#pragma once

/// Where the fixed things of the lab stand: table, camera, light arm, hand. Millimetres, world frame.

#include "sim/scene/vec3.h"

namespace eigenpose::sim::stage {

inline constexpr double table_radius_mm = 125.0;
inline constexpr float table_height_mm = 14.0F;  ///< of its surface above the backdrop

/// A long lens from far: an object a little off the axis is still seen from nearly the same side.
inline constexpr float camera_distance_mm = 2400.0F;
inline constexpr float camera_elevation_deg = 32.0F;
inline constexpr Vec3 camera_target{0.0F, 0.0F, 22.0F};
inline constexpr float field_width_mm = 300.0F;  ///< across the picture at the target

inline constexpr float lamp_distance_mm = 520.0F;
inline constexpr float lamp_radius_mm = 22.0F;
/// Azimuth 0 of the arm, as an angle from the world's x axis: in front to the left.
inline constexpr float lamp_zero_deg = 225.0F;
inline constexpr Vec3 lamp_aim{0.0F, 0.0F, 25.0F};

/// How far from its place at the table's centre the hand (and what it carries) is. @param reach 0 … 1.
constexpr Vec3 hand_offset(float reach) {
  const float back = 1.0F - reach;
  return {330.0F * back, -120.0F * back, 90.0F * back};
}

/// Where the middle of the fingers is when the hand reaches to the centre, and how the arm lies (from the
/// world's x).
inline constexpr Vec3 hand_rest{16.0F, -6.0F, 62.0F};
inline constexpr float hand_angle_deg = -22.0F;

}  // namespace eigenpose::sim::stage
