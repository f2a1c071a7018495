#pragma once

/// Thorlabs APT messages as bytes, after "Thorlabs Motion Controllers Host-Controller Communications
/// Protocol".
///
/// Every message has a header of 6 bytes, little-endian: number (2); then either two parameters or the length
/// of what follows (2); destination (1), whose bit 7 says that data follows; source (1).

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace eigenpose::apt {

/// Message numbers. Those marked → come from the controller.
enum class Message : std::uint16_t {
  hw_request_info = 0x0005,
  hw_info = 0x0006,  ///< →
  hw_stop_updates = 0x0012,
  hw_response = 0x0080,       ///< → an error, without words
  hw_rich_response = 0x0081,  ///< → an error, in words
  set_channel_enabled = 0x0210,
  set_velocity = 0x0413,
  move_home = 0x0443,
  move_homed = 0x0444,  ///< →
  move_absolute = 0x0453,
  move_completed = 0x0464,  ///< →
  move_stop = 0x0465,
  move_stopped = 0x0466,  ///< →
  request_stepper_status = 0x0480,
  stepper_status = 0x0481,  ///< →
  request_dc_status = 0x0490,
  dc_status = 0x0491,             ///< →
  acknowledge_dc_status = 0x0492  ///< "the host is alive"
};

constexpr std::uint8_t host = 0x01;
constexpr std::uint8_t generic_unit = 0x50;  ///< a controller of one channel on its own USB plug

/// Bits of the status word.
struct StatusBits {
  static constexpr std::uint32_t forward_limit = 0x00000001;
  static constexpr std::uint32_t reverse_limit = 0x00000002;
  static constexpr std::uint32_t moving = 0x000000F0;  ///< forward, reverse, jogging forward, jogging reverse
  static constexpr std::uint32_t homing = 0x00000200;
  static constexpr std::uint32_t homed = 0x00000400;
  static constexpr std::uint32_t motion_error = 0x00004000;  ///< the motor lags too far behind
  static constexpr std::uint32_t overcurrent = 0x01000000;
  static constexpr std::uint32_t enabled = 0x80000000;
};

struct Received {
  std::uint16_t number = 0;
  std::uint8_t parameter1 = 0;
  std::uint8_t parameter2 = 0;
  std::uint8_t source = 0;
  std::vector<std::uint8_t> data;
};

/// Position and status word, out of a status message.
struct Status {
  std::uint16_t channel = 0;
  std::int32_t position = 0;  ///< counts
  std::uint32_t bits = 0;
};

/// A message of the header alone.
std::vector<std::uint8_t> short_message(Message number, std::uint8_t parameter1, std::uint8_t parameter2,
                                        std::uint8_t destination);
/// @param fields in order, each as wide as its type says.
std::vector<std::uint8_t> move_absolute(std::uint16_t channel, std::int32_t counts, std::uint8_t destination);
std::vector<std::uint8_t> set_velocity(std::uint16_t channel, std::int32_t acceleration,
                                       std::int32_t velocity, std::uint8_t destination);

/// Empty when `message` is none of the status messages or has not their length.
std::optional<Status> status_of(const Received& message);
/// The words of a hw_response or hw_rich_response.
std::optional<std::string> fault_of(const Received& message);

/// Cuts a stream of bytes into messages. Lives on one thread.
class Unpacker {
 public:
  /// @param controller the address that messages must come from.
  explicit Unpacker(std::uint8_t controller) : controller_(controller) {}
  void feed(std::span<const std::uint8_t> bytes) {
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  }
  /// The next whole message, if there is one. @throws std::runtime_error when what stands there cannot be a
  /// message: the place in the stream is lost; `clear` and begin anew.
  std::optional<Received> next();
  /// No part of a message waits for its rest.
  [[nodiscard]] bool between_messages() const { return buffer_.empty(); }
  void clear() { buffer_.clear(); }

 private:
  std::uint8_t controller_;
  std::vector<std::uint8_t> buffer_;
};

}  // namespace eigenpose::apt
