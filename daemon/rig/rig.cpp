#include "daemon/rig/rig.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include <spdlog/spdlog.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

constexpr std::chrono::milliseconds refresh_period{500};
constexpr std::chrono::seconds reopen_pause{5};
/// For opening a device and its first answer. How often it is asked is the driver's own affair.
constexpr std::chrono::seconds answer_timeout{5};
/// Between two beats of the rig's thread, beside the time that a device is given.
constexpr std::chrono::seconds rig_turn_limit{15};
/// An axis that moves longer than its deadline is told to stop and given a while to obey.
constexpr std::chrono::seconds stop_allowance{15};

}  // namespace

Rig::Rig(std::vector<RigAxis> axes, std::vector<RigLamp> lamps, const Clock& clock, Heartbeat& heartbeat)
    : clock_(clock), pulse_(heartbeat.join("rig", rig_turn_limit)) {
  for (RigAxis& axis : axes) {
    AxisSlot slot;
    slot.status.dof = axis.options.dof;
    slot.setup = std::move(axis);
    axes_.push_back(std::move(slot));
  }
  for (RigLamp& lamp : lamps) {
    LampSlot slot;
    slot.status.name = lamp.options.name;
    slot.status.wanted_level = lamp.options.level;
    slot.setup = std::move(lamp);
    lamps_.push_back(std::move(slot));
  }
  thread_ = std::jthread([this](const std::stop_token& stop) { loop(stop); });
}

Rig::~Rig() {
  thread_.request_stop();
  stop_motion();
  wake_.notify_all();
  thread_.join();
}

void Rig::run(const std::function<void(Control&)>& work) {
  std::packaged_task<void()> task([this, &work] {
    Control control(*this);
    try {
      work(control);
    } catch (...) {
      stop_motion();
      throw;
    }
  });
  std::future<void> done = task.get_future();
  {
    const std::lock_guard lock(mutex_);
    if (thread_.get_stop_token().stop_requested()) throw Interrupted("eigenposed is stopping");
    work_.push_back(std::move(task));
  }
  wake_.notify_all();
  try {
    done.get();
  } catch (const std::future_error&) {
    throw Interrupted("eigenposed is stopping");
  }
}

void Rig::stop_motion() noexcept {
  const auto stop = [](AxisSlot& slot) {
    try {
      slot.axis->stop_motion();
    } catch (const std::exception& error) {
      spdlog::error("event=stop_failed axis={} error=\"{}\"", slot.status.dof.name, error.what());
    }
  };
  const std::lock_guard lock(axes_mutex_);
  std::vector<std::jthread> stopping;
  for (AxisSlot& slot : axes_) {
    if (!slot.axis) continue;
    try {
      stopping.emplace_back(stop, std::ref(slot));
    } catch (const std::exception&) {
      stop(slot);  // no thread is left: one after the other
    }
  }
}

RigStatus Rig::status() const {
  const std::lock_guard lock(mutex_);
  RigStatus result;
  for (const AxisSlot& slot : axes_) result.axes.push_back(slot.status);
  for (const LampSlot& slot : lamps_) result.lamps.push_back(slot.status);
  return result;
}

void Rig::loop(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    pulse_.beat();
    std::packaged_task<void()> task;
    {
      std::unique_lock lock(mutex_);
      if (work_.empty()) {
        lock.unlock();
        refresh_all();
        lock.lock();
        wake_.wait_for(lock, stop, refresh_period, [this] { return !work_.empty(); });
        continue;
      }
      task = std::move(work_.front());
      work_.pop_front();
    }
    task();
  }
  // Work that never got its turn ends with a broken promise, which `run` turns into Interrupted.
  const std::lock_guard lock(mutex_);
  work_.clear();
}

Rig::AxisSlot& Rig::slot(const std::string& name) {
  const auto found = std::find_if(axes_.begin(), axes_.end(),
                                  [&](const AxisSlot& slot) { return slot.status.dof.name == name; });
  if (found == axes_.end()) throw std::invalid_argument("there is no axis \"" + name + "\"");
  return *found;
}

Axis& Rig::open(AxisSlot& slot) {
  if (!slot.axis) {
    std::unique_ptr<Axis> axis = slot.setup.open();
    {
      const std::lock_guard lock(axes_mutex_);
      slot.axis = std::move(axis);
    }
    const std::lock_guard lock(mutex_);
    slot.status.model = slot.axis->info().model;
  }
  return *slot.axis;
}

void Rig::refresh_all() {
  for (AxisSlot& slot : axes_)
    if (slot.axis || clock_.now() >= slot.next_try) refresh(slot);
  for (LampSlot& slot : lamps_)
    if (clock_.now() >= slot.next_try) try_to_light(slot);
}

void Rig::refresh(AxisSlot& slot) {
  pulse_.beat(answer_timeout);
  try {
    note(slot, open(slot).state(clock_.now() + answer_timeout), std::nullopt);
  } catch (const std::exception& error) {
    note(slot, std::nullopt, error.what());
    slot.next_try = clock_.now() + reopen_pause;
    drop(slot);
  }
}

