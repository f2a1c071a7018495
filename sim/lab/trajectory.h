#pragma once

/// How a simulated axis moves: trapezoidal velocity in closed form, so that its position is known at any
/// time, also in the middle of an exposure that lies in the past.

#include <vector>

#include "core/base/clock.h"

namespace eigenpose::sim {

/// What a motor is told. Units: of the axis, per second, per second². All greater than zero.
struct MotionLimits {
  double speed = 90.0;
  double acceleration = 360.0;
  double deceleration = 360.0;
};

/// Position over time: constant acceleration in pieces, standstill or constant speed at the end.
/// Before its start it stands where it starts. Value type.
class Trajectory {
 public:
  /// Stands at `position`, always.
  static Trajectory standstill(double position, TimePoint start);

  [[nodiscard]] double position(TimePoint when) const;
  [[nodiscard]] double velocity(TimePoint when) const;
  [[nodiscard]] TimePoint start() const { return pieces_.front().start; }
  /// When it comes to rest; TimePoint::max() if it runs on.
  [[nodiscard]] TimePoint end() const { return end_; }
  [[nodiscard]] bool moving(TimePoint when) const { return when >= start() && when < end_; }

  /// From where this trajectory is at `now`, with its speed, to rest at `target`. A target that can't be
  /// reached by braking alone is overshot and approached from the other side, as a drive does it.
  [[nodiscard]] Trajectory move_to(double target, const MotionLimits& limits, TimePoint now) const;
  /// Brakes from `now` to rest.
  [[nodiscard]] Trajectory stop(double deceleration, TimePoint now) const;
  /// Speeds up from `now` to `limits.speed` and keeps it. @param direction +1 or −1.
  [[nodiscard]] Trajectory run(int direction, const MotionLimits& limits, TimePoint now) const;
  /// Stands still at once where it is at `now` (power cut, stuck motor).
  [[nodiscard]] Trajectory freeze(TimePoint now) const;
  /// The same motion with every position moved by `offset`.
  [[nodiscard]] Trajectory shifted(double offset) const;
  /// The same motion with every position multiplied (steps to degrees).
  [[nodiscard]] Trajectory scaled(double factor) const;

 private:
  struct Piece {
    TimePoint start;
    double position;
    double velocity;
    double acceleration;
  };
  struct Sample {
    double position;
    double velocity;
  };
  explicit Trajectory(Piece first);
  [[nodiscard]] Sample at(TimePoint when) const;
  void extend(double seconds, double acceleration);
  void come_to_rest(double position);
  void speed_towards(double distance, int direction, double speed_now, const MotionLimits& limits);

  std::vector<Piece> pieces_;  ///< never empty, in order; the last one lasts for ever
  TimePoint end_;
};

}  // namespace eigenpose::sim
