#pragma once

/// One simulated stepper drive with the holding registers of the Oriental Motor AZ series.
///
/// Where the figures come from: direct data operation (0x0058…0x0069), its operation types and triggers, and
/// the bits of the driver input command (0x007D): the public library arduino-OrientalAZ; automatic-OFF input
/// (0x0079) and the output bits (0x007F): the public library VJ_OrientalMaster; monitors (0x0080,
/// 0x00C6…0x00D1), maintenance (0x0180, 0x018A), the communication parameters (0x1380…0x1393) and alarm
/// codes: Oriental Motor's function manual HM-60262E. 32-bit values take two registers, the upper half at the
/// lower address.
///
/// Served in full: direct data operation, STOP, FREE, ZHOME, ALM-RST, FW-POS/RV-POS, P-PRESET, alarm reset,
/// communication timeout. Stored operation data (M0…M2 with START) is not.

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "core/base/clock.h"
#include "sim/lab/sim_lab.h"

namespace eigenpose::sim {

struct DriveOptions {
  std::uint8_t unit = 1;          ///< Modbus address, 1…247
  LabAxis axis = LabAxis::table;  ///< what the motor turns
  double steps_per_degree = 100.0;
  double home_deg = 0.0;              ///< where the axis stands when the drive counts 0
  std::optional<double> lower_deg{};  ///< software limits of the axis, none for a turntable
  std::optional<double> upper_deg{};
  bool homed = false;                 ///< at power on
  double homing_speed = 6000.0;       ///< steps/s
  double jog_speed = 2000.0;          ///< steps/s, of FW-POS and RV-POS
  double jog_acceleration = 20000.0;  ///< steps/s²
};

/// What is mechanically wrong with a drive.
struct DriveFaults {
  bool stuck = false;         ///< the rotor does not follow; ends in a position deviation alarm
  double slip_steps = 0.0;    ///< the next move ends short by this; then 0 again
  double backlash_deg = 0.0;  ///< the load lags behind the motor by half of it, on the side it came from
  bool dead = false;          ///< no power: never answers, stands still
};

/// What a register access ends with.
enum class ModbusException : std::uint8_t {
  none = 0,
  illegal_function = 1,
  illegal_address = 2,
  illegal_value = 3,
  device_failure = 4,
  gateway_target_silent = 0x0B,
};

/// Thread-safe. The lab must outlive it.
class AzDrive {
 public:
  /// @param speed_factor motion takes the time of a real drive divided by this.
  AzDrive(SimLab& lab, const DriveOptions& options, double speed_factor);

  [[nodiscard]] const DriveOptions& options() const { return options_; }

  /// Registers from `address` on, as many as `values` has room for. All or nothing.
  ModbusException read(std::uint16_t address, std::span<std::uint16_t> values);
  ModbusException write(std::uint16_t address, std::span<const std::uint16_t> values);
  /// Any valid message to this drive: feeds its communication watchdog.
  void note_message();
  /// What happens by itself: watchdog, deviation, limits. Call it at least every 20 ms.
  void tick();

  /// From the next motion on, in place of the constructor's.
  void set_speed_factor(double factor) { speed_factor_ = factor; }
  void set_faults(const DriveFaults& faults);
  [[nodiscard]] DriveFaults faults() const;
  void raise_alarm(int code);
  [[nodiscard]] int alarm() const;

 private:
  [[nodiscard]] std::optional<std::uint16_t> value_of(std::uint16_t address) const;
  [[nodiscard]] std::uint32_t pair_value(std::uint16_t even_address) const;
  [[nodiscard]] std::int32_t stored(std::uint16_t even_address) const;
  [[nodiscard]] std::uint16_t output_bits() const;
  [[nodiscard]] double feedback(TimePoint now) const;
  [[nodiscard]] bool ready(TimePoint now) const;
  bool apply_input(std::uint16_t bits, TimePoint now);
  ModbusException start_direct_operation(TimePoint now);
  /// Where an operation of this type ends, in steps; nothing for a type that this drive does not serve.
  [[nodiscard]] std::optional<double> direct_target(std::int32_t type, TimePoint now) const;
  void go_to(double target, const MotionLimits& limits, TimePoint now);
  ModbusException trigger_after_write(std::uint16_t first, std::uint16_t last, TimePoint now);
  void start_homing(TimePoint now);
  void preset(TimePoint now);
  void reset_alarm();
  void alarm_now(int code, TimePoint now);
  void move(const Trajectory& command, TimePoint now);
  [[nodiscard]] MotionLimits scaled(double speed, double acceleration, double deceleration) const;
  void update(TimePoint now);

  SimLab& lab_;
  const DriveOptions options_;
  std::atomic<double> speed_factor_;
  mutable std::mutex mutex_;
  // Everything below is guarded by mutex_.
  std::map<std::uint16_t, std::uint16_t> registers_;  ///< those that keep what is written
  Trajectory command_;                                ///< in steps
  double target_ = 0.0;                               ///< steps
  double zero_deg_;                                   ///< of the axis, where the counter is 0
  double slipped_ = 0.0;                              ///< steps the rotor stays behind the command
  std::optional<double> stuck_at_;                    ///< steps
  std::uint16_t input_ = 0;                           ///< level inputs as last written
  bool homing_ = false;
  bool homed_;
  int alarm_ = 0;
  std::optional<int> alarm_at_rest_;  ///< raised when the motion under way ends
  DriveFaults faults_;
  TimePoint last_message_;
};

}  // namespace eigenpose::sim
