#include "daemon/api/event_log.h"

#include <algorithm>
#include <random>
#include <utility>

#include <fmt/format.h>

namespace eigenpose {
namespace {

std::string new_run() {
  std::random_device random;
  return fmt::format("{:08x}", static_cast<std::uint32_t>(random()));
}

}  // namespace

EventLog::EventLog(std::size_t capacity) : capacity_(std::max<std::size_t>(1, capacity)), run_(new_run()) {}

std::uint64_t EventLog::publish(std::string_view name,
                                const std::function<std::string(std::uint64_t)>& make) {
  std::uint64_t sequence = 0;
  {
    const std::lock_guard lock(mutex_);
    auto data = std::make_shared<const std::string>(make(last_ + 1));
    sequence = ++last_;
    kept_.push_back({sequence, name, std::move(data), 0});
    latest_[name] = kept_.back();
    if (kept_.size() > capacity_) kept_.pop_front();
  }
  const std::lock_guard lock(listener_mutex_);
  for (const auto& [id, listener] : listeners_) listener();
  return sequence;
}

std::optional<EventLog::Event> EventLog::after(std::uint64_t sequence) const {
  const std::lock_guard lock(mutex_);
  if (sequence > last_) sequence = 0;
  if (sequence == last_) return std::nullopt;
  const std::uint64_t oldest = last_ - kept_.size() + 1;
  const std::uint64_t next = std::max(sequence + 1, oldest);
  Event event = kept_[next - oldest];
  event.lost = next - sequence - 1;
  return event;
}

std::optional<EventLog::Event> EventLog::latest(std::string_view name) const {
  const std::lock_guard lock(mutex_);
  const auto found = latest_.find(name);
  if (found == latest_.end()) return std::nullopt;
  return found->second;
}

std::uint64_t EventLog::last_sequence() const {
  const std::lock_guard lock(mutex_);
  return last_;
}

EventLog::Subscription EventLog::subscribe(std::function<void()> listener) {
  const std::lock_guard lock(listener_mutex_);
  const std::uint64_t id = next_listener_++;
  listeners_.emplace(id, std::move(listener));
  return {*this, id};
}

EventLog::Subscription::Subscription(Subscription&& other) noexcept
    : log_(std::exchange(other.log_, nullptr)), id_(other.id_) {}

EventLog::Subscription& EventLog::Subscription::operator=(Subscription&& other) noexcept {
  std::swap(log_, other.log_);
  std::swap(id_, other.id_);
  return *this;
}

EventLog::Subscription::~Subscription() {
  if (log_ == nullptr) return;
  const std::lock_guard lock(log_->listener_mutex_);
  log_->listeners_.erase(id_);
}

}  // namespace eigenpose