bool Rig::light(LampSlot& slot) {
  pulse_.beat(answer_timeout);
  slot.next_try = clock_.now() + reopen_pause;
  try {
    if (!slot.lamp) slot.lamp = slot.setup.open();
    slot.lamp->set_level(slot.setup.options.level, clock_.now() + answer_timeout);
    const std::uint64_t interruptions = slot.lamp->interruptions();
    const bool was_lit = slot.status.level.has_value();
    const bool kept = was_lit && interruptions == std::exchange(slot.interruptions, interruptions);
    if (was_lit && !kept)
      spdlog::warn("event=lamp_interrupted lamp={} interruptions={}", slot.status.name, interruptions);
    note(slot, slot.lamp->level(), std::nullopt);
    return kept;
  } catch (const std::exception& error) {
    note(slot, std::nullopt, error.what());
    slot.next_try = clock_.now() + reopen_pause;
    throw;
  }
}

void Rig::try_to_light(LampSlot& slot) {
  try {
    (void)light(slot);
  } catch (const std::exception&) {
    // It stands in the status, and is tried again later.
  }
}

void Rig::note(AxisSlot& slot, std::optional<AxisState> state, std::optional<std::string> error) {
  const std::string& name = slot.status.dof.name;
  if (error && slot.status.error != error)
    spdlog::error("event=axis_failed axis={} error=\"{}\"", name, *error);
  if (!error && !slot.status.state)
    spdlog::info("event=axis_ready axis={} position={}", name, state->position);
  const std::lock_guard lock(mutex_);
  slot.status.state = std::move(state);
  slot.status.error = std::move(error);
}

void Rig::note(LampSlot& slot, std::optional<double> level, std::optional<std::string> error) {
  const std::string& name = slot.status.name;
  if (error && slot.status.error != error)
    spdlog::error("event=lamp_failed lamp={} error=\"{}\"", name, *error);
  if (!error && !slot.status.level) spdlog::info("event=lamp_lit lamp={} level={}", name, *level);
  const std::lock_guard lock(mutex_);
  if (slot.lamp) slot.status.model = slot.lamp->info().model;
  slot.status.level = level;
  slot.status.error = std::move(error);
}

void Rig::drop(AxisSlot& slot) {
  std::unique_ptr<Axis> dropped;  // ends outside the lock: a device that is gone may keep it waiting
  const std::lock_guard lock(axes_mutex_);
  dropped.swap(slot.axis);
}

double ActuatorPosition::distance_from(double other) const {
  const double difference = *position - other;
  return std::abs(period > 0.0 ? std::remainder(difference, period) : difference);
}

double Rig::Control::move_to(const std::string& name, double position, const std::stop_token& stop) {
  AxisSlot& slot = rig_.slot(name);
  // A request that no axis could obey is no failure of this one: nothing is opened, homed or noted.
  check_target(name, slot.setup.options.dof, position);
  const RigAxisOptions& options = slot.setup.options;
  try {
    rig_.pulse_.beat(answer_timeout);
    Axis& axis = rig_.open(slot);
    AxisState state = axis.state(rig_.clock_.now() + answer_timeout);
    if (!state.homed) {
      spdlog::info("event=homing axis={}", name);
      state.moving = true;
      rig_.note(slot, state, std::nullopt);
      rig_.pulse_.beat(options.move_timeout + stop_allowance);
      axis.home(rig_.clock_.now() + options.move_timeout, stop);
    }
    if (stop.stop_requested()) throw Interrupted();
    state.moving = true;
    rig_.note(slot, state, std::nullopt);
    rig_.pulse_.beat(options.move_timeout + stop_allowance);
    state.position = axis.move_to(position, rig_.clock_.now() + options.move_timeout, stop);
    state.moving = false;
    state.homed = true;
    rig_.note(slot, state, std::nullopt);
    return state.position;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    rig_.note(slot, std::nullopt, error.what());
    throw;
  }
}

AxisState Rig::Control::state(const std::string& name) {
  AxisSlot& slot = rig_.slot(name);
  rig_.pulse_.beat(answer_timeout);
  try {
    AxisState state = rig_.open(slot).state(rig_.clock_.now() + answer_timeout);
    rig_.note(slot, state, std::nullopt);
    return state;
  } catch (const std::exception& error) {
    rig_.note(slot, std::nullopt, error.what());
    throw;
  }
}

double Rig::Control::arrival_tolerance(const std::string& axis) {
  return rig_.open(rig_.slot(axis)).info().arrival_tolerance;
}

Duration Rig::Control::settle_time(const std::string& axis) const {
  return rig_.slot(axis).setup.options.settle;
}

std::vector<std::string> Rig::Control::light_lamps() {
  std::vector<std::string> interrupted;
  for (LampSlot& slot : rig_.lamps_)
    if (!rig_.light(slot)) interrupted.push_back(slot.status.name);
  return interrupted;
}

std::vector<ActuatorPosition> Rig::Control::actuators() {
  std::vector<ActuatorPosition> result;
  for (const AxisSlot& slot : rig_.axes_) {
    const Dof& dof = slot.setup.options.dof;
    ActuatorPosition actuator{dof.name, dof.unit, std::nullopt, dof.periodic ? dof.period() : 0.0};
    try {
      if (const AxisState now = state(dof.name); now.homed) actuator.position = now.position;
      actuator.tolerance = arrival_tolerance(dof.name);
    } catch (const std::exception&) {
      // It has no position; whoever needs this axis learns why when it is moved.
    }
    result.push_back(std::move(actuator));
  }
  for (const LampSlot& slot : rig_.lamps_) result.push_back({slot.status.name, "level", slot.status.level});
  return result;
}

}  // namespace eigenpose
