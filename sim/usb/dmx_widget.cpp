#include "sim/usb/dmx_widget.h"

#include <algorithm>
#include <stdexcept>

namespace eigenpose::sim {
namespace {

constexpr std::uint8_t opening = 0x7E;
constexpr std::uint8_t closing = 0xE7;
constexpr std::size_t overhead = 5;  // opening, label, length (2), closing

void reply(std::vector<std::uint8_t>& out, std::uint8_t label, std::initializer_list<std::uint8_t> data) {
  out.insert(out.end(), {opening, label, static_cast<std::uint8_t>(data.size()), 0});
  out.insert(out.end(), data);
  out.push_back(closing);
}

}  // namespace

DmxWidget::DmxWidget(std::function<void(const std::array<std::uint8_t, 512>&)> on_frame)
    : on_frame_(std::move(on_frame)) {}

std::vector<std::uint8_t> DmxWidget::receive(std::span<const std::uint8_t> bytes) {
  const std::lock_guard lock(mutex_);
  heard_.insert(heard_.end(), bytes.begin(), bytes.end());
  std::vector<std::uint8_t> answer;
  for (;;) {
    heard_.erase(heard_.begin(), std::find(heard_.begin(), heard_.end(), opening));
    if (heard_.size() < overhead) break;
    const std::size_t length = heard_[2] + 256U * heard_[3];
    if (length > 600) {
      heard_.erase(heard_.begin());
      continue;
    }
    if (heard_.size() < length + overhead) break;
    if (heard_[length + overhead - 1] != closing) {
      heard_.erase(heard_.begin());
      continue;
    }
    obey(heard_[1], std::span(heard_).subspan(4, length), answer);
    heard_.erase(heard_.begin(), heard_.begin() + static_cast<std::ptrdiff_t>(length + overhead));
  }
  return answer;
}

void DmxWidget::obey(std::uint8_t label, std::span<const std::uint8_t> data,
                     std::vector<std::uint8_t>& answer) {
  switch (label) {
    case 3:  // firmware 1.44, break and mark after break in units of 10.67 µs, 40 frames a second
      reply(answer, label, {44, 1, 9, 1, 40});
      break;
    case 6:
      // 25 … 513 bytes, the start code 0 first.
      if (data.size() < 25 || data.size() > 513 || data[0] != 0) break;
      channels_.fill(0);
      std::copy(data.begin() + 1, data.end(), channels_.begin());
      ++frames_;
      if (on_frame_) on_frame_(channels_);
      break;
    case 10:  // serial number in binary coded decimal, least first
      reply(answer, label, {0x56, 0x34, 0x12, 0x00});
      break;
    default:
      break;
  }
}

std::uint8_t DmxWidget::channel(int channel) const {
  if (channel < 1 || channel > 512) throw std::out_of_range("a DMX channel is 1 … 512");
  const std::lock_guard lock(mutex_);
  return channels_[static_cast<std::size_t>(channel - 1)];
}

int DmxWidget::frames() const {
  const std::lock_guard lock(mutex_);
  return frames_;
}

}  // namespace eigenpose::sim
