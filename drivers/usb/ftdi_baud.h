#pragma once

/// What an FTDI chip makes of a baud rate.

#include <cstdint>

namespace eigenpose::ftdi {

/// The chip's number for a baud rate: `value` and the low bit of `index` of request 3.
struct BaudDivisor {
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  double baud = 0.0;  ///< what it comes to
};

/// FT232B, FT232R, FT-X, and the H chips in the same mode: 3 MHz divided by a number with eighths (FTDI
/// application note AN_120). @throws std::invalid_argument when nothing within 3 % exists.
BaudDivisor baud_divisor(int baud);

}  // namespace eigenpose::ftdi
