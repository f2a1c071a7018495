#pragma once

/// The rig's axes and lamps, on the one thread they live on.

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "core/base/clock.h"
#include "core/base/workspace.h"
#include "drivers/axis.h"
#include "drivers/lamp.h"

namespace eigenpose {

/// What the rig needs to know of an axis, whatever its driver.
struct RigAxisOptions {
  Dof dof;                                           ///< name, unit, range, periodic
  Duration settle = std::chrono::milliseconds(200);  ///< vibration dies out after arrival
  Duration move_timeout = std::chrono::seconds(30);  ///< of one move, and of homing
};

/// An axis and how it is opened.
struct RigAxis {
  RigAxisOptions options;
  std::function<std::unique_ptr<Axis>()> open;
};

struct RigLampOptions {
  std::string name;
  double level = 1.0;  ///< 0…1, set when the lamp is opened
};

/// A lamp and how it is opened.
struct RigLamp {
  RigLampOptions options;
  std::function<std::unique_ptr<Lamp>()> open;
};

/// What a person may know about an axis now.
struct AxisStatus {
  Dof dof;
  std::string model;                 ///< empty until it was opened
  std::optional<AxisState> state;    ///< as last read
  std::optional<std::string> error;  ///< why there is none
};

/// Opens the devices, keeps them open, and runs work on them. A device that cannot be opened or is lost is
/// tried again later; work that needs it fails with the device's own error. Thread-safe.
class Rig {
 public:
  /// The clock must outlive the rig. The thread starts at once and opens what it can.
  Rig(std::vector<RigAxis> axes, std::vector<RigLamp> lamps, const Clock& clock);
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;
  /// Stops all motion, then ends the thread.
  ~Rig();

  /// What work may do with the axes; only within `run`.
  class Control {
   public:
    /// Moves the named axis and waits until it has arrived. Opens and homes it first if needed.
    /// @throws what Axis::move_to throws.
    void move_to(const std::string& axis, double position, const std::stop_token& stop);
    /// How long the named axis takes to come to rest after arrival.
    [[nodiscard]] Duration settle_time(const std::string& axis) const;

   private:
    friend class Rig;
    explicit Control(Rig& rig) : rig_(rig) {}
    Rig& rig_;
  };

  /// Runs `work` on the rig's thread and waits for it; work waits its turn. What it throws is thrown here.
  /// If it throws, all motion has been stopped as far as the devices can be reached.
  void run(const std::function<void(Control&)>& work);

  /// Tells every axis to stop now. A motion under way ends with Interrupted. Never throws: failures are
  /// logged.
  void stop_motion() noexcept;

  [[nodiscard]] std::vector<AxisStatus> status() const;

 private:
  struct AxisSlot {
    RigAxis setup;
    std::unique_ptr<Axis>
        axis;           ///< changed on the rig's thread under axes_mutex_; others touch it only under it
    AxisStatus status;  ///< guarded by mutex_
    TimePoint next_try{};
  };
  struct LampSlot {
    RigLamp setup;
    std::unique_ptr<Lamp> lamp;
    TimePoint next_try{};
    bool complained = false;
  };

  void loop(const std::stop_token& stop);
  AxisSlot& slot(const std::string& name);
  Axis& open(AxisSlot& slot);
  void refresh_all();
  void refresh(AxisSlot& slot);
  void light(LampSlot& slot);
  void note(AxisSlot& slot, std::optional<AxisState> state, std::optional<std::string> error);
  void drop(AxisSlot& slot);

  const Clock& clock_;
  std::mutex axes_mutex_;  ///< held while a device is told to stop: never take it on the API's thread
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  std::vector<AxisSlot> axes_;
  std::vector<LampSlot> lamps_;                  ///< touched on the rig's thread only
  std::deque<std::packaged_task<void()>> work_;  ///< guarded by mutex_
  std::jthread thread_;                          ///< last: ends before the rest goes
};

}  // namespace eigenpose
