// The Modbus lamp on a simulated line. A spare register of the simulated drive stands for the dimmer's.

#include "drivers/modbus/modbus_lamp.h"

#include <array>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

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
  explicit ModbusLampRig(double fault_rate, const ModbusLampProfile& lamp_profile = profile())
      : fault_rate_(fault_rate), lab_(clock_), server_(lab_, {}) {
    ModbusBusOptions bus;
    bus.endpoint = ModbusTcpEndpoint{"127.0.0.1", server_.port()};
    bus.response_timeout = 40ms;
    bus.retry_pause = 5ms;
    bus.attempts = 8;
    lamp_ = std::make_unique<ModbusLamp>(lamp_profile, ModbusLampOptions{},
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
  void plug_in() override {
    for (;;) {
      try {
        server_.revive();
        return;
      } catch (const Error&) {
        std::this_thread::yield();  // its thread is about to let go of the port
      }
    }
  }

  sim::SimModbusServer& server() { return server_; }
  /// What a dimmer shows after its power came back, and nobody closed the gateway's connection.
  void lose_level() {
    const std::array<std::uint16_t, 2> registers{};
    ASSERT_EQ(server_.drive(1).write(dimmer, registers), sim::ModbusException::none);
  }

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

TimePoint soon() {
  return std::chrono::steady_clock::now() + 20s;
}

TEST(ModbusLamp, HoldsItsLevelUninterruptedAsLongAsNothingHappens) {
  ModbusLampRig rig(0.0);
  for (const double level : {0.5, 0.5, 0.0, 1.0}) rig.lamp().set_level(level, soon());
  EXPECT_EQ(rig.lamp().interruptions(), 0U);
}

TEST(ModbusLamp, CountsADimmerThatHasLostItsLevelBehindAConnectionThatStood) {
  ModbusLampRig rig(0.0);
  rig.lamp().set_level(0.5, soon());
  for (std::uint64_t times = 1; times <= 2; ++times) {
    rig.lose_level();
    rig.lamp().set_level(0.5, soon());
    EXPECT_EQ(rig.lamp().interruptions(), times);
    EXPECT_EQ(rig.truth(), 0.5);
  }
}

TEST(ModbusLamp, ALevelThatTheDimmerDoesNotTakeIsNotCalledSet) {
  // The second write sets the level back, as another master would.
  ModbusLampProfile contested = profile();
  contested.set_level.push_back({dimmer, {{RegisterMeaning::constant, 700, 32}}});
  ModbusLampRig other(0.0, contested);
  EXPECT_NO_THROW(other.lamp().set_level(0.7, soon())) << "700 of 1000: it shows what was set";
  try {
    other.lamp().set_level(0.2, soon());
    FAIL() << "it shows 700 of 1000";
  } catch (const DeviceError& error) {
    EXPECT_NE(std::string(error.what()).find("set to 200 of 1000 and shows 700"), std::string::npos)
        << error.what();
  }
  EXPECT_EQ(other.lamp().level(), 0.7);
}

TEST(ModbusLamp, ADimmerThatCannotBeReadIsLitAllTheSame) {
  // What is read there after each write is another number.
  ModbusLampProfile write_only = profile();
  write_only.set_level.push_back({dimmer, {{RegisterMeaning::constant, 1, 32}}});
  ModbusLampRig rig(0.0, write_only);
  for (int i = 0; i < 3; ++i) EXPECT_NO_THROW(rig.lamp().set_level(0.5, soon()));
  EXPECT_EQ(rig.lamp().interruptions(), 0U) << "a register that shows something else says nothing";
  rig.unplug();
  rig.plug_in();
  rig.lamp().set_level(0.5, soon());
  EXPECT_EQ(rig.lamp().interruptions(), 1U) << "its connection does";
}

TEST(ModbusLamp, IsSetUpOnEachConnectionBeforeItIsLit) {
  constexpr std::uint16_t mode = 0x0066;
  ModbusLampProfile with_mode = profile();
  with_mode.connect = {{mode, {{RegisterMeaning::constant, 7, 32}}}};
  ModbusLampRig rig(0.0, with_mode);
  rig.lamp().set_level(0.5, soon());
  const std::array<std::uint16_t, 2> forgotten{};
  ASSERT_EQ(rig.server().drive(1).write(mode, forgotten), sim::ModbusException::none);
  rig.unplug();
  rig.plug_in();
  rig.lamp().set_level(0.5, soon());
  std::array<std::uint16_t, 2> registers{};
  rig.server().drive(1).read(mode, registers);
  EXPECT_EQ(registers[1], 7) << "within the call that has connected anew";
}

TEST(ModbusLampCheck, AProfileThatWritesNoLevelIsRefused) {
  SteadyClock clock;
  const auto bus = std::make_shared<ModbusBus>(ModbusBusOptions{ModbusTcpEndpoint{"127.0.0.1", 1}}, clock);
  ModbusLampProfile dark = profile();
  dark.set_level = {{dimmer, {{RegisterMeaning::constant, 7, 16}}}};
  EXPECT_THROW(ModbusLamp(dark, {}, bus, clock), std::invalid_argument);
  ModbusLampProfile narrow = profile();
  narrow.full = 65536;
  EXPECT_NO_THROW(ModbusLamp(narrow, {}, bus, clock));
  narrow.set_level = {{dimmer, {{RegisterMeaning::level, 0, 16}}}};
  EXPECT_THROW(ModbusLamp(narrow, {}, bus, clock), std::invalid_argument) << "full does not fit";
  narrow.full = 65535;
  EXPECT_NO_THROW(ModbusLamp(narrow, {}, bus, clock));
  EXPECT_THROW(ModbusLamp(profile(), {}, nullptr, clock), std::invalid_argument);
  EXPECT_THROW(ModbusLamp(profile(), {.unit = 0}, bus, clock), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
