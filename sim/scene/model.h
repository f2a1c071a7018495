#pragma once

/// A shape ready for ray casting: mesh, ray structure, bounds. Made once a process for each shape and shared.

#include <memory>
#include <string>
#include <vector>

#include "sim/scene/mesh.h"

struct RTCDeviceTy;
struct RTCSceneTy;

namespace eigenpose::sim {

/// The ray structure of one shape, in its own frame. Immutable; any thread may trace.
class Model {
 public:
  explicit Model(const Shape& shape);
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;
  ~Model();

  [[nodiscard]] const Shape& shape() const { return shape_; }
  [[nodiscard]] const Mesh& mesh() const { return mesh_; }
  [[nodiscard]] RTCSceneTy* scene() const { return scene_; }
  /// Vertices on the outside, enough to say where the whole is seen from anywhere, to a fraction of a
  /// millimetre.
  [[nodiscard]] const std::vector<Vec3>& outline() const { return outline_; }
  /// A sphere around everything.
  [[nodiscard]] Vec3 center() const { return center_; }
  [[nodiscard]] float radius() const { return radius_; }

 private:
  void measure_openness();
  void find_outline();

  Shape shape_;
  Mesh mesh_;
  RTCDeviceTy* device_ = nullptr;
  RTCSceneTy* scene_ = nullptr;
  std::vector<Vec3> outline_;
  Vec3 center_;
  float radius_ = 0.0F;
};

/// The model of a catalogue object, or null if there is none of that name. Built at the first call.
/// Thread-safe.
std::shared_ptr<const Model> model_of(const std::string& object);
/// The model of the hand. Thread-safe.
std::shared_ptr<const Model> hand_model();

}  // namespace eigenpose::sim
