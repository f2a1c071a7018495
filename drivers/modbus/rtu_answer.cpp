#include "drivers/modbus/rtu_answer.h"

#include <algorithm>

namespace eigenpose::rtu {

namespace {

constexpr std::uint8_t read_holding_registers = 0x03;
constexpr std::uint8_t exception_flag = 0x80;
constexpr std::size_t shortest = 5;      ///< unit, function, one byte, checksum: an exception
constexpr std::size_t confirmation = 8;  ///< unit, function, address, value or count, checksum

/// Bytes of the answer that begins so, as far as can be said: never more than it has.
std::size_t length_of(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 3 || (bytes[1] & exception_flag) != 0) return shortest;
  return bytes[1] == read_holding_registers ? shortest + bytes[2] : confirmation;
}

}  // namespace

std::uint16_t checksum(std::span<const std::uint8_t> bytes) {
  unsigned sum = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    sum ^= byte;
    for (int bit = 0; bit < 8; ++bit) sum = (sum & 1U) != 0 ? (sum >> 1U) ^ 0xA001U : sum >> 1U;
  }
  return static_cast<std::uint16_t>(sum);
}

std::vector<std::uint8_t> with_checksum(std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> frame(bytes.begin(), bytes.end());
  const std::uint16_t sum = checksum(bytes);
  frame.push_back(static_cast<std::uint8_t>(sum));
  frame.push_back(static_cast<std::uint8_t>(sum >> 8));
  return frame;
}

bool is_sound(std::span<const std::uint8_t> frame) {
  const std::uint16_t sum = checksum(frame.first(frame.size() - 2));
  return frame[frame.size() - 2] == (sum & 0xFFU) && frame[frame.size() - 1] == sum >> 8U;
}

Answer::Answer(std::span<const std::uint8_t> request, Echo echo)
    : request_(request.begin(), request.end()), echo_(echo), echo_expected_(echo != Echo::none) {
  judge();
}

void Answer::feed(std::span<const std::uint8_t> bytes) {
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  judge();
}

void Answer::judge() {
  if (echo_expected_) judge_echo();
  if (echo_expected_ || echo_is_damaged_) return;
  const std::size_t length = length_of(bytes_);
  missing_ = length > bytes_.size() ? length - bytes_.size() : 0;
}

void Answer::judge_echo() {
  const std::size_t common = std::min(bytes_.size(), request_.size());
  const auto end = bytes_.begin() + static_cast<std::ptrdiff_t>(common);
  const bool same = std::equal(bytes_.begin(), end, request_.begin());
  const std::size_t as_answer = length_of(bytes_);
  if (echo_ == Echo::unknown) {
    const bool is_answer = bytes_.size() == as_answer && bytes_.size() != request_.size() && is_sound(bytes_);
    if (!same || is_answer) {
      echo_ = Echo::none;
      echo_expected_ = false;
      return;
    }
  } else if (!same) {
    echo_is_damaged_ = true;
    missing_ = 0;
    return;
  }
  if (common == request_.size()) {
    echo_ = Echo::whole;
    echo_expected_ = false;
    bytes_.erase(bytes_.begin(), end);
    return;
  }
  // Not beyond what would be a whole answer by itself, while it may be one.
  const bool may_be_answer = echo_ == Echo::unknown && as_answer > bytes_.size();
  missing_ = (may_be_answer ? std::min(as_answer, request_.size()) : request_.size()) - bytes_.size();
}

}  // namespace eigenpose::rtu
