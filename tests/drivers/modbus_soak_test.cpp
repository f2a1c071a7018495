// Ten thousand transactions on a line that damages one request in twenty at random.

#include <chrono>
#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "tests/drivers/modbus_rig.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;
using sim::WireFault;
using sim::WireFaultKind;

constexpr auto response_timeout = 12ms;
constexpr double one_in_twenty = 0.05;
constexpr double one_step_deg = 0.01;

/// On a serial line a transaction takes some milliseconds; so fewer by default. EIGENPOSE_SOAK sets the
/// number.
std::uint64_t transactions_for(ModbusLine line) {
  if (const char* number = std::getenv("EIGENPOSE_SOAK")) return std::stoull(number);
  return line == ModbusLine::tcp ? 10'000 : 1'000;
}

class ModbusSoak : public testing::TestWithParam<ModbusLine> {};

/// The table turns steadily all the while, so that an answer that belongs to an earlier question shows a
/// wrong position.
TEST_P(ModbusSoak, NoWrongPositionIsEverReportedAndEveryFailureHasACause) {
  const std::uint64_t transactions = transactions_for(GetParam());
  ModbusRig rig(GetParam(), 0.0, response_timeout);
  SteadyClock clock;
  rig.axis().home(clock.now() + 10s, {});
  rig.turn_steadily(360.0);

  std::vector<WireFault> faults = survivable_faults(GetParam(), response_timeout);
  faults.push_back({WireFaultKind::exception, {}, 4});  // a refusal, which is not asked for again
  rig.faults().at_random(one_in_twenty, 2024, faults);

  std::uint64_t positions = 0;
  std::uint64_t failures = 0;
  const auto done = [&] {
    const ModbusBusStatistics statistics = rig.bus()->statistics();
    return statistics.transactions + statistics.failures;
  };
  const std::uint64_t start = done();
  while (done() - start < transactions) {
    const double before = rig.unwrapped_position();
    try {
      const double reported = rig.axis().state(clock.now() + 2s).position;
      const double after = rig.unwrapped_position();
      // The true position at some time during the call, on the turn it was on.
      const double unwrapped = before + wrap(reported - (before - one_step_deg), 0.0, 360.0) - one_step_deg;
      ASSERT_LE(unwrapped, after + one_step_deg)
          << "reported " << reported << " while the table went from " << before << " to " << after;
      ++positions;
    } catch (const DeviceError& error) {
      ++failures;
      ASSERT_GT(std::string(error.what()).size(), error.device().size() + error.operation().size() + 8)
          << error.what();
    }
  }
  EXPECT_GT(positions, transactions / 3);
  EXPECT_GT(rig.faults().count(), transactions / 40);
  RecordProperty("positions", static_cast<int>(positions));
  RecordProperty("failed_calls", static_cast<int>(failures));
  RecordProperty("faults", static_cast<int>(rig.faults().count()));
  rig.faults().clear();
}

INSTANTIATE_TEST_SUITE_P(Lines, ModbusSoak, testing::Values(ModbusLine::tcp, ModbusLine::rtu),
                         [](const auto& test) { return test.param == ModbusLine::tcp ? "Tcp" : "Rtu"; });

}  // namespace
}  // namespace eigenpose
