#include "drivers/usb/enttec_dmx_lamp.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/error.h"

namespace eigenpose {

namespace {

// "DMX USB Pro Widget API Specification 1.44": start, label, length (2, little-endian), data, end.
constexpr std::uint8_t start_of_message = 0x7E;
constexpr std::uint8_t end_of_message = 0xE7;
constexpr std::uint8_t label_get_parameters = 3;
constexpr std::uint8_t label_send_dmx = 6;
constexpr std::size_t longest_data = 600;
constexpr std::size_t smallest_parameters = 5;  ///< firmware (2), break, mark after break, rate

constexpr std::uint8_t dimmer_start_code = 0;
constexpr int last_channel = 512;
constexpr int fewest_channels = 24;  ///< shorter frames the widget does not send

std::vector<std::uint8_t> message(std::uint8_t label, const std::vector<std::uint8_t>& data) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(data.size() + 5);
  bytes.push_back(start_of_message);
  bytes.push_back(label);
  bytes.push_back(static_cast<std::uint8_t>(data.size()));
  bytes.push_back(static_cast<std::uint8_t>(data.size() >> 8));
  for (const std::uint8_t byte : data) bytes.push_back(byte);
  bytes.push_back(end_of_message);
  return bytes;
}

/// Takes the first whole message with `label` out of `bytes`; what cannot begin a message is skipped.
bool take_answer(std::deque<std::uint8_t>& bytes, std::uint8_t label, std::size_t smallest_data) {
  while (bytes.size() >= 5) {
    const std::size_t length = bytes[2] | static_cast<std::size_t>(bytes[3]) << 8;
    if (bytes[0] != start_of_message || length > longest_data) {
      bytes.pop_front();
      continue;
    }
    if (bytes.size() < length + 5) return false;
    if (bytes[length + 4] != end_of_message) {
      bytes.pop_front();
      continue;
    }
    const bool is_answer = bytes[1] == label && length >= smallest_data;
    bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length + 5));
    if (is_answer) return true;
  }
  return false;
}

}  // namespace

EnttecDmxWidget::EnttecDmxWidget(EnttecDmxWidgetOptions options, std::unique_ptr<ByteLink> link,
                                 const Clock& clock)
    : options_(options), clock_(clock), link_(std::move(link)) {
  if (!link_) throw std::invalid_argument("DMX USB Pro: no link");
  if (options_.attempts < 1 || options_.attempts > 10)
    throw std::invalid_argument(
        fmt::format("DMX USB Pro: attempts must be 1 … 10, got {}", options_.attempts));
}

EnttecDmxWidget::~EnttecDmxWidget() = default;

void EnttecDmxWidget::exchange(const std::string& lamp, const std::vector<std::uint8_t>& frame,
                               TimePoint deadline) {
  if (link_suspect_) {
    link_->reopen(std::min(deadline, clock_.now() + options_.response_timeout));
    ++interruptions_;
  }
  link_->discard_input();
  const TimePoint patience = std::min(deadline, clock_.now() + options_.response_timeout);
  link_->write(frame, patience);
  // The two bytes ask for no user configuration.
  link_->write(message(label_get_parameters, {0, 0}), patience);
  std::deque<std::uint8_t> received;
  std::array<std::uint8_t, 128> buffer{};
  while (!take_answer(received, label_get_parameters, smallest_parameters)) {
    // Bytes that keep coming are no answer either.
    const std::size_t count = clock_.now() < patience ? link_->read(buffer, patience) : 0;
    if (count == 0) throw DeviceTimeout(lamp, "set level", "no answer");
    received.insert(received.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(count));
  }
  link_suspect_ = false;
}

void EnttecDmxWidget::show(const std::string& lamp, const Values& values, TimePoint deadline) {
  const std::string operation = "set level";
  if (clock_.now() >= deadline) throw DeviceTimeout(lamp, operation, "no time left before the deadline");
  const std::lock_guard lock(mutex_);
  Values all = shown_;
  for (const auto& [channel, value] : values) all[channel] = value;
  const int count = std::max(fewest_channels, all.empty() ? 0 : all.rbegin()->first);
  std::vector<std::uint8_t> data(static_cast<std::size_t>(count) + 1, 0);
  data[0] = dimmer_start_code;
  for (const auto& [channel, value] : all) data[static_cast<std::size_t>(channel)] = value;
  const std::vector<std::uint8_t> frame = message(label_send_dmx, data);

  for (int attempt = 1;; ++attempt) {
    try {
      exchange(lamp, frame, deadline);
      shown_ = std::move(all);
      return;
    } catch (const DeviceError& failure) {
      link_suspect_ = true;
      if (attempt < options_.attempts && clock_.now() < deadline) continue;
      const std::string where = fmt::format("{} (tried {} times)", link_->description(), attempt);
      if (dynamic_cast<const DeviceLost*>(&failure) != nullptr)
        throw DeviceLost(lamp, operation, fmt::format("{}: {}", where, failure.what()));
      if (dynamic_cast<const DeviceTimeout*>(&failure) != nullptr)
        throw DeviceTimeout(lamp, operation, fmt::format("{}: no answer; is it a DMX USB Pro?", where));
      throw DeviceError(lamp, operation, fmt::format("{}: {}", where, failure.what()));
    }
  }
}

std::uint64_t EnttecDmxWidget::interruptions() const {
  const std::lock_guard lock(mutex_);
  return interruptions_;
}

EnttecDmxLamp::EnttecDmxLamp(EnttecDmxLampOptions options, std::shared_ptr<EnttecDmxWidget> widget,
                             const Clock& clock)
    : options_(std::move(options)),
      widget_(std::move(widget)),
      clock_(clock),
      info_{options_.name, "Enttec DMX USB Pro"} {
  if (!widget_) throw std::invalid_argument("lamp " + options_.name + ": no widget");
  if (options_.channels.empty()) throw std::invalid_argument("lamp " + options_.name + ": no DMX channel");
  for (const DmxChannel& channel : options_.channels) {
    if (channel.number < 1 || channel.number > last_channel)
      throw std::invalid_argument(fmt::format("lamp {}: DMX channel must be 1 … {}, got {}", options_.name,
                                              last_channel, channel.number));
    if (!(channel.share >= 0.0 && channel.share <= 1.0))
      throw std::invalid_argument(
          fmt::format("lamp {}: share {} is outside 0 … 1", options_.name, channel.share));
  }
}

EnttecDmxLamp::~EnttecDmxLamp() {
  if (!may_be_lit_) return;
  try {
    show(0.0, clock_.now() + std::chrono::seconds(2));
  } catch (const std::exception&) {
    // Nobody is left to report to.
  }
}

void EnttecDmxLamp::show(double level, TimePoint deadline) {
  EnttecDmxWidget::Values values;
  for (const DmxChannel& channel : options_.channels)
    values[channel.number] = static_cast<std::uint8_t>(std::lround(255.0 * level * channel.share));
  if (clock_.now() < deadline) may_be_lit_ = true;
  widget_->show(options_.name, values, deadline);
  may_be_lit_ = level > 0.0;
}

void EnttecDmxLamp::set_level(double level, TimePoint deadline) {
  if (!(level >= 0.0 && level <= 1.0))
    throw std::out_of_range(fmt::format("{}: level {} is outside 0 … 1", options_.name, level));
  show(level, deadline);
  level_ = level;
}

}  // namespace eigenpose
