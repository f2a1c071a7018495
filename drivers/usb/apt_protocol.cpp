#include "drivers/usb/apt_protocol.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace eigenpose::apt {

namespace {

constexpr std::size_t header_length = 6;
constexpr std::uint8_t data_follows = 0x80;
constexpr std::size_t longest_data = 255;  ///< by the protocol
constexpr std::size_t status_length = 14;
constexpr std::size_t rich_response_length = 68;

std::uint16_t u16(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] | bytes[at + 1] << 8);
}

std::uint32_t u32(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint32_t>(u16(bytes, at)) | static_cast<std::uint32_t>(u16(bytes, at + 2)) << 16;
}

void put16(std::vector<std::uint8_t>& bytes, std::uint16_t value) {
  bytes.push_back(static_cast<std::uint8_t>(value));
  bytes.push_back(static_cast<std::uint8_t>(value >> 8));
}

void put32(std::vector<std::uint8_t>& bytes, std::int32_t value) {
  const auto raw = static_cast<std::uint32_t>(value);
  put16(bytes, static_cast<std::uint16_t>(raw));
  put16(bytes, static_cast<std::uint16_t>(raw >> 16));
}

std::vector<std::uint8_t> header(Message number, std::uint16_t length, std::uint8_t destination) {
  std::vector<std::uint8_t> bytes;
  put16(bytes, static_cast<std::uint16_t>(number));
  put16(bytes, length);
  bytes.push_back(destination | data_follows);
  bytes.push_back(host);
  return bytes;
}

}  // namespace

std::vector<std::uint8_t> short_message(Message number, std::uint8_t parameter1, std::uint8_t parameter2,
                                        std::uint8_t destination) {
  const auto raw = static_cast<std::uint16_t>(number);
  return {static_cast<std::uint8_t>(raw),
          static_cast<std::uint8_t>(raw >> 8),
          parameter1,
          parameter2,
          destination,
          host};
}

std::vector<std::uint8_t> move_absolute(std::uint16_t channel, std::int32_t counts,
                                        std::uint8_t destination) {
  auto bytes = header(Message::move_absolute, 6, destination);
  put16(bytes, channel);
  put32(bytes, counts);
  return bytes;
}

std::vector<std::uint8_t> set_velocity(std::uint16_t channel, std::int32_t acceleration,
                                       std::int32_t velocity, std::uint8_t destination) {
  auto bytes = header(Message::set_velocity, 14, destination);
  put16(bytes, channel);
  put32(bytes, 0);  // the velocity to start with; the protocol wants 0
  put32(bytes, acceleration);
  put32(bytes, velocity);
  return bytes;
}

std::optional<Status> status_of(const Received& message) {
  const auto number = static_cast<Message>(message.number);
  const bool is_status = number == Message::dc_status || number == Message::stepper_status;
  if (!is_status || message.data.size() != status_length) return {};
  // Between position and status word stand velocity and current, or an encoder count: not needed.
  return Status{u16(message.data, 0), static_cast<std::int32_t>(u32(message.data, 2)), u32(message.data, 10)};
}

std::optional<std::string> fault_of(const Received& message) {
  const auto number = static_cast<Message>(message.number);
  if (number == Message::hw_response) return "the controller reports a fault without words";
  if (number != Message::hw_rich_response || message.data.size() != rich_response_length) return {};
  const auto begin = message.data.begin() + 4;
  std::string words(begin, std::find(begin, message.data.end(), std::uint8_t{0}));
  return fmt::format("{} (code {})", words.empty() ? "fault" : words, u16(message.data, 2));
}

std::optional<Received> Unpacker::next() {
  if (buffer_.size() < header_length) return {};
  const std::uint8_t destination = buffer_[4];
  const std::size_t length = (destination & data_follows) != 0 ? u16(buffer_, 2) : 0;
  if ((destination & ~data_follows) != host || buffer_[5] != controller_ || length > longest_data)
    throw std::runtime_error(fmt::format("bytes that are no APT message: {:02x}",
                                         fmt::join(buffer_.begin(), buffer_.begin() + header_length, " ")));
  if (buffer_.size() < header_length + length) return {};
  Received message;
  message.number = u16(buffer_, 0);
  message.source = buffer_[5];
  if (length == 0) {
    message.parameter1 = buffer_[2];
    message.parameter2 = buffer_[3];
  }
  const auto data = buffer_.begin() + header_length;
  message.data.assign(data, data + static_cast<std::ptrdiff_t>(length));
  buffer_.erase(buffer_.begin(), data + static_cast<std::ptrdiff_t>(length));
  return message;
}

}  // namespace eigenpose::apt
