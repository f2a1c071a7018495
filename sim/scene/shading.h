#pragma once

/// Light arriving at a surface and leaving it towards the camera.

#include "sim/scene/shape.h"

namespace eigenpose::sim {

/// What the dim room sends from a direction: a dark room with a large soft window, seen in glossy surfaces.
Vec3 room_radiance(Vec3 direction, float roughness);

/// Diffuse light of the room arriving on a surface of this normal, without its own shadowing.
Vec3 room_irradiance(Vec3 normal);

/// Light of one lamp reflected to the viewer: Lambert plus a Trowbridge–Reitz (GGX) lobe with Schlick's
/// Fresnel term and Smith–Schlick masking. @param to_light, to_viewer unit vectors. @param irradiance of a
/// surface facing the lamp, over π.
Vec3 reflected(const Paint& paint, Vec3 normal, Vec3 to_light, Vec3 to_viewer, Vec3 irradiance);

/// Light of the room reflected to the viewer. @param openness 0…1.
Vec3 reflected_room(const Paint& paint, Vec3 normal, Vec3 to_viewer, float openness);

}  // namespace eigenpose::sim
