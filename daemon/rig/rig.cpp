#include "daemon/rig/rig.h"

#include <algorithm>
#include <chrono>

#include <spdlog/spdlog.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

constexpr std::chrono::milliseconds refresh_period{500};
constexpr std::chrono::seconds reopen_pause{5};
/// For opening a device and its first answer. How often it is asked is the driver's own affair.
constexpr std::chrono::seconds answer_timeout{5};

}  // namespace

Rig::Rig(std::vector<RigAxis> axes, std::vector<RigLamp> lamps, const Clock& clock) : clock_(clock) {
  for (RigAxis& axis : axes) {
    AxisSlot slot;
    slot.status.dof = axis.options.dof;
    slot.setup = std::move(axis);
    axes_.push_back(std::move(slot));
  }
  for (RigLamp& lamp : lamps) lamps_.push_back({std::move(lamp), nullptr, {}, false});
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
  const std::lock_guard lock(axes_mutex_);
  for (AxisSlot& slot : axes_) {
    if (!slot.axis) continue;
    try {
      slot.axis->stop_motion();
    } catch (const std::exception& error) {
      spdlog::error("event=stop_failed axis={} error=\"{}\"", slot.status.dof.name, error.what());
    }
  }
}

std::vector<AxisStatus> Rig::status() const {
  const std::lock_guard lock(mutex_);
  std::vector<AxisStatus> result;
  for (const AxisSlot& slot : axes_) result.push_back(slot.status);
  return result;
}

void Rig::loop(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
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
  // Work that never got its turn ends with a broken promise, which `run` puts into words.
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
    if (!slot.lamp && clock_.now() >= slot.next_try) light(slot);
}

void Rig::refresh(AxisSlot& slot) {
  try {
    note(slot, open(slot).state(clock_.now() + answer_timeout), std::nullopt);
  } catch (const std::exception& error) {
    note(slot, std::nullopt, error.what());
    slot.next_try = clock_.now() + reopen_pause;
    drop(slot);
  }
}

void Rig::light(LampSlot& slot) {
  try {
    slot.lamp = slot.setup.open();
    slot.lamp->set_level(slot.setup.options.level, clock_.now() + answer_timeout);
    slot.complained = false;
    spdlog::info("event=lamp_lit lamp={} level={}", slot.setup.options.name, slot.setup.options.level);
  } catch (const std::exception& error) {
    slot.lamp.reset();
    slot.next_try = clock_.now() + reopen_pause;
    if (!slot.complained)
      spdlog::error("event=lamp_failed lamp={} error=\"{}\"", slot.setup.options.name, error.what());
    slot.complained = true;
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

void Rig::drop(AxisSlot& slot) {
  const std::lock_guard lock(axes_mutex_);
  slot.axis.reset();
}

void Rig::Control::move_to(const std::string& name, double position, const std::stop_token& stop) {
  AxisSlot& slot = rig_.slot(name);
  const RigAxisOptions& options = slot.setup.options;
  try {
    Axis& axis = rig_.open(slot);
    AxisState state = axis.state(rig_.clock_.now() + answer_timeout);
    if (!state.homed) {
      spdlog::info("event=homing axis={}", name);
      state.moving = true;
      rig_.note(slot, state, std::nullopt);
      axis.home(rig_.clock_.now() + options.move_timeout, stop);
    }
    if (stop.stop_requested()) throw Interrupted();
    state.moving = true;
    rig_.note(slot, state, std::nullopt);
    state.position = axis.move_to(position, rig_.clock_.now() + options.move_timeout, stop);
    state.moving = false;
    state.homed = true;
    rig_.note(slot, state, std::nullopt);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    rig_.note(slot, std::nullopt, error.what());
    throw;
  }
}

Duration Rig::Control::settle_time(const std::string& axis) const {
  return rig_.slot(axis).setup.options.settle;
}

}  // namespace eigenpose
