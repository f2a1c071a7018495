// What of the FTDI link needs no chip. The rest runs on emulated chips.

#include "drivers/usb/ftdi_link.h"

#include <chrono>
#include <stdexcept>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "drivers/usb/ftdi_baud.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;

TEST(FtdiBaud, CommonRatesHaveTheChipsKnownNumbers) {
  // FTDI application note AN_120, and what the kernel's driver sends.
  struct Known {
    int baud;
    std::uint16_t value;
    std::uint16_t index;
  };
  for (const Known& known :
       {Known{9600, 0x4138, 0}, Known{19200, 0x809C, 0}, Known{38400, 0xC04E, 0}, Known{57600, 0xC034, 0},
        Known{115200, 0x001A, 0}, Known{230400, 0x000D, 0}, Known{250000, 0x000C, 0},
        Known{1'000'000, 0x0003, 0}, Known{2'000'000, 0x0001, 0}, Known{3'000'000, 0x0000, 0}}) {
    const ftdi::BaudDivisor divisor = ftdi::baud_divisor(known.baud);
    EXPECT_EQ(divisor.value, known.value) << known.baud;
    EXPECT_EQ(divisor.index, known.index) << known.baud;
    EXPECT_NEAR(divisor.baud / known.baud, 1.0, 0.03) << known.baud;
  }
}

TEST(FtdiBaud, RatesThatCannotBeMadeAreRefused) {
  for (const int baud : {0, -9600, 100, 5'000'000, 2'500'000})
    EXPECT_THROW((void)ftdi::baud_divisor(baud), std::invalid_argument) << baud;
}

TEST(FtdiLink, ImpossibleOptionsAreRefused) {
  SteadyClock clock;
  EXPECT_THROW(FtdiLink({.interface = 4}, clock), std::invalid_argument);
  EXPECT_THROW(FtdiLink({.parity = 'X'}, clock), std::invalid_argument);
  EXPECT_THROW(FtdiLink({.stop_bits = 3}, clock), std::invalid_argument);
  EXPECT_THROW(FtdiLink({.latency = 0ms}, clock), std::invalid_argument);
  EXPECT_THROW(FtdiLink({.baud = 7}, clock), std::invalid_argument);
}

TEST(FtdiLink, ADeviceThatIsNotPluggedInIsNamed) {
  SteadyClock clock;
  FtdiLink link({.serial = "NO-SUCH-CHIP"}, clock);
  const std::vector<std::uint8_t> byte = {1};
  // A machine without USB says so instead; both are failures of the device, with its name or USB's.
  EXPECT_THROW(link.write(byte, clock.now() + 1s), DeviceError);
  EXPECT_THROW(link.reopen(clock.now()), DeviceError);
  EXPECT_NE(link.description().find("NO-SUCH-CHIP"), std::string::npos);
}

}  // namespace
}  // namespace eigenpose
