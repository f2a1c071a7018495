#include "daemon/hardware/hand_control.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/error.h"
#include "daemon/hardware/checkup.h"

namespace eigenpose {
namespace {

using std::chrono::seconds;

Devices devices_of(const Config& config, const Clock& clock) {
  if (is_service_running(config)) {
    throw Error(
        fmt::format("eigenposed is running and holds the devices ({} answers); stop it first with 'systemctl "
                    "stop eigenposed'",
                    config.results_socket().string()));
  }
  return make_devices(config, clock);
}

template <class Items, class NameOf>
std::string list_of(const Items& items, const NameOf& name_of) {
  std::string names;
  for (const auto& item : items) names += (names.empty() ? "" : ", ") + name_of(item);
  return names.empty() ? "none" : names;
}

/// @throws std::out_of_range, also for what is no number.
void refuse_outside(const std::string& axis, const Dof& dof, double target) {
  if (!(target >= dof.lower && target <= dof.upper))
    throw std::out_of_range(fmt::format("{}: {:g} {} is outside {:g} to {:g}; nothing was moved", axis,
                                        target, dof.unit, dof.lower, dof.upper));
}

}  // namespace

HandControl::HandControl(const Config& config, const Clock& clock)
    : HandControl(devices_of(config, clock), clock) {}

HandControl::HandControl(Devices devices, const Clock& clock) : clock_(clock), devices_(std::move(devices)) {}

std::vector<std::string> HandControl::axis_names() const {
  std::vector<std::string> names;
  for (const RigAxis& axis : devices_.axes) names.push_back(axis.options.dof.name);
  return names;
}

const RigAxis& HandControl::setup_of(const std::string& name) const {
  const auto found = std::find_if(devices_.axes.begin(), devices_.axes.end(),
                                  [&](const RigAxis& axis) { return axis.options.dof.name == name; });
  if (found != devices_.axes.end()) return *found;
  throw ConfigError(
      fmt::format("there is no axis \"{}\"; configured: {}", name,
                  list_of(devices_.axes, [](const RigAxis& axis) { return axis.options.dof.name; })));
}

HandControl::OpenAxis& HandControl::open(const std::string& name) {
  const auto found = axes_.find(name);
  if (found != axes_.end()) return found->second;
  const RigAxis& setup = setup_of(name);
  return axes_.emplace(name, OpenAxis{&setup, setup.open()}).first->second;
}

const std::string& HandControl::unit_of(const std::string& axis) const {
  return setup_of(axis).options.dof.unit;
}

AxisState HandControl::state(const std::string& axis) {
  return open(axis).axis->state(clock_.now() + seconds(3));
}

void HandControl::home(const std::string& axis, std::stop_token stop) {
  OpenAxis& opened = open(axis);
  opened.axis->home(clock_.now() + opened.setup->options.move_timeout, std::move(stop));
}

double HandControl::jog_to(const std::string& axis, double position, std::stop_token stop) {
  OpenAxis& opened = open(axis);
  refuse_outside(axis, opened.setup->options.dof, position);
  return opened.axis->move_to(position, clock_.now() + opened.setup->options.move_timeout, std::move(stop));
}

double HandControl::jog_by(const std::string& axis, double distance, std::stop_token stop) {
  OpenAxis& opened = open(axis);
  const Dof& dof = opened.setup->options.dof;
  const TimePoint deadline = clock_.now() + opened.setup->options.move_timeout;
  const AxisState state = opened.axis->state(clock_.now() + seconds(3));
  if (state.homed && !dof.periodic) refuse_outside(axis, dof, state.position + distance);
  if (!state.homed && std::abs(distance) > longest_unhomed_jog(dof))
    throw DeviceError(
        axis, "jog",
        fmt::format("it has not been homed, so its limits are not known: 'eigenpose home {}' first, or "
                    "jog it by {:g} {} at most to free it",
                    axis, longest_unhomed_jog(dof), dof.unit));
  return opened.axis->jog(distance, deadline, std::move(stop));
}

void HandControl::light(const std::string& lamp, double level) {
  if (!(level >= 0.0 && level <= 1.0)) {
    throw std::out_of_range(fmt::format("{}: level {:g} is outside 0 (dark) to 1 (full)", lamp, level));
  }
  if (!lamps_.contains(lamp)) {
    const auto found = std::find_if(devices_.lamps.begin(), devices_.lamps.end(),
                                    [&](const RigLamp& setup) { return setup.options.name == lamp; });
    if (found == devices_.lamps.end()) {
      throw ConfigError(
          fmt::format("there is no lamp \"{}\"; configured: {}", lamp,
                      list_of(devices_.lamps, [](const RigLamp& setup) { return setup.options.name; })));
    }
    lamps_.emplace(lamp, found->open());
  }
  lamps_.at(lamp)->set_level(level, clock_.now() + seconds(3));
}

}  // namespace eigenpose
