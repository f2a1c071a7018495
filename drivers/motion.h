#pragma once

/// What every axis driver does alike while its motor turns: it can be interrupted, and it judges by what is
/// read back whether the axis has arrived. For drivers only.

#include <chrono>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/workspace.h"
#include "drivers/axis.h"

namespace eigenpose {

/// Lets any thread end the wait of the motion under way. Thread-safe.
class MotionGate {
 public:
  /// One motion, from its first message to its last. Ends on the caller's token or on `interrupt`.
  class Passage {
   public:
    /// @param gate outlives the passage. One passage at a time.
    Passage(MotionGate& gate, const std::stop_token& caller);
    Passage(const Passage&) = delete;
    Passage& operator=(const Passage&) = delete;
    ~Passage();
    [[nodiscard]] std::stop_token token() const { return source_.get_token(); }

   private:
    MotionGate& gate_;
    std::stop_source source_;
    std::stop_callback<std::function<void()>> on_caller_;
  };

  /// Ends the motion under way, if there is one.
  void interrupt();

 private:
  std::mutex mutex_;
  std::stop_source* current_ = nullptr;  ///< guarded by mutex_
};

/// How patient a driver is with its motor.
struct MotionPatience {
  /// Between two readings of a moving axis.
  Duration poll_interval = std::chrono::milliseconds(20);
  /// Within this time a command must show effect.
  Duration start_time = std::chrono::milliseconds(500);
  /// Within this time a motor that has stopped is at its target.
  Duration settle_time = std::chrono::milliseconds(500);
  /// A moving motor that gets nowhere for this time is stuck.
  Duration stall_time = std::chrono::seconds(2);
};

/// What a drive said at one moment.
struct MotionReading {
  bool moving = false;
  bool in_position = true;  ///< within the drive's own window, where it has one
  bool homed = false;
  std::optional<std::string> alarm;  ///< in words
  /// Read after the flags; in the axis's unit, not canonical: it counts on over whole turns.
  double position = 0.0;
};

/// One motion, and whose it is.
struct MotionOrder {
  enum class Goal { target, home };

  std::string device;     ///< opens the text of every error
  std::string operation;  ///< "move to 30 deg"
  Dof dof;
  Goal goal = Goal::target;
  double target = 0.0;     ///< where a move ends, not canonical; ignored for Goal::home
  double tolerance = 0.0;  ///< |position − target| that counts as arrived, in the unit
  MotionPatience patience;
};

/// Finds when an axis last got anywhere. An encoder that dithers by a count or two about one place gets
/// nowhere; a motor that turns ever so slowly does. So a position counts as movement where it lies beyond all
/// positions since the last turning point, or has turned back by more than the tolerance. Value type.
class MovementTracker {
 public:
  /// @param tolerance of arrival, in the axis's unit: no less than what an encoder dithers by.
  MovementTracker(double tolerance, TimePoint now) : tolerance_(tolerance), last_movement_(now) {}
  /// @param position not canonical.
  void add(double position, TimePoint now);
  [[nodiscard]] TimePoint last_movement() const { return last_movement_; }

 private:
  struct Stretch {
    double low;     ///< least position since the last turning point
    double high;    ///< greatest position since then
    double newest;  ///< the position of the last movement
  };
  double tolerance_;
  TimePoint last_movement_;
  std::optional<Stretch> stretch_;
};

/// Judges one motion by its readings. Lives on one thread.
class MotionWatch {
 public:
  MotionWatch(MotionOrder order, TimePoint now);

  /// True when the axis stands where it should. @throws DeviceError on an alarm, a motor that does not start,
  /// is stuck, or has stopped elsewhere; DeviceTimeout when `now` has reached `deadline`.
  bool arrived(const MotionReading& reading, TimePoint now, TimePoint deadline);

 private:
  [[nodiscard]] bool stands_at_goal(const MotionReading& reading, TimePoint now) const;
  [[nodiscard]] std::string in_words(double position) const;
  [[noreturn]] void fail(const std::string& cause) const;

  MotionOrder order_;
  TimePoint start_;
  MovementTracker movement_;
  TimePoint still_since_;
  bool moving_ = false;
  bool moved_at_all_ = false;
};

/// What a driver does in the course of one motion.
struct MotionSteps {
  std::function<void()> start;          ///< sends the command; nothing moves before
  std::function<MotionReading()> read;  ///< asks the drive
  std::function<void()> finish;         ///< after arrival
  /// After every failure: tells the drive to stop and says in words what became of it. Does not throw.
  std::function<std::string()> halt;
};

/// Starts the motion and waits until it has arrived. @return the last reading.
/// @throws what MotionWatch throws and the device errors of `steps`; Interrupted when `stop` was requested,
/// also instead of a failure that the stop has caused; DeviceError for any other exception of
/// `steps`. Each has the words of `halt` behind its cause.
MotionReading carry_out(const MotionOrder& order, const MotionSteps& steps, const Clock& clock,
                        TimePoint deadline, const std::stop_token& stop);

/// Where to send a drive that counts on over whole turns: the position congruent to `position` that is
/// nearest to `from`, on a periodic axis; `position` itself on another.
double nearest_target(const Dof& dof, double position, double from);

/// @throws std::out_of_range when `distance` is not a number or longer than the range of `dof`.
void check_jog(const std::string& device, const Dof& dof, double distance);

/// For an axis that is not homed. @throws std::out_of_range when `distance` is longer than
/// `longest_unhomed_jog`.
void check_unhomed_jog(const std::string& device, const Dof& dof, double distance);

/// Throws Interrupted naming the operation when `stop` was requested.
void heed(const std::stop_token& stop, const std::string& device, const std::string& operation);

/// What becomes of an alarm that the drive shows before a motion.
enum class AlarmHandling {
  refuse,  ///< an error, unless it only says that nobody has spoken to the drive
  clear    ///< cleared where that can be done: homing is what an operator does after an alarm
};

}  // namespace eigenpose
