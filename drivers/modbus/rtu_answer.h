#pragma once

/// The answer to one request on a serial line, collected byte by byte.
/// "MODBUS over Serial Line Specification and Implementation Guide V1.02", 2.5.1.
///
/// Many RS-485 adapters hear themselves: what is sent comes in again, before the answer. Such an echo is
/// recognised by its bytes and left out. Only the answer to writing a single register (function 06) equals
/// its request; whether the line echoes has to be known before that.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace eigenpose::rtu {

enum class Echo { unknown, none, whole };

/// Polynomial 0xA001, start 0xFFFF; sent low byte first.
std::uint16_t checksum(std::span<const std::uint8_t> bytes);

/// `bytes` with their checksum behind.
std::vector<std::uint8_t> with_checksum(std::span<const std::uint8_t> bytes);

/// Lives on one thread.
class Answer {
 public:
  /// @param request the whole frame that was sent, its checksum included.
  /// @pre not both an unknown echo and function 06.
  Answer(std::span<const std::uint8_t> request, Echo echo);

  /// How many bytes to read next; never beyond the end of the answer. 0 when the answer is whole.
  [[nodiscard]] std::size_t missing() const { return missing_; }
  void feed(std::span<const std::uint8_t> bytes);

  /// What the bytes have said of the line.
  [[nodiscard]] Echo echo() const { return echo_; }
  /// The line echoes, and what came back is not what was sent.
  [[nodiscard]] bool echo_is_damaged() const { return echo_is_damaged_; }
  /// Unit, function, data and checksum. @pre missing() == 0.
  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return bytes_; }

 private:
  void judge();
  void judge_echo();

  std::vector<std::uint8_t> request_;
  std::vector<std::uint8_t> bytes_;
  std::size_t missing_ = 0;
  Echo echo_;
  bool echo_expected_;  ///< the echo has not come in yet
  bool echo_is_damaged_ = false;
};

/// The checksum behind `frame` is that of the bytes before. @pre at least 3 bytes.
bool is_sound(std::span<const std::uint8_t> frame);

}  // namespace eigenpose::rtu
