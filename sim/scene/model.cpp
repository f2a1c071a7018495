#include "sim/scene/model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <numbers>
#include <stdexcept>

#include <embree3/rtcore.h>

#include "sim/scene/catalog.h"

namespace eigenpose::sim {
namespace {

constexpr int openness_rays = 24;
constexpr float openness_reach_mm = 90.0F;

/// Directions around +z with a density like the cosine, evenly spread.
std::array<Vec3, openness_rays> cosine_directions() {
  std::array<Vec3, openness_rays> result{};
  for (int i = 0; i < openness_rays; ++i) {
    const float u = (static_cast<float>(i) + 0.5F) / openness_rays;
    const float angle = static_cast<float>(i) * 2.399963F;  // golden angle
    const float r = std::sqrt(u);
    result[static_cast<std::size_t>(i)] = {r * std::cos(angle), r * std::sin(angle), std::sqrt(1.0F - u)};
  }
  return result;
}

template <class T>
void share(RTCGeometry geometry, RTCBufferType type, RTCFormat format, const std::vector<T>& data,
           std::size_t item, std::size_t count) {
  void* buffer = rtcSetNewGeometryBuffer(geometry, type, 0, format, item, count);
  if (buffer == nullptr) throw std::runtime_error("Embree has no memory for a mesh");
  std::memcpy(buffer, data.data(), item * count);
}

struct ModelCache {
  std::mutex mutex;
  std::map<std::string, std::shared_ptr<const Model>> models;  ///< guarded by mutex
};

ModelCache& cache() {
  static ModelCache instance;
  return instance;
}

std::shared_ptr<const Model> cached(const std::string& name, const Shape& shape) {
  ModelCache& all = cache();
  const std::lock_guard lock(all.mutex);
  auto& model = all.models[name];
  if (!model) model = std::make_shared<const Model>(shape);
  return model;
}

}  // namespace

Model::Model(const Shape& shape) : shape_(shape), mesh_(mesh_of(shape)) {
  if (mesh_.triangles.empty())
    throw std::logic_error("a shape of the simulated lab has no surface in its box");
  device_ = rtcNewDevice("threads=1,set_affinity=0");
  if (device_ == nullptr) throw std::runtime_error("Embree cannot start: no usable device on this processor");
  scene_ = rtcNewScene(device_);
  rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  share(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh_.positions, sizeof(Vec3),
        mesh_.positions.size());
  share(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh_.triangles, 3 * sizeof(std::uint32_t),
        mesh_.triangle_count());
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_);

  Vec3 lower = mesh_.positions.front();
  Vec3 upper = lower;
  for (const Vec3 p : mesh_.positions) {
    lower = {std::min(lower.x, p.x), std::min(lower.y, p.y), std::min(lower.z, p.z)};
    upper = {std::max(upper.x, p.x), std::max(upper.y, p.y), std::max(upper.z, p.z)};
  }
  center_ = 0.5F * (lower + upper);
  for (const Vec3 p : mesh_.positions) radius_ = std::max(radius_, length(p - center_));
  find_outline();
  measure_openness();
}

Model::~Model() {
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  if (device_ != nullptr) rtcReleaseDevice(device_);
}

// The vertices that go farthest in directions spread evenly over the sphere.
void Model::find_outline() {
  constexpr int directions = 160;
  for (int i = 0; i < directions; ++i) {
    const float z = 1.0F - (2.0F * static_cast<float>(i) + 1.0F) / directions;
    const float r = std::sqrt(1.0F - z * z);
    const float angle = static_cast<float>(i) * 2.399963F;  // golden angle
    const Vec3 direction{r * std::cos(angle), r * std::sin(angle), z};
    const auto farthest =
        std::max_element(mesh_.positions.begin(), mesh_.positions.end(),
                         [&](Vec3 a, Vec3 b) { return dot(a, direction) < dot(b, direction); });
    if (std::find(outline_.begin(), outline_.end(), *farthest) == outline_.end())
      outline_.push_back(*farthest);
  }
}

// The table below is an occluder too: the part of the hemisphere that looks down counts as closed.
void Model::measure_openness() {
  static const std::array<Vec3, openness_rays> directions = cosine_directions();
  std::vector<float> raw(mesh_.positions.size());
  alignas(16) const std::array<int, 4> valid{-1, -1, -1, -1};
  for (std::size_t v = 0; v < raw.size(); ++v) {
    const Vec3 n = mesh_.normals[v];
    const Vec3 t = normalized(cross(std::abs(n.z) < 0.9F ? Vec3{0, 0, 1} : Vec3{1, 0, 0}, n));
    const Vec3 b = cross(n, t);
    const Vec3 origin = mesh_.positions[v] + 0.4F * n;
    int open = 0;
    for (std::size_t i = 0; i < directions.size(); i += 4) {
      alignas(16) RTCRay4 rays{};
      for (std::size_t k = 0; k < 4; ++k) {
        const Vec3 local = directions[i + k];
        const Vec3 d = local.x * t + local.y * b + local.z * n;
        rays.org_x[k] = origin.x;
        rays.org_y[k] = origin.y;
        rays.org_z[k] = origin.z;
        rays.dir_x[k] = d.x;
        rays.dir_y[k] = d.y;
        rays.dir_z[k] = d.z;
        rays.tfar[k] = d.z < 0.0F && origin.z + openness_reach_mm * d.z < 0.0F ? -1.0F : openness_reach_mm;
        rays.mask[k] = 0xFFFFFFFFU;
      }
      std::array<bool, 4> down{};
      for (std::size_t k = 0; k < 4; ++k) down[k] = rays.tfar[k] < 0.0F;
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      rtcOccluded4(valid.data(), scene_, &context, &rays);
      for (std::size_t k = 0; k < 4; ++k) open += !down[k] && rays.tfar[k] >= 0.0F ? 1 : 0;
    }
    raw[v] = static_cast<float>(open) / openness_rays;
  }
  // The few rays leave grain; neighbours even it out.
  std::vector<float> sum = raw;
  std::vector<float> count(raw.size(), 1.0F);
  for (std::size_t i = 0; i < mesh_.triangles.size(); i += 3) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = mesh_.triangles[i + k];
      const auto b = mesh_.triangles[i + (k + 1) % 3];
      sum[a] += raw[b];
      count[a] += 1.0F;
    }
  }
  for (std::size_t v = 0; v < raw.size(); ++v) mesh_.openness[v] = sum[v] / count[v];
}

std::shared_ptr<const Model> model_of(const std::string& object) {
  for (const ObjectDescription& description : built_objects()) {
    if (description.name == object) return cached(object, description.shape);
  }
  return nullptr;
}

std::shared_ptr<const Model> hand_model() {
  return cached(" hand", hand_shape());
}

}  // namespace eigenpose::sim
