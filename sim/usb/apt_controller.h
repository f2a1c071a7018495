#pragma once

/// A simulated Thorlabs APT controller with one stage, byte by byte. Written from "Thorlabs Motion
/// Controllers Host-Controller Communications Protocol", apart from any driver.

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/clock.h"
#include "sim/lab/sim_lab.h"
#include "sim/usb/sim_link.h"

namespace eigenpose::sim {

struct AptControllerOptions {
  LabAxis axis = LabAxis::arm_azimuth;  ///< what the stage turns
  std::uint32_t serial_number = 83000001;
  std::string model = "KDC101";
  bool stepper = false;  ///< answers the stepper's status request, not the DC servo's
  double counts_per_degree = 1919.6418578623391;  ///< PRM1-Z8
  double velocity_per_degree = 42941.66;          ///< controller's number for 1 deg/s
  double acceleration_per_degree = 14.66;         ///< controller's number for 1 deg/s²
  double home_deg = 0.0;                          ///< where the axis stands when the controller counts 0
  double homing_speed = 30.0;                     ///< deg/s
  double speed_factor = 1.0;                      ///< motion takes the time of a real stage divided by this
};

/// What is mechanically wrong.
struct AptFaults {
  bool stuck = false;        ///< the motor does not follow; the controller reports a motion error
  double slip_counts = 0.0;  ///< the next move ends short by this; then 0 again
};

/// Thread-safe. The lab must outlive it.
class AptController final : public ByteDevice {
 public:
  AptController(SimLab& lab, AptControllerOptions options);

  std::vector<std::uint8_t> receive(std::span<const std::uint8_t> bytes) override;
  std::vector<std::uint8_t> spontaneous() override;

  [[nodiscard]] const AptControllerOptions& options() const { return options_; }
  void set_faults(const AptFaults& faults);
  /// From the next motion on, in place of the option.
  void set_speed_factor(double factor) { speed_factor_ = factor; }
  /// A fault in the controller, told with words as it happens and by the motion error bit until the next
  /// command.
  void raise_fault(const std::string& words);
  /// How often the host said that it is alive.
  [[nodiscard]] int keep_alives() const;

 private:
  void obey(std::span<const std::uint8_t> message);
  void say(std::uint16_t number, std::uint8_t parameter1, std::uint8_t parameter2);
  void say(std::uint16_t number, std::span<const std::uint8_t> data);
  void say_status(std::uint16_t number);
  void say_info();
  void move_to_counts(double counts, double degrees_per_s, TimePoint now);
  enum class Stop { at_once, along_the_ramp };
  void stop(Stop how, TimePoint now);
  void follow(const Trajectory& counts);
  [[nodiscard]] double counts_at(TimePoint now) const;
  [[nodiscard]] std::uint32_t status_bits(TimePoint now) const;
  void finish_motion(TimePoint now);

  SimLab& lab_;
  const AptControllerOptions options_;
  std::atomic<double> speed_factor_;
  mutable std::mutex mutex_;
  // Everything below is guarded by mutex_.
  std::vector<std::uint8_t> heard_;
  std::vector<std::uint8_t> said_;
  Trajectory motion_;  ///< in counts
  double slipped_ = 0.0;
  std::optional<double> stuck_at_;
  double velocity_ = 10.0;      ///< deg/s
  double acceleration_ = 10.0;  ///< deg/s²
  bool enabled_ = false;
  bool homed_ = false;
  bool homing_ = false;
  bool motion_error_ = false;
  bool tell_end_ = false;  ///< a message is due when the motion ends
  bool stopping_ = false;
  int updates_unanswered_ = 0;
  int keep_alives_ = 0;
  AptFaults faults_;
};

}  // namespace eigenpose::sim
