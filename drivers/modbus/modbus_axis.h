#pragma once

/// A stepper or servo drive over Modbus, TCP or RTU, as an axis. Its register map is a ModbusProfile.

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "core/base/clock.h"
#include "drivers/axis.h"
#include "drivers/modbus/modbus_bus.h"
#include "drivers/modbus/profile.h"
#include "drivers/motion.h"

namespace eigenpose {

/// How the drive is built into the rig. "Unit" below is the axis's unit: degrees or millimetres.
struct ModbusAxisOptions {
  std::string name = "table";  ///< opens the text of every error
  Dof dof = {"table", "deg", 0.0, 360.0, true};
  int unit = 1;                    ///< Modbus unit number, 1 … 247
  double steps_per_unit = 100;     ///< steps of the drive for one unit, gears included; above 0
  bool reversed = false;           ///< the drive counts up where the axis counts down
  double zero_offset = 0.0;        ///< where the axis's zero lies, seen from home, in the unit
  double speed = 20.0;             ///< unit/s, above 0
  double acceleration = 40.0;      ///< unit/s², above 0
  double arrival_tolerance = 0.0;  ///< in the unit; 0: two steps
  MotionPatience patience;
  /// Silence after which the drive stops by itself, where the profile has a watchdog; 0: not used. It is
  /// armed for the time of a motion only, so that a resting drive raises no alarm. Longer than a failing
  /// transaction takes.
  Duration watchdog = std::chrono::seconds(2);
};

/// Lives on one thread, except `stop_motion`. Several axes may share one bus. The destructor stops a motion
/// that may be under way.
///
/// A move is refused on an axis that is not homed or has an alarm. Only alarms that say that nobody spoke to
/// the drive (`ModbusProfile::silence_alarms`) are cleared silently. `home` clears every alarm that can be
/// cleared, because it is what an operator does after one. When a motion fails, the text of the error says
/// whether the drive could be stopped.
class ModbusAxis final : public Axis {
 public:
  /// Does not touch the device. @param clock must outlive the axis.
  /// @throws std::invalid_argument on an impossible profile or option.
  ModbusAxis(ModbusProfile profile, ModbusAxisOptions options, std::shared_ptr<ModbusBus> bus,
             const Clock& clock);
  ~ModbusAxis() override;

  [[nodiscard]] const AxisInfo& info() const override { return info_; }
  AxisState state(TimePoint deadline) override;
  void home(TimePoint deadline, std::stop_token stop) override;
  double move_to(double position, TimePoint deadline, std::stop_token stop) override;
  /// By the profile's own jog where it has one; that is sent once only, since twice would be twice as far.
  /// Otherwise by a move to where the drive's count then stands, which keeps the direction too.
  double jog(double distance, TimePoint deadline, std::stop_token stop) override;
  void stop_motion() override;

 private:
  struct Block {
    std::uint16_t address = 0;
    int count = 0;
  };
  enum class Sending {
    until_answered,  ///< again when the answer is lost
    urgent,          ///< the same, before all others on the bus
    once
  };
  struct Reading : MotionReading {
    bool ready = true;
    bool silence_alarm = false;
    std::int64_t steps = 0;
  };

  Reading read(const std::string& operation, TimePoint deadline);
  Reading read_ready_to_move(const std::string& operation, AlarmHandling alarms, TimePoint deadline,
                             const std::stop_token& stop);
  Reading wait_until_ready(const std::string& operation, TimePoint deadline, const std::stop_token& stop);
  void write(const std::string& operation, const RegisterWrites& writes, const RegisterFill& fill,
             TimePoint deadline, Sending sending = Sending::until_answered);
  void clear_alarm(const std::string& operation, TimePoint deadline);
  void set_up_after_connecting(const std::string& operation, TimePoint deadline);
  Reading wait_for_standstill(const std::string& operation, TimePoint deadline);
  /// What starts a motion.
  struct Command {
    const RegisterWrites& writes;
    RegisterFill fill;  ///< `position` is where it ends
    Sending sending = Sending::until_answered;
  };
  /// Sends `command` and waits. On every way but arrival the drive has been told to stop.
  MotionReading run(MotionOrder::Goal goal, const std::string& operation, const Command& command,
                    TimePoint deadline, const std::stop_token& stop);
  /// Tries to stop after a failure; never throws. Says in words how it went.
  std::string stop_after_failure();
  void send_stop(TimePoint deadline);
  void arm_watchdog(const std::string& operation, TimePoint deadline);
  void disarm_watchdog(const std::string& operation, TimePoint deadline);

  [[nodiscard]] double position_of(std::int64_t steps) const;
  [[nodiscard]] std::int64_t steps_of(double position) const;
  [[nodiscard]] RegisterFill motion_fill() const;
  /// @throws DeviceError when the drive cannot count so far.
  void check_counter(const std::string& operation, std::int64_t steps) const;

  ModbusProfile profile_;
  ModbusAxisOptions options_;
  std::shared_ptr<ModbusBus> bus_;
  const Clock& clock_;
  AxisInfo info_;
  RegisterRange counter_;  ///< the steps that the drive can count
  std::vector<Block> status_blocks_;
  std::uint64_t set_up_connection_ = 0;  ///< the connection on which `connect` was written
  bool watchdog_armed_ = false;
  bool homed_here_ = false;  ///< for profiles without a homed bit
  std::atomic<bool> may_be_moving_{false};

  MotionGate gate_;
};

}  // namespace eigenpose
