#include "daemon/api/event_log.h"

#include <algorithm>
#include <utility>

namespace eigenpose {

EventLog::EventLog(std::size_t capacity) : capacity_(std::max<std::size_t>(1, capacity)) {}

std::uint64_t EventLog::publish(const std::function<std::string(std::uint64_t)>& make) {
  std::uint64_t sequence = 0;
  {
    const std::lock_guard lock(mutex_);
    auto data = std::make_shared<const std::string>(make(last_ + 1));
    sequence = ++last_;
    kept_.push_back(std::move(data));
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
  return Event{next, kept_[next - oldest], next - sequence - 1};
}

std::optional<EventLog::Event> EventLog::latest() const {
  const std::lock_guard lock(mutex_);
  if (kept_.empty()) return std::nullopt;
  return Event{last_, kept_.back(), 0};
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
