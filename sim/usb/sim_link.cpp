#include "sim/usb/sim_link.h"

#include <algorithm>

#include "core/base/error.h"

namespace eigenpose::sim {
namespace {

constexpr Duration look_again = std::chrono::milliseconds(1);

}  // namespace

Cable::Cable(ByteDevice& device, const Clock& clock, std::uint64_t seed)
    : device_(device), clock_(clock), chance_(seed) {}

void Cable::unplug() {
  const std::lock_guard lock(mutex_);
  plugged_in_ = false;
  to_host_.clear();
}

void Cable::plug_in() {
  const std::lock_guard lock(mutex_);
  if (plugged_in_) return;
  plugged_in_ = true;
  ++openings_;  // whoever held the old one has lost it
}

bool Cable::plugged_in() const {
  const std::lock_guard lock(mutex_);
  return plugged_in_;
}

void Cable::silence(bool silent) {
  const std::lock_guard lock(mutex_);
  silent_ = silent;
}

void Cable::set_faults(const CableFaults& faults) {
  const std::lock_guard lock(mutex_);
  faults_ = faults;
}

int Cable::openings() const {
  const std::lock_guard lock(mutex_);
  return openings_;
}

bool Cable::open() {
  const std::lock_guard lock(mutex_);
  if (!plugged_in_) return false;
  ++openings_;
  to_host_.clear();
  return true;
}

bool Cable::send(std::span<const std::uint8_t> bytes, int opening) {
  const std::lock_guard lock(mutex_);
  if (!plugged_in_ || opening != openings_) return false;
  if (silent_ || chance_.uniform() < faults_.lost_from_host) return true;
  carry_to_host(device_.receive(bytes));
  return true;
}

void Cable::carry_to_host(std::vector<std::uint8_t> bytes) {
  if (bytes.empty() || silent_ || chance_.uniform() < faults_.lost_to_host) return;
  if (chance_.uniform() < faults_.cut_to_host) bytes.resize(bytes.size() / 2);
  if (!bytes.empty() && chance_.uniform() < faults_.damaged_to_host)
    bytes[chance_.next() % bytes.size()] ^= static_cast<std::uint8_t>(1U << chance_.next() % 8);
  TimePoint due = clock_.now();
  if (chance_.uniform() < faults_.delayed_to_host) due += faults_.delay;
  if (!to_host_.empty()) due = std::max(due, to_host_.back().due);  // bytes do not overtake each other
  to_host_.push_back({due, std::move(bytes)});
}

std::optional<std::size_t> Cable::take(std::span<std::uint8_t> buffer, int opening) {
  const std::lock_guard lock(mutex_);
  if (!plugged_in_ || opening != openings_) return {};
  carry_to_host(device_.spontaneous());
  std::size_t count = 0;
  const TimePoint now = clock_.now();
  while (count < buffer.size() && !to_host_.empty() && to_host_.front().due <= now) {
    auto& bytes = to_host_.front().bytes;
    const std::size_t piece = std::min(buffer.size() - count, bytes.size());
    std::copy_n(bytes.begin(), piece, buffer.begin() + static_cast<std::ptrdiff_t>(count));
    bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(piece));
    if (bytes.empty()) to_host_.pop_front();
    count += piece;
  }
  return count;
}

void Cable::discard() {
  const std::lock_guard lock(mutex_);
  to_host_.clear();
}

SimLink::SimLink(Cable& cable, const Clock& clock, std::string name)
    : cable_(cable), clock_(clock), name_(std::move(name)) {}

void SimLink::lost(const std::string& operation) const {
  throw DeviceLost(name_, operation, "unplugged");
}

void SimLink::write(std::span<const std::uint8_t> bytes, TimePoint) {
  if (opening_ == 0) reopen(clock_.now());
  if (!cable_.send(bytes, opening_)) lost("write");
}

std::size_t SimLink::read(std::span<std::uint8_t> buffer, TimePoint deadline) {
  if (opening_ == 0) reopen(clock_.now());
  for (;;) {
    const auto count = cable_.take(buffer, opening_);
    if (!count) lost("read");
    if (*count > 0) return *count;
    const TimePoint now = clock_.now();
    if (now >= deadline) return 0;
    clock_.sleep_until(std::min(deadline, now + look_again), {});
  }
}

void SimLink::discard_input() {
  if (opening_ == 0) reopen(clock_.now());
  cable_.discard();
}

void SimLink::reopen(TimePoint deadline) {
  while (!cable_.open()) {
    if (clock_.now() >= deadline) lost("open");
    clock_.sleep_until(std::min(deadline, clock_.now() + look_again), {});
  }
  opening_ = cable_.openings();
}

}  // namespace eigenpose::sim
