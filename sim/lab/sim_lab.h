#pragma once

/// The one truth of the simulated lab: what stands on the table and how everything is turned, at any time.
///
/// Simulated drives write how the axes move; simulated cameras read how the lab looks during an exposure;
/// people and tests place objects. Recognition has no access to it.

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/angle.h"
#include "core/base/clock.h"
#include "sim/lab/scene_state.h"
#include "sim/lab/trajectory.h"

namespace eigenpose::sim {

enum class LabAxis { table, arm_azimuth, arm_elevation };
inline constexpr std::size_t lab_axis_count = 3;

/// What can be placed.
struct CatalogEntry {
  std::string name;
  bool symmetric = false;  ///< looks the same at every angle: its pose can't be seen
  bool held_out = false;   ///< kept from learning, to test that it is reported as unknown
  bool recorded = false;   ///< exists as photographs only (ReplayCamera)
};

/// What is wrong with the camera now.
struct CameraFaults {
  bool stalled = false;           ///< connected, but no frame comes
  bool lost = false;              ///< gone, as if unplugged
  double extra_noise = 0.0;       ///< standard deviation added, in grey levels of 255
  double damaged_fraction = 0.0;  ///< share of frames the device marks as damaged (never handed out), 0…1

  friend bool operator==(const CameraFaults&, const CameraFaults&) = default;
};

/// An object in the truth.
struct TrueObject {
  std::uint64_t id = 0;
  std::string name;
  Angle angle;        ///< its pose as recognition should see it: yaw + table angle, [0°, 360°)
  Angle yaw;          ///< how it stands on the table
  double x_mm = 0.0;  ///< from the table's axis, in the table's frame
  double y_mm = 0.0;
  bool symmetric = false;
  bool held_out = false;
  bool carried = false;  ///< in the hand, not standing
};

struct Truth {
  TimePoint time;
  Angle table;
  Angle arm_azimuth;
  Angle arm_elevation;
  double lamp_level = 1.0;
  bool moving = false;  ///< an axis or the hand
  bool hand_in_view = false;
  std::vector<TrueObject> objects;
};

struct SimLabOptions {
  std::uint64_t seed = 1;  ///< of all noise and chance
  double table_deg = 0.0;  ///< where the axes stand at first
  double arm_azimuth_deg = 0.0;
  double arm_elevation_deg = 50.0;
  Duration remembered = std::chrono::seconds(20);  ///< how far back `scene_at` can look
};

/// Thread-safe. The clock must outlive the lab, the lab everything made with it.
class SimLab {
 public:
  explicit SimLab(const Clock& clock, SimLabOptions options = {});
  SimLab(const SimLab&) = delete;
  SimLab& operator=(const SimLab&) = delete;

  [[nodiscard]] const Clock& clock() const { return clock_; }
  [[nodiscard]] std::uint64_t seed() const { return options_.seed; }

  // What can be placed. ---------------------------------------------------------------------------------
  [[nodiscard]] std::vector<CatalogEntry> objects() const;
  /// Adds a name that a ReplayCamera has photographs of. A known name is left as it is.
  void add_recorded_object(const std::string& name);

  // What people do. --------------------------------------------------------------------------------------
  /// Puts an object on the table, at once. @param yaw relative to the table. @return its id.
  /// @throws std::invalid_argument when nothing of that name exists or it would stand off the table.
  std::uint64_t place(const std::string& object, Angle yaw = {}, double x_mm = 0.0, double y_mm = 0.0);
  /// The same by a hand that comes into the picture, lets go and leaves. Returns at once.
  std::uint64_t place_by_hand(const std::string& object, Angle yaw = {}, double x_mm = 0.0,
                              double y_mm = 0.0);
  /// @throws std::invalid_argument when no object has that id.
  void remove(std::uint64_t id);
  void remove_by_hand(std::uint64_t id);
  /// Empties the table.
  void clear();
  void hand_in();
  void hand_out();
  /// @throws std::out_of_range outside 0…1.
  void set_lamp_level(double level);
  void set_camera_faults(const CameraFaults& faults);
  [[nodiscard]] CameraFaults camera_faults() const;
  /// Frames whose exposure starts from `from` on and before `until` are damaged.
  void damage_frames(TimePoint from, TimePoint until);
  [[nodiscard]] bool frame_damaged(TimePoint exposure_start) const;

  // What drives do. --------------------------------------------------------------------------------------
  /// From its start on, the axis moves like this. In degrees.
  void set_axis_motion(LabAxis axis, const Trajectory& motion);
  [[nodiscard]] double axis_position_deg(LabAxis axis, TimePoint when) const;
  /// Turns the axis by hand or puts it somewhere, at once.
  void set_axis_position(LabAxis axis, Angle position);

  // What can be seen. ------------------------------------------------------------------------------------
  /// The lab at `when`, which may lie in the past as far as `remembered`.
  [[nodiscard]] SceneState scene_at(TimePoint when) const;
  [[nodiscard]] Truth truth() const { return truth_at(clock_.now()); }
  [[nodiscard]] Truth truth_at(TimePoint when) const;

 private:
  struct Placement {
    std::uint64_t id;
    std::string name;
    Angle yaw;
    double x_mm;
    double y_mm;
    TimePoint since;                         ///< seen from then on
    TimePoint set_down;                      ///< carried by the hand before
    TimePoint picked_up = TimePoint::max();  ///< carried by the hand from then on
    TimePoint gone = TimePoint::max();       ///< not seen from then on
  };
  using Motion = std::vector<Trajectory>;  ///< in order of their starts

  static const Trajectory& motion_at(const Motion& motion, TimePoint when);
  void append(Motion& motion, Trajectory next) const;
  [[nodiscard]] std::optional<CatalogEntry> find_entry(const std::string& name) const;
  void check_placement(const std::string& object, double x_mm, double y_mm) const;
  [[nodiscard]] Placement& standing(std::uint64_t id, TimePoint now);
  TimePoint move_hand(double reach, TimePoint when);
  void forget_before(TimePoint when);

  const Clock& clock_;
  const SimLabOptions options_;
  mutable std::mutex mutex_;
  std::array<Motion, lab_axis_count> axes_;  ///< guarded by mutex_
  Motion hand_;                              ///< guarded by mutex_; 0 outside … 1 at the centre
  std::vector<Placement> placements_;        ///< guarded by mutex_
  std::vector<CatalogEntry> catalog_;        ///< guarded by mutex_
  std::uint64_t next_id_ = 1;                ///< guarded by mutex_
  double lamp_level_ = 1.0;                  ///< guarded by mutex_
  CameraFaults camera_faults_;               ///< guarded by mutex_
  TimePoint damaged_from_;                   ///< guarded by mutex_
  TimePoint damaged_until_;                  ///< guarded by mutex_
};

}  // namespace eigenpose::sim
