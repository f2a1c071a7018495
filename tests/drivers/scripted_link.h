#pragma once

/// A byte link whose far end is the test itself.

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/base/clock.h"
#include "drivers/usb/byte_link.h"

namespace eigenpose::test {

class ScriptedLink final : public ByteLink {
 public:
  explicit ScriptedLink(const Clock& clock) : clock_(clock) {}

  /// What the driver reads next.
  void say(std::span<const std::uint8_t> bytes) { input_.insert(input_.end(), bytes.begin(), bytes.end()); }

  void write(std::span<const std::uint8_t> bytes, TimePoint) override {
    if (on_write) on_write(bytes);
  }
  std::size_t read(std::span<std::uint8_t> buffer, TimePoint deadline) override {
    while (!flood.empty() && input_.size() < buffer.size()) say(flood);
    if (input_.empty()) clock_.sleep_until(deadline, {});
    const std::size_t count = std::min(buffer.size(), input_.size());
    const auto end = input_.begin() + static_cast<std::ptrdiff_t>(count);
    std::copy(input_.begin(), end, buffer.begin());
    input_.erase(input_.begin(), end);
    return count;
  }
  void discard_input() override { input_.clear(); }
  void reopen(TimePoint) override { ++reopenings; }
  [[nodiscard]] const std::string& description() const override { return name_; }

  std::function<void(std::span<const std::uint8_t>)> on_write;  ///< hears each message
  std::vector<std::uint8_t> flood;                              ///< sent again and again when not empty
  int reopenings = 0;

 private:
  const Clock& clock_;
  std::deque<std::uint8_t> input_;
  std::string name_ = "scripted link";
};

}  // namespace eigenpose::test
