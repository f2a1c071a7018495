#pragma once

/// The rig's axes and lamps, on the one thread they live on.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "core/base/clock.h"
#include "core/base/workspace.h"
#include "daemon/rig/heartbeat.h"
#include "drivers/axis.h"
#include "drivers/lamp.h"

namespace eigenpose {

/// What the rig needs to know of an axis, whatever its driver.
struct RigAxisOptions {
  Dof dof;                                           ///< name, unit, range, periodic
  Duration settle = std::chrono::milliseconds(200);  ///< vibration dies out after arrival
  Duration move_timeout = std::chrono::seconds(30);  ///< of one move, and of homing
};

/// An axis and how it is opened.
struct RigAxis {
  RigAxisOptions options;
  std::function<std::unique_ptr<Axis>()> open;
};

struct RigLampOptions {
  std::string name;
  double level = 1.0;  ///< 0…1, set when the lamp is opened
};

/// A lamp and how it is opened.
struct RigLamp {
  RigLampOptions options;
  std::function<std::unique_ptr<Lamp>()> open;
};

/// An axis as last seen.
struct AxisStatus {
  Dof dof;
  std::string model;                 ///< empty until it was opened
  std::optional<AxisState> state;    ///< as last read
  std::optional<std::string> error;  ///< why there is none
};

/// A lamp as last seen.
struct LampStatus {
  std::string name;
  std::string model;                 ///< empty until it was opened
  double wanted_level = 0.0;         ///< 0…1, as configured
  std::optional<double> level;       ///< as the lamp last confirmed it; none: not known to be lit
  std::optional<std::string> error;  ///< why it is not
};

struct RigStatus {
  std::vector<AxisStatus> axes;
  std::vector<LampStatus> lamps;
};

/// Where an actuator stands: an axis in its unit, a lamp by its level.
struct ActuatorPosition {
  std::string name;
  std::string unit;                ///< "deg", "mm"; "level" of a lamp, 0…1
  std::optional<double> position;  ///< none when it cannot be read or is not homed
  double period = 0.0;             ///< of an axis that closes on itself; 0: it does not
  double tolerance = 0.0;          ///< how far it may stand from where it was put; 0 of a lamp

  /// The way from `other` to `position`, without sign, the short way round. @pre position has a value.
  [[nodiscard]] double distance_from(double other) const;
};

/// Opens the devices, keeps them open, and runs work on them. A device that cannot be opened or is lost is
/// tried again every few seconds; a lamp is told its level again as often, so that one that went out is lit
/// again, and that it was out is logged. Work that needs a device which fails ends with the device's own
/// error. Thread-safe.
class Rig {
 public:
  /// Clock and heartbeat outlive the rig. The thread starts at once and opens what it can.
  Rig(std::vector<RigAxis> axes, std::vector<RigLamp> lamps, const Clock& clock, Heartbeat& heartbeat);
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;
  /// Stops all motion, then ends the thread.
  ~Rig();

  /// What work may do with the devices; only within `run`.
  class Control {
   public:
    /// Moves the named axis and waits until it has arrived. Opens and homes it first if needed.
    /// @return the position read back, in the axis's unit. @throws what Axis::move_to throws.
    double move_to(const std::string& axis, double position, const std::stop_token& stop);
    /// Asks the named axis; opens it first if needed. @throws what Axis::state throws.
    AxisState state(const std::string& axis);
    /// How far the named axis may stand from its target and still count as arrived, in its unit.
    double arrival_tolerance(const std::string& axis);
    /// How long the named axis takes to come to rest after arrival.
    [[nodiscard]] Duration settle_time(const std::string& axis) const;
    /// Tells every lamp its level again, opening it first if needed. @return the names of those that may have
    /// been without their level since they were last told, `Lamp::interruptions`; also of one that is lit for
    /// the first time. @throws the error of the first lamp that cannot be lit.
    std::vector<std::string> light_lamps();
    /// Where every axis and lamp of the rig stands. One that cannot be read has no position.
    std::vector<ActuatorPosition> actuators();
    /// The step that follows does not ask the rig for anything for as long as this: it is no sign of a hang.
    void allow(Duration duration) { rig_.pulse_.beat(duration); }

   private:
    friend class Rig;
    explicit Control(Rig& rig) : rig_(rig) {}
    Rig& rig_;
  };

  /// Runs `work` on the rig's thread, after work queued earlier, and rethrows its exception. If it throws,
  /// all motion has been stopped as far as the devices can be reached. @throws Interrupted when the rig ends
  /// first.
  void run(const std::function<void(Control&)>& work);

  /// Tells every axis to stop, all at once, so that none waits for another. A motion under way ends with
  /// Interrupted. Never throws: failures are logged.
  void stop_motion() noexcept;

  [[nodiscard]] RigStatus status() const;

 private:
  struct AxisSlot {
    RigAxis setup;
    std::unique_ptr<Axis>
        axis;           ///< changed on the rig's thread under axes_mutex_; others touch it only under it
    AxisStatus status;  ///< guarded by mutex_
    TimePoint next_try{};
  };
  struct LampSlot {
    RigLamp setup;
    std::unique_ptr<Lamp> lamp;       ///< touched on the rig's thread only
    LampStatus status;                ///< guarded by mutex_
    std::uint64_t interruptions = 0;  ///< of `lamp`, when it was last told its level
    TimePoint next_try{};
  };

  void loop(const std::stop_token& stop);
  AxisSlot& slot(const std::string& name);
  Axis& open(AxisSlot& slot);
  void refresh_all();
  void refresh(AxisSlot& slot);
  /// @return whether the lamp has kept its level since it was last told it.
  bool light(LampSlot& slot);
  void try_to_light(LampSlot& slot);
  void note(AxisSlot& slot, std::optional<AxisState> state, std::optional<std::string> error);
  void note(LampSlot& slot, std::optional<double> level, std::optional<std::string> error);
  void drop(AxisSlot& slot);

  const Clock& clock_;
  Heartbeat::Pulse pulse_;  ///< beaten on the rig's thread
  std::mutex axes_mutex_;   ///< held while a device is told to stop: never take it on the API's thread
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  std::vector<AxisSlot> axes_;
  std::vector<LampSlot> lamps_;
  std::deque<std::packaged_task<void()>> work_;  ///< guarded by mutex_
  std::jthread thread_;                          ///< last: ends before the rest goes
};

}  // namespace eigenpose
