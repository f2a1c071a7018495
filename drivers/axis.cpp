#include "drivers/axis.h"

#include "core/base/error.h"
#include "drivers/motion.h"

namespace eigenpose {

double longest_unhomed_jog(const Dof& dof) {
  constexpr double share_of_range = 1.0 / 36.0;
  return share_of_range * (dof.upper - dof.lower);
}

double Axis::jog(double distance, TimePoint deadline, std::stop_token stop) {
  const Dof& dof = info().dof;
  check_jog(dof.name, dof, distance);
  const AxisState now = state(deadline);
  if (!now.homed) throw DeviceError(dof.name, "jog", "not homed; home the axis first");
  return move_to(dof.canonical(now.position + distance), deadline, std::move(stop));
}

}  // namespace eigenpose
