#pragma once

/// What every axis driver does alike while its motor turns: be interruptible, and judge from what is read
/// back whether the axis has arrived. For drivers only.

#include <chrono>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/workspace.h"

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
  Duration poll_interval = std::chrono::milliseconds(20);  ///< between two looks at a moving axis
  Duration start_time = std::chrono::milliseconds(500);    ///< within which a command must show effect
  Duration settle_time =
      std::chrono::milliseconds(500);  ///< within which a motor that has stopped is at its target
  Duration stall_time =
      std::chrono::seconds(2);  ///< a position that does not change for so long is a stuck motor
};

/// What a drive said at one moment.
struct MotionReading {
  bool moving = false;
  bool in_position = true;  ///< within the drive's own window, where it has one
  bool homed = false;
  std::optional<std::string> alarm;  ///< in words
  double position =
      0.0;  ///< read after the flags; in the axis's unit, not canonical: it counts on over whole turns
};

/// Judges one motion by its readings. Lives on one thread.
class MotionWatch {
 public:
  enum class Goal { target, home };

  /// @param target where a move ends, not canonical; ignored for Goal::home.
  /// @param tolerance |position − target| that counts as arrived, in the unit.
  MotionWatch(std::string device, std::string operation, Dof dof, Goal goal, double target, double tolerance,
              MotionPatience patience, TimePoint now);

  /// True when the axis stands where it should. @throws DeviceError on an alarm, a motor that does not start,
  /// is stuck, or has stopped elsewhere; DeviceTimeout when `now` has reached `deadline`.
  bool arrived(const MotionReading& reading, TimePoint now, TimePoint deadline);

 private:
  [[nodiscard]] std::string in_words(double position) const;
  [[noreturn]] void fail(const std::string& cause) const;

  std::string device_;
  std::string operation_;
  Dof dof_;
  Goal goal_;
  double target_;
  double tolerance_;
  MotionPatience patience_;
  TimePoint start_;
  TimePoint last_change_;
  TimePoint still_since_;
  bool moving_ = false;
  bool moved_at_all_ = false;
  std::optional<double> last_position_;
};

/// Where to send a drive that counts on over whole turns: the position congruent to `position` that is
/// nearest to `from`, on a periodic axis; `position` itself on another.
double nearest_target(const Dof& dof, double position, double from);

/// @throws std::out_of_range naming the axis when `position` is not a number in the range of `dof`, both ends
/// included.
void check_target(const std::string& device, const Dof& dof, double position);

/// @throws std::out_of_range when `distance` is not a number, longer than the range of `dof`, or, for an axis
/// that is not homed, longer than `longest_unhomed_jog`.
void check_jog(const std::string& device, const Dof& dof, double distance, bool homed);

/// The same failure with what became of the motor behind its cause.
template <class Failure>
[[noreturn]] void rethrow_with(const Failure& failure, const std::string& consequence) {
  const std::string cause =
      std::string(failure.what()).substr(failure.device().size() + failure.operation().size() + 4);
  throw Failure(failure.device(), failure.operation(), cause + "; " + consequence);
}

/// Calls `work`; when it fails, calls `halt` (which says in words what became of the motor and does not
/// throw) and throws the failure on with those words. A refusal after `stop` was requested is what the stop
/// has brought about: Interrupted.
template <class Work, class Halt>
auto stopping_on_failure(const std::stop_token& stop, const Work& work, const Halt& halt) {
  try {
    return work();
  } catch (const Interrupted&) {
    halt();
    throw;
  } catch (const DeviceTimeout& failure) {
    rethrow_with(failure, halt());
  } catch (const DeviceLost& failure) {
    rethrow_with(failure, halt());
  } catch (const DeviceError& failure) {
    const std::string consequence = halt();
    if (stop.stop_requested())
      throw Interrupted(failure.device() + ": " + failure.operation() + ": interrupted on request; " +
                        consequence);
    rethrow_with(failure, consequence);
  }
}

}  // namespace eigenpose
