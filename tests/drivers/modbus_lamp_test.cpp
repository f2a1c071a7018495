// The Modbus lamp on a simulated line. A spare register of the simulated drive stands for the dimmer's.

#include "drivers/modbus/modbus_lamp.h"

#include <array>
#include <chrono>
#include <memory>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "sim/lab/sim_lab.h"
#include "sim/modbus/modbus_server.h"
#include "tests/drivers/lamp_conformance.h"
#include "tests/drivers/modbus_rig.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;

constexpr std::uint16_t dimmer = 0x0068;
constexpr std::int64_t full = 1000;

ModbusLampProfile profile() {
  ModbusLampProfile result;
  result.model = "Test dimmer";
  result.full = full;
  result.set_level = {{dimmer, {{RegisterMeaning::level, 0, 32}}}};
  return result;
}

class ModbusLampRig final : public LampRig {
 public:
  explicit ModbusLampRig(double fault_rate) : fault_rate_(fault_rate), lab_(clock_), server_(lab_, {}) {
    ModbusBusOptions bus;
    bus.endpoint = ModbusTcpEndpoint{"127.0.0.1", server_.port()};
    bus.response_timeout = 40ms;
    bus.retry_pause = 5ms;
    bus.attempts = 8;
    lamp_ = std::make_unique<ModbusLamp>(profile(), ModbusLampOptions{},
                                         std::make_shared<ModbusBus>(bus, clock_), clock_);
    silence(false);
  }
  ~ModbusLampRig() override { server_.faults().clear(); }
  Lamp& lamp() override { return *lamp_; }
  void discard_lamp() override { lamp_.reset(); }
  double truth() override {
    std::array<std::uint16_t, 2> registers{};
    server_.drive(1).read(dimmer, registers);
    return static_cast<double>(registers[0] * 65536 + registers[1]) / full;
  }
  void silence(bool silent) override {
    server_.faults().clear();
    if (silent)
      server_.faults().at_random(1.0, 5, {{sim::WireFaultKind::loss}});
    else if (fault_rate_ > 0.0)
      server_.faults().at_random(fault_rate_, 5, survivable_faults(ModbusLine::tcp));
  }
  void unplug() override { server_.die(); }
  void plug_in() override { server_.revive(); }

 private:
  const double fault_rate_;
  SteadyClock clock_;
  sim::SimLab lab_;
  sim::SimModbusServer server_;
  std::unique_ptr<ModbusLamp> lamp_;
};

INSTANTIATE_TEST_SUITE_P(
    Modbus, LampConformance,
    testing::Values(LampRigCase{"Tcp", [] { return std::make_unique<ModbusLampRig>(0.0); }},
                    LampRigCase{"TcpWithFaults", [] { return std::make_unique<ModbusLampRig>(0.2); }}),
    lamp_rig_name);

TEST(ModbusLampCheck, AProfileThatWritesNoLevelIsRefused) {
  SteadyClock clock;
  const auto bus = std::make_shared<ModbusBus>(ModbusBusOptions{ModbusTcpEndpoint{"127.0.0.1", 1}}, clock);
  ModbusLampProfile dark = profile();
  dark.set_level = {{dimmer, {{RegisterMeaning::constant, 7, 16}}}};
  EXPECT_THROW(ModbusLamp(dark, {}, bus, clock), std::invalid_argument);
  EXPECT_THROW(ModbusLamp(profile(), {}, nullptr, clock), std::invalid_argument);
  EXPECT_THROW(ModbusLamp(profile(), {.unit = 0}, bus, clock), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
