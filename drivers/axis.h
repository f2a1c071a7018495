#pragma once

/// What Eigenpose needs of a motorised degree of freedom, no more.
///
/// Conventions, defined here once:
///  - Positions are in the axis's unit: degrees for rotation, millimetres for translation.
///  - Zero is the home position plus the configured offset.
///  - Positive table rotation is counter-clockwise seen from above; positive azimuth of the light arm too;
///    positive elevation is upwards from the table plane.
///  - A periodic axis takes and reports positions in [lower, upper) and goes the short way round.

#include <optional>
#include <stop_token>
#include <string>

#include "core/base/clock.h"
#include "core/base/workspace.h"

namespace eigenpose {

/// What the axis is. `dof` carries name, unit, range and whether it is periodic.
struct AxisInfo {
  Dof dof;
  std::string model;               ///< "Oriental Motor AZ", "Thorlabs APT", …
  double resolution = 0.0;         ///< smallest step, in the unit
  double arrival_tolerance = 0.0;  ///< |position read back − target| at which a move has arrived, in the unit
};

/// What the axis says of itself at one moment.
struct AxisState {
  double position = 0.0;  ///< read back from the drive, in the unit, canonical
  bool moving = false;
  bool homed = false;                ///< position is trustworthy
  std::optional<std::string> alarm;  ///< in words, when the drive raises one
};

/// @throws std::out_of_range naming the axis when `position` is not a number in the range of `dof`, both ends
/// included.
void check_target(const std::string& axis, const Dof& dof, double position);

/// How far an axis that does not know where it is may be moved in one go, in its unit.
double longest_unhomed_jog(const Dof& dof);

/// One motorised DOF. Lives on one thread, except `stop_motion`, which any thread may call at any time.
///
/// Every call that moves: refuses a target outside the range (std::out_of_range) before anything moves;
/// returns only after the position *read back* is within the arrival tolerance and the drive reports
/// standstill; and on every other way out (deadline, stop request, alarm, lost device) has told the drive to
/// stop, as far as it can be reached.
class Axis {
 public:
  virtual ~Axis() = default;

  [[nodiscard]] virtual const AxisInfo& info() const = 0;

  /// Asks the drive. @throws DeviceTimeout, DeviceLost, DeviceError.
  virtual AxisState state(TimePoint deadline) = 0;

  /// Finds the home position. After it `state().homed`. @throws DeviceError and its kinds, Interrupted.
  virtual void home(TimePoint deadline, std::stop_token stop) = 0;

  /// Moves to `position` (absolute, in the unit) and waits for arrival.
  /// @return the position read back. @throws std::out_of_range; DeviceError (not homed, alarm, arrived
  /// elsewhere), DeviceTimeout, DeviceLost; Interrupted.
  virtual double move_to(double position, TimePoint deadline, std::stop_token stop) = 0;

  /// Moves by `distance` (in the unit) from where the axis stands and waits for arrival: the operator's hand,
  /// not the acquisition's. A periodic axis turns in the direction of the distance, by a whole turn at most.
  /// Here by `move_to`, which goes the short way round: by less than half a turn. A driver whose device moves
  /// by a distance itself also moves an axis that is not homed, to free it, by `longest_unhomed_jog` at most,
  /// since its limits are not known then.
  /// @return the position read back. @throws std::out_of_range when it would end outside the range or turn
  /// further than the range is long or, here, half a turn; otherwise like `move_to`.
  virtual double jog(double distance, TimePoint deadline, std::stop_token stop);

  /// Tells the drive to stop now, and makes a `move_to`, `jog` or `home` under way on another thread end with
  /// Interrupted. Thread-safe, idempotent. @throws DeviceError when the drive cannot be told.
  virtual void stop_motion() = 0;

 protected:
  Axis() = default;
  Axis(const Axis&) = default;
  Axis& operator=(const Axis&) = default;
};

}  // namespace eigenpose
