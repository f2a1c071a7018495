#pragma once

/// Which workers still turn.
///
/// Every thread that must not hang joins and beats: each time it goes round its loop, and before each step
/// that may take long, with the time that step may take. The service's watchdog is fed only while no beat is
/// overdue.

#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/clock.h"

namespace eigenpose {

/// The registry of workers. Thread-safe; outlives every Pulse it has given.
class Heartbeat {
 private:
  struct Worker {
    std::string name;
    Duration limit{};              ///< between two beats, unless a beat allows more
    std::optional<TimePoint> due;  ///< of the next beat; none while it rests
  };

 public:
  /// The clock outlives the registry.
  explicit Heartbeat(const Clock& clock) : clock_(clock) {}
  Heartbeat(const Heartbeat&) = delete;
  Heartbeat& operator=(const Heartbeat&) = delete;

  /// One worker's place in the registry; it leaves with the object. One thread at a time.
  class Pulse {
   public:
    Pulse() = default;  ///< of nobody: beats are ignored
    Pulse(Pulse&& other) noexcept;
    Pulse& operator=(Pulse&& other) noexcept;
    ~Pulse();

    /// The worker turns; the next beat comes within its limit.
    void beat();
    /// The worker turns; what it does next takes at most `allowance`, and then its limit.
    void beat(Duration allowance);
    /// The worker waits for work, which may never come: nothing is expected until it beats again.
    void rest();

   private:
    friend class Heartbeat;
    Pulse(Heartbeat& registry, std::list<Worker>::iterator worker) : registry_(&registry), worker_(worker) {}
    Heartbeat* registry_ = nullptr;
    std::list<Worker>::iterator worker_;
  };

  /// Adds a worker, whose first beat is due within `limit`. Names need not differ.
  [[nodiscard]] Pulse join(std::string name, Duration limit);

  /// The workers whose beat is overdue, in the order they joined.
  [[nodiscard]] std::vector<std::string> overdue() const;

 private:
  const Clock& clock_;
  mutable std::mutex mutex_;
  std::list<Worker> workers_;  ///< guarded by mutex_
};

}  // namespace eigenpose
