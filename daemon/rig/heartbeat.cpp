#include "daemon/rig/heartbeat.h"

#include <iterator>
#include <utility>

namespace eigenpose {

Heartbeat::Pulse Heartbeat::join(std::string name, Duration limit) {
  const std::lock_guard lock(mutex_);
  workers_.push_back({std::move(name), limit, clock_.now() + limit});
  return {*this, std::prev(workers_.end())};
}

std::vector<std::string> Heartbeat::overdue() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  const TimePoint now = clock_.now();
  for (const Worker& worker : workers_)
    if (worker.due && *worker.due < now) names.push_back(worker.name);
  return names;
}

Heartbeat::Pulse::Pulse(Pulse&& other) noexcept
    : registry_(std::exchange(other.registry_, nullptr)), worker_(other.worker_) {}

Heartbeat::Pulse& Heartbeat::Pulse::operator=(Pulse&& other) noexcept {
  std::swap(registry_, other.registry_);
  std::swap(worker_, other.worker_);
  return *this;
}

Heartbeat::Pulse::~Pulse() {
  if (registry_ == nullptr) return;
  const std::lock_guard lock(registry_->mutex_);
  registry_->workers_.erase(worker_);
}

void Heartbeat::Pulse::beat() {
  beat(Duration{0});
}

void Heartbeat::Pulse::beat(Duration allowance) {
  if (registry_ == nullptr) return;
  const std::lock_guard lock(registry_->mutex_);
  worker_->due = registry_->clock_.now() + allowance + worker_->limit;
}

void Heartbeat::Pulse::rest() {
  if (registry_ == nullptr) return;
  const std::lock_guard lock(registry_->mutex_);
  worker_->due.reset();
}

}  // namespace eigenpose
