#pragma once

/// Casts rays at the objects of one scene and says what light comes back. Used by the renderer.

#include <array>
#include <memory>
#include <vector>

#include "sim/lab/scene_state.h"
#include "sim/scene/model.h"

namespace eigenpose::sim {

/// The lamp as it shines at the moment.
struct Light {
  Vec3 position;
  float level = 1.0F;

  friend bool operator==(const Light&, const Light&) = default;
};
Light light_of(const SceneState& scene);

/// A pinhole that looks at the table.
class Pinhole {
 public:
  Pinhole(int width, int height);
  [[nodiscard]] Vec3 position() const { return position_; }
  /// Unit direction through a point of the picture, in pixels; (0, 0) is the outer corner of the first pixel.
  [[nodiscard]] Vec3 direction(float x, float y) const;
  /// Where a point is seen, in pixels.
  void project(Vec3 point, float& x, float& y) const;
  /// How many pixels a millimetre at this point takes.
  [[nodiscard]] float pixels_per_mm(Vec3 point) const;

 private:
  Vec3 position_;
  Vec3 forward_;
  Vec3 right_;
  Vec3 up_;
  float focal_;  ///< pixels
  float cx_;
  float cy_;
};

/// A model at its place.
struct Body {
  Body(std::shared_ptr<const Model> what, float angle, Vec3 where);

  std::shared_ptr<const Model> model;
  float cosine;
  float sine;
  Vec3 offset;
  Vec3 middle;  ///< of the sphere around it, in the world

  [[nodiscard]] Vec3 to_local(Vec3 point) const { return direction_to_local(point - offset); }
  [[nodiscard]] Vec3 direction_to_local(Vec3 d) const {
    return {cosine * d.x + sine * d.y, -sine * d.x + cosine * d.y, d.z};
  }
  [[nodiscard]] Vec3 direction_to_world(Vec3 d) const {
    return {cosine * d.x - sine * d.y, sine * d.x + cosine * d.y, d.z};
  }
};
/// The bodies of a scene, the hand last. Objects without a model are left out.
std::vector<Body> bodies_of(const SceneState& scene);

/// What one ray found.
struct Sample {
  Vec3 colour;
  int what = -1;  ///< body and part as one number; −1: no body, then there is no colour either
};

/// A point of the table, its side, or the backdrop.
struct StagePoint {
  Vec3 point;
  Vec3 normal;
  Vec3 albedo;
};
/// What a ray from the camera meets when nothing stands in its way.
StagePoint stage_point(Vec3 camera, Vec3 direction);

/// Immutable while it lives; any thread may sample.
class Tracer {
 public:
  Tracer(const Pinhole& camera, Light light, std::vector<Body> bodies, int bounce_rays);

  /// Four rays from the camera at once; near ones are cheaper.
  [[nodiscard]] std::array<Sample, 4> sample(const std::array<Vec3, 4>& directions) const;
  /// How much of the lamp a point of the stage sees past the bodies, 0…1.
  [[nodiscard]] float lit(const StagePoint& place) const;
  /// What the room alone, and the lamp alone if nothing shadows it, make a point of the stage look like.
  [[nodiscard]] Vec3 stage_in_room(const StagePoint& place) const;
  [[nodiscard]] Vec3 stage_in_lamp(const StagePoint& place) const;
  [[nodiscard]] const std::vector<Body>& bodies() const { return bodies_; }

 private:
  struct Hit;
  struct Rays;
  struct Surface;
  void intersect(const Rays& rays, std::array<Hit, 4>& hits) const;
  [[nodiscard]] Surface surface_at(const Hit& hit, Vec3 origin, Vec3 direction) const;
  [[nodiscard]] Vec3 shaded(const Surface& surface, float lamp_share, bool with_bounce) const;
  [[nodiscard]] std::array<Sample, 4> shaded_hits(const Rays& rays, const std::array<Hit, 4>& hits,
                                                  bool with_bounce) const;
  [[nodiscard]] Vec3 bounced(Vec3 point, Vec3 normal) const;
  [[nodiscard]] Vec3 lamp_irradiance(Vec3 point) const;
  /// Is the way from each point to its own point of the lamp barred? Looked at where wanted.
  [[nodiscard]] std::array<bool, 4> blocked(const std::array<Vec3, 4>& from,
                                            std::array<bool, 4> wanted) const;
  /// The share of the lamp that a point sees.
  [[nodiscard]] float lamp_visible(Vec3 point) const;

  const Pinhole& camera_;
  Light light_;
  std::vector<Body> bodies_;
  int bounce_rays_;
  Vec3 lamp_axis_;
  std::array<Vec3, 4> lamp_points_;
};

}  // namespace eigenpose::sim
