#pragma once

/// What every axis must do, whatever it is driven by. A driver's test brings a rig (the driver, its device,
/// and the hands that break the device) and runs the whole suite on it:
///
///     INSTANTIATE_TEST_SUITE_P(ModbusTcp, AxisConformance, testing::Values(AxisRigCase{"plain", make_rig}),
///     rig_name);

#include <chrono>
#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

#include "core/base/clock.h"
#include "drivers/axis.h"

namespace eigenpose {

/// A driver and a device that the test sees from outside. The device stands un-homed, its motor at rest; it
/// is quick enough to cross half its range in about 0.2 seconds.
class AxisRig {
 public:
  virtual ~AxisRig() = default;

  [[nodiscard]] virtual Axis& axis() = 0;
  /// Destroys the driver's object; the device lives on.
  virtual void discard_axis() = 0;

  /// Where the axis really is, in its unit, canonical.
  [[nodiscard]] virtual double true_position() = 0;
  [[nodiscard]] virtual bool truly_moving() = 0;

  /// Ten times as slow, so that whoever interrupts a motion comes in time on a loaded machine too.
  virtual void slow_down(bool slow) = 0;
  virtual void silence(bool silent) = 0;  ///< hears nothing and says nothing
  virtual void unplug() = 0;              ///< gone from the bus; its power stays
  virtual void plug_in() = 0;
  virtual void jam(bool jammed) = 0;  ///< the motor cannot turn
  virtual void slip() = 0;            ///< the next move ends short by more than the arrival tolerance
  virtual void raise_alarm() = 0;     ///< one that homing can clear
};

struct AxisRigCase {
  std::string name;
  std::function<std::unique_ptr<AxisRig>()> make;
};

inline std::ostream& operator<<(std::ostream& stream, const AxisRigCase& rig) {
  return stream << rig.name;
}

inline std::string rig_name(const testing::TestParamInfo<AxisRigCase>& info) {
  return info.param.name;
}

class AxisConformance : public testing::TestWithParam<AxisRigCase> {
 protected:
  void SetUp() override { rig_ = GetParam().make(); }
  void TearDown() override { rig_.reset(); }

  Axis& axis() { return rig_->axis(); }
  AxisRig& rig() { return *rig_; }
  /// Longer than anything takes here on a busy machine, emulated too.
  static TimePoint soon() { return std::chrono::steady_clock::now() + std::chrono::seconds(60); }
  /// Homed and at rest. Repeats what a fault may spoil.
  void home();
  /// The signed way from b to a, the short way round.
  double difference(double a, double b) { return axis().info().dof.difference(a, b); }
  /// A point of the range, 0 its lower end, 1 its upper.
  double at(double share) {
    const Dof& dof = axis().info().dof;
    return dof.lower + share * (dof.upper - dof.lower);
  }
  /// Waits until `condition` holds. @return whether it ever did.
  static bool eventually(const std::function<bool()>& condition);
  /// How far what the driver says may be from the truth: its own tolerance, and a step of rounding.
  double tolerance() { return axis().info().arrival_tolerance + axis().info().resolution; }

 private:
  std::unique_ptr<AxisRig> rig_;
};

}  // namespace eigenpose
