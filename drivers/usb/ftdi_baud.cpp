#include "drivers/usb/ftdi_baud.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace eigenpose::ftdi {

BaudDivisor baud_divisor(int baud) {
  constexpr double clock_hz = 3e6;
  constexpr double largest_error = 0.03;
  // Eighths are coded in an order of their own; 1.0 and 1.5 have numbers of their own, and nothing lies
  // between.
  constexpr std::array<std::uint16_t, 8> eighths_code = {0, 3, 2, 4, 1, 5, 6, 7};
  const auto refuse = [&] {
    throw std::invalid_argument(fmt::format("baud rate {} cannot be made; 184 … 3000000 can", baud));
  };
  if (baud <= 0) refuse();
  const int eighths = static_cast<int>(std::lround(8.0 * clock_hz / baud));
  BaudDivisor divisor;
  if (eighths < 10) {
    divisor = {0, 0, clock_hz};
  } else if (eighths < 14) {
    divisor = {1, 0, clock_hz / 1.5};
  } else {
    const int steps = std::max(eighths, 16);
    if (steps >> 3 > 0x3FFF) refuse();
    const std::uint16_t code = eighths_code[static_cast<std::size_t>(steps & 7)];
    divisor = {static_cast<std::uint16_t>(steps >> 3 | (code & 3) << 14),
               static_cast<std::uint16_t>(code >> 2), 8.0 * clock_hz / steps};
  }
  if (std::abs(divisor.baud - baud) > largest_error * baud) refuse();
  return divisor;
}

}  // namespace eigenpose::ftdi
