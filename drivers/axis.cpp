#include "drivers/axis.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/error.h"
#include "drivers/motion.h"

namespace eigenpose {

void check_target(const std::string& axis, const Dof& dof, double position) {
  if (!(position >= dof.lower && position <= dof.upper))
    throw std::out_of_range(
        fmt::format("{}: {} {} is outside {} … {}", axis, position, dof.unit, dof.lower, dof.upper));
}

double longest_unhomed_jog(const Dof& dof) {
  constexpr double share_of_range = 1.0 / 36.0;
  return share_of_range * (dof.upper - dof.lower);
}

double Axis::jog(double distance, TimePoint deadline, std::stop_token stop) {
  const Dof& dof = info().dof;
  check_jog(dof.name, dof, distance);
  // A move goes the short way round: half a turn and more would go the other way, a whole turn nowhere.
  if (dof.periodic && !(std::abs(distance) < 0.5 * dof.period()))
    throw std::out_of_range(fmt::format(
        "{}: this drive only moves to positions, the short way round: jog by less than {:g} {} at a time",
        dof.name, 0.5 * dof.period(), dof.unit));
  const AxisState now = state(deadline);
  if (!now.homed) throw DeviceError(dof.name, "jog", "not homed; home the axis first");
  return move_to(dof.canonical(now.position + distance), deadline, std::move(stop));
}

}  // namespace eigenpose
