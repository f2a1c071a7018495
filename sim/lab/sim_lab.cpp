#include "sim/lab/sim_lab.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "sim/scene/catalog.h"
#include "sim/scene/stage.h"

namespace eigenpose::sim {
namespace {

using std::chrono::milliseconds;

/// Reaches per second: a hand takes most of a second to the table's centre.
constexpr MotionLimits hand_limits{1.6, 8.0, 8.0};
/// How long a hand stays to let go or to take hold.
constexpr Duration grasp_time = milliseconds(300);

Angle full_turn(double degrees_value) {
  return degrees(wrap(degrees_value, 0.0, 360.0));
}

std::size_t index_of(LabAxis axis) {
  return static_cast<std::size_t>(axis);
}

}  // namespace

SimLab::SimLab(const Clock& clock, SimLabOptions options) : clock_(clock), options_(options) {
  const TimePoint begin{};  // a trajectory stands still before its start
  axes_[index_of(LabAxis::table)] = {Trajectory::standstill(options.table_deg, begin)};
  axes_[index_of(LabAxis::arm_azimuth)] = {Trajectory::standstill(options.arm_azimuth_deg, begin)};
  axes_[index_of(LabAxis::arm_elevation)] = {Trajectory::standstill(options.arm_elevation_deg, begin)};
  hand_ = {Trajectory::standstill(0.0, begin)};
  for (const ObjectDescription& object : built_objects()) {
    catalog_.push_back({object.name, object.symmetric, object.held_out, false});
  }
}

std::vector<CatalogEntry> SimLab::objects() const {
  const std::lock_guard lock(mutex_);
  return catalog_;
}

void SimLab::add_recorded_object(const std::string& name) {
  const std::lock_guard lock(mutex_);
  if (!find_entry(name)) catalog_.push_back({name, false, false, true});
}

std::optional<CatalogEntry> SimLab::find_entry(const std::string& name) const {
  const auto found =
      std::find_if(catalog_.begin(), catalog_.end(), [&](const CatalogEntry& e) { return e.name == name; });
  if (found == catalog_.end()) return std::nullopt;
  return *found;
}

void SimLab::check_placement(const std::string& object, double x_mm, double y_mm) const {
  if (!find_entry(object)) {
    std::string known;
    for (const CatalogEntry& entry : catalog_) known += (known.empty() ? "" : ", ") + entry.name;
    throw std::invalid_argument("the simulated lab has no object \"" + object + "\"; it has: " + known);
  }
  if (!std::isfinite(x_mm) || !std::isfinite(y_mm) || std::hypot(x_mm, y_mm) > stage::table_radius_mm) {
    throw std::invalid_argument(
        "an object at x = " + std::to_string(x_mm) + " mm, y = " + std::to_string(y_mm) +
        " mm stands off the table, whose radius is " + std::to_string(stage::table_radius_mm) + " mm");
  }
}

std::uint64_t SimLab::place(const std::string& object, Angle yaw, double x_mm, double y_mm) {
  const std::lock_guard lock(mutex_);
  check_placement(object, x_mm, y_mm);
  const TimePoint now = clock_.now();
  forget_before(now - options_.remembered);
  placements_.push_back({next_id_, object, yaw, x_mm, y_mm, now, now});
  return next_id_++;
}

std::uint64_t SimLab::place_by_hand(const std::string& object, Angle yaw, double x_mm, double y_mm) {
  const std::lock_guard lock(mutex_);
  check_placement(object, x_mm, y_mm);
  const TimePoint now = clock_.now();
  forget_before(now - options_.remembered);
  const TimePoint arrived = move_hand(1.0, now);
  placements_.push_back({next_id_, object, yaw, x_mm, y_mm, now, arrived});
  move_hand(0.0, arrived + grasp_time);
  return next_id_++;
}

SimLab::Placement& SimLab::standing(std::uint64_t id, TimePoint now) {
  const auto found = std::find_if(placements_.begin(), placements_.end(),
                                  [&](const Placement& p) { return p.id == id && p.picked_up > now; });
  if (found == placements_.end()) {
    throw std::invalid_argument("no object with id " + std::to_string(id) + " stands on the table");
  }
  return *found;
}

void SimLab::remove(std::uint64_t id) {
  const std::lock_guard lock(mutex_);
  const TimePoint now = clock_.now();
  Placement& placement = standing(id, now);
  placement.picked_up = now;
  placement.gone = now;
}

void SimLab::remove_by_hand(std::uint64_t id) {
  const std::lock_guard lock(mutex_);
  const TimePoint now = clock_.now();
  Placement& placement = standing(id, now);
  const TimePoint arrived = move_hand(1.0, now);
  placement.picked_up = arrived + grasp_time;
  placement.gone = move_hand(0.0, arrived + grasp_time);
}

void SimLab::clear() {
  const std::lock_guard lock(mutex_);
  const TimePoint now = clock_.now();
  for (Placement& placement : placements_) {
    placement.picked_up = std::min(placement.picked_up, now);
    placement.gone = std::min(placement.gone, now);
  }
}

void SimLab::hand_in() {
  const std::lock_guard lock(mutex_);
  move_hand(1.0, clock_.now());
}

void SimLab::hand_out() {
  const std::lock_guard lock(mutex_);
  move_hand(0.0, clock_.now());
}

TimePoint SimLab::move_hand(double reach, TimePoint when) {
  append(hand_, motion_at(hand_, when).move_to(reach, hand_limits, when));
  return hand_.back().end();
}

void SimLab::set_lamp_level(double level) {
  if (!(level >= 0.0 && level <= 1.0)) {
    throw std::out_of_range("lamp level " + std::to_string(level) + " is not within 0 … 1");
  }
  const std::lock_guard lock(mutex_);
  lamp_level_ = level;
}

void SimLab::set_camera_faults(const CameraFaults& faults) {
  if (!(faults.extra_noise >= 0.0) || !(faults.damaged_fraction >= 0.0 && faults.damaged_fraction <= 1.0)) {
    throw std::out_of_range("camera faults: extra noise " + std::to_string(faults.extra_noise) +
                            " must be 0 or more, damaged fraction " +
                            std::to_string(faults.damaged_fraction) + " within 0 … 1");
  }
  const std::lock_guard lock(mutex_);
  camera_faults_ = faults;
}

CameraFaults SimLab::camera_faults() const {
  const std::lock_guard lock(mutex_);
  return camera_faults_;
}

void SimLab::damage_frames(TimePoint from, TimePoint until) {
  const std::lock_guard lock(mutex_);
  damaged_from_ = from;
  damaged_until_ = until;
}

bool SimLab::frame_damaged(TimePoint exposure_start) const {
  const std::lock_guard lock(mutex_);
  return exposure_start >= damaged_from_ && exposure_start < damaged_until_;
}

const Trajectory& SimLab::motion_at(const Motion& motion, TimePoint when) {
  const Trajectory* current = &motion.front();
  for (const Trajectory& candidate : motion) {
    if (candidate.start() > when) break;
    current = &candidate;
  }
  return *current;
}

// What was planned for later than the new motion's start no longer happens.
void SimLab::append(Motion& motion, Trajectory next) const {
  const TimePoint start = next.start();
  while (!motion.empty() && motion.back().start() >= start) motion.pop_back();
  motion.push_back(std::move(next));
  const TimePoint oldest = clock_.now() - options_.remembered;
  while (motion.size() > 1 && motion[1].start() < oldest) motion.erase(motion.begin());
}

void SimLab::set_axis_motion(LabAxis axis, const Trajectory& motion) {
  const std::lock_guard lock(mutex_);
  append(axes_[index_of(axis)], motion);
}

void SimLab::set_axis_position(LabAxis axis, Angle position) {
  set_axis_motion(axis, Trajectory::standstill(position.degrees(), clock_.now()));
}

double SimLab::axis_position_deg(LabAxis axis, TimePoint when) const {
  const std::lock_guard lock(mutex_);
  return motion_at(axes_[index_of(axis)], when).position(when);
}

void SimLab::forget_before(TimePoint when) {
  std::erase_if(placements_, [&](const Placement& p) { return p.gone < when; });
}

SceneState SimLab::scene_at(TimePoint when) const {
  const std::lock_guard lock(mutex_);
  const auto position = [&](LabAxis axis) { return motion_at(axes_[index_of(axis)], when).position(when); };
  SceneState scene;
  scene.light_azimuth_deg = position(LabAxis::arm_azimuth);
  scene.light_elevation_deg = position(LabAxis::arm_elevation);
  scene.lamp_level = lamp_level_;
  const double reach = motion_at(hand_, when).position(when);
  if (reach > 0.0) scene.hand = reach;

  const double table_deg = wrap(position(LabAxis::table), 0.0, 360.0);
  const double c = std::cos(degrees(table_deg).radians());
  const double s = std::sin(degrees(table_deg).radians());
  for (const Placement& p : placements_) {
    if (when < p.since || when >= p.gone) continue;
    PosedObject object{p.name, wrap(p.yaw.degrees() + table_deg, 0.0, 360.0), c * p.x_mm - s * p.y_mm,
                       s * p.x_mm + c * p.y_mm, 0.0};
    if (when < p.set_down || when >= p.picked_up) {
      const Vec3 carried = stage::hand_offset(static_cast<float>(reach));
      object.x_mm += carried.x;
      object.y_mm += carried.y;
      object.z_mm += carried.z;
    }
    scene.objects.push_back(std::move(object));
  }
  return scene;
}

Truth SimLab::truth_at(TimePoint when) const {
  const std::lock_guard lock(mutex_);
  Truth truth;
  truth.time = when;
  const auto position = [&](LabAxis axis) {
    const Trajectory& motion = motion_at(axes_[index_of(axis)], when);
    truth.moving = truth.moving || motion.moving(when);
    return motion.position(when);
  };
  truth.table = full_turn(position(LabAxis::table));
  truth.arm_azimuth = degrees(position(LabAxis::arm_azimuth));
  truth.arm_elevation = degrees(position(LabAxis::arm_elevation));
  truth.lamp_level = lamp_level_;
  const Trajectory& hand = motion_at(hand_, when);
  truth.moving = truth.moving || hand.moving(when);
  truth.hand_in_view = hand.position(when) > 0.0;
  for (const Placement& p : placements_) {
    if (when < p.since || when >= p.gone) continue;
    const CatalogEntry entry = find_entry(p.name).value_or(CatalogEntry{});
    truth.objects.push_back({p.id, p.name, full_turn(p.yaw.degrees() + truth.table.degrees()),
                             full_turn(p.yaw.degrees()), p.x_mm, p.y_mm, entry.symmetric, entry.held_out,
                             when < p.set_down || when >= p.picked_up});
  }
  return truth;
}

}  // namespace eigenpose::sim
