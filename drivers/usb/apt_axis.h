#pragma once

/// A Thorlabs APT stage as an axis: one channel of a controller at the other end of a ByteLink.

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <string>

#include "core/base/clock.h"
#include "drivers/axis.h"
#include "drivers/motion.h"
#include "drivers/usb/apt_protocol.h"
#include "drivers/usb/apt_stage.h"
#include "drivers/usb/byte_link.h"

namespace eigenpose {

/// "Unit" is the axis's unit: degrees or millimetres.
struct AptAxisOptions {
  std::string name = "arm";  ///< opens the text of every error
  Dof dof = {"arm", "deg", 0.0, 360.0, true};
  AptStage stage;  ///< from `apt_stage("PRM1-Z8")`
  std::uint8_t controller = apt::generic_unit;
  std::uint8_t channel = 1;
  bool reversed = false;           ///< the stage counts up where the axis counts down
  double zero_offset = 0.0;        ///< where the axis's zero lies, seen from home, in the unit
  double speed = 0.0;              ///< unit/s; 0: the stage's own
  double acceleration = 0.0;       ///< unit/s²; 0: the stage's own
  double arrival_tolerance = 0.0;  ///< in the unit; 0: 20 counts
  MotionPatience patience;
  Duration response_timeout = std::chrono::milliseconds(500);  ///< for one answer
  int attempts = 3;                                            ///< for one question, 1 … 10
};

/// Lives on one thread, except `stop_motion`. The destructor stops a motion that may be under way.
///
/// Commands of the protocol have no acknowledgement; so none is believed: what counts is the status that is
/// asked for afterwards. After a lost link or a damaged message the link is opened anew and the controller
/// set up again.
class AptAxis final : public Axis {
 public:
  /// Does not touch the device. @param clock must outlive the axis. @throws std::invalid_argument.
  AptAxis(AptAxisOptions options, std::unique_ptr<ByteLink> link, const Clock& clock);
  ~AptAxis() override;

  [[nodiscard]] const AxisInfo& info() const override { return info_; }
  AxisState state(TimePoint deadline) override;
  void home(TimePoint deadline, std::stop_token stop) override;
  double move_to(double position, TimePoint deadline, std::stop_token stop) override;
  /// By a move to where the controller's count then stands, which keeps the direction. Not on an axis that is
  /// not homed.
  double jog(double distance, TimePoint deadline, std::stop_token stop) override;
  void stop_motion() override;

 private:
  MotionReading read(const std::string& operation, TimePoint deadline);
  /// Sends and, on failure, opens the link anew and sends again, `attempts` times in all.
  void send(const std::string& operation, std::span<const std::uint8_t> message, TimePoint deadline);
  MotionOrder order(MotionOrder::Goal goal, const std::string& operation, double target) const;
  /// Sends `command` and waits. On every way but arrival the controller has been told to stop.
  MotionReading run(const MotionOrder& order, std::span<const std::uint8_t> command, TimePoint deadline,
                    const std::stop_token& stop);
  MotionReading read_at_rest(const std::string& operation, AlarmHandling alarms, TimePoint deadline);
  /// @throws DeviceError on an alarm and on an axis that is not homed.
  MotionReading read_ready_to_move(const std::string& operation, TimePoint deadline);
  /// @param position not canonical. @return the position read back, canonical.
  double move_count_to(double position, const std::string& operation, TimePoint deadline,
                       const std::stop_token& stop);
  void forget_faults(const std::string& operation, TimePoint deadline);
  void send_stop(TimePoint deadline);
  std::string stop_after_failure();

  // With link_mutex_ held:
  /// @param first is done in each attempt as soon as the link is open, before the controller is set up.
  template <class Work, class First>
  auto with_retries(const std::string& operation, TimePoint deadline, const Work& work, const First& first);
  template <class Work>
  auto with_retries(const std::string& operation, TimePoint deadline, const Work& work) {
    return with_retries(operation, deadline, work, [] {});
  }
  void set_up(const std::string& operation, TimePoint deadline);
  void transmit(std::span<const std::uint8_t> message, TimePoint deadline);
  apt::Status ask_status(const std::string& operation, TimePoint deadline);
  apt::Received wait_for(apt::Message number, const std::string& operation, TimePoint deadline);
  void drain(TimePoint deadline);

  [[nodiscard]] double position_of(std::int32_t counts) const;
  [[nodiscard]] std::int32_t counts_of(const std::string& operation, double position) const;

  AptAxisOptions options_;
  const Clock& clock_;
  AxisInfo info_;
  MotionGate gate_;
  std::atomic<bool> may_be_moving_{false};

  std::mutex link_mutex_;             ///< one question and its answer at a time
  std::unique_ptr<ByteLink> link_;    ///< guarded by link_mutex_
  apt::Unpacker unpacker_;            ///< guarded by link_mutex_
  bool is_set_up_ = false;            ///< guarded by link_mutex_
  bool link_suspect_ = false;         ///< guarded by link_mutex_: open anew before the next use
  std::optional<std::string> fault_;  ///< guarded by link_mutex_: what the controller complained of
};

}  // namespace eigenpose
