// Independent peers: our driver against a server made with pymodbus, and our simulated drives read by mbpoll.
// Each says what it missed where the peer is not installed.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/modbus_profile.h"
#include "core/base/error.h"
#include "drivers/modbus/modbus_axis.h"
#include "sim/lab/sim_lab.h"
#include "sim/modbus/modbus_server.h"
#include "sim/modbus/rtu_server.h"
#include "tests/drivers/child_process.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

const std::filesystem::path source_root = EIGENPOSE_SOURCE_DIR;

TimePoint soon() {
  return std::chrono::steady_clock::now() + 20s;
}

struct Ended {
  int status = 0;
  std::string output;
};

Ended run(const std::string& command) {
  Ended ended;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return {127, "no shell"};
  char chunk[256];
  while (std::fgets(chunk, sizeof chunk, pipe) != nullptr) ended.output += chunk;
  ended.status = pclose(pipe);
  return ended;
}

bool have_mbpoll() {
  return run("command -v mbpoll").status == 0;
}

class PymodbusPeer : public testing::Test {
 protected:
  void SetUp() override {
    const std::string python = "/usr/bin/python3";
    if (run(python + " -c 'import pymodbus.server.async_io'").status != 0)
      GTEST_SKIP()
          << "pymodbus is not installed (packages python3-pymodbus, python3-serial-asyncio): the driver is "
             "not tried against an independent server";
    server_ = std::make_unique<ChildProcess>(
        std::vector<std::string>{python, (source_root / "tests/drivers/pymodbus_server.py").string()});
    const std::string line = server_->read_line();
    ASSERT_FALSE(line.empty()) << "the pymodbus server did not start";
    ModbusBusOptions bus;
    bus.endpoint = ModbusTcpEndpoint{"127.0.0.1", std::stoi(line)};
    bus.response_timeout = 2s;  // Python on a busy machine
    bus_ = std::make_shared<ModbusBus>(bus, clock_);
    profile_ = read_modbus_profile(source_root / "config/profiles/leadshine_rs.toml");
    ModbusAxisOptions options;
    options.steps_per_unit = profile_.defaults.steps_per_unit;
    options.speed = profile_.defaults.speed;
    options.acceleration = profile_.defaults.acceleration;
    options.arrival_tolerance = profile_.defaults.arrival_tolerance;
    options.patience.poll_interval = 2ms;
    options.patience.start_time = 200ms;
    axis_ = std::make_unique<ModbusAxis>(profile_, options, bus_, clock_);
  }
  void TearDown() override {
    axis_.reset();
    server_.reset();
  }

  SteadyClock clock_;
  std::unique_ptr<ChildProcess> server_;
  std::shared_ptr<ModbusBus> bus_;
  ModbusProfile profile_;
  std::unique_ptr<ModbusAxis> axis_;
};

TEST_F(PymodbusPeer, TheLeadshineProfileHomesAndMovesThere) {
  EXPECT_FALSE(axis_->state(soon()).homed);
  EXPECT_THROW(axis_->move_to(10.0, soon(), {}), DeviceError);
  axis_->home(soon(), {});
  EXPECT_TRUE(axis_->state(soon()).homed);
  for (const double target : {30.0, 350.0, 0.0}) {
    EXPECT_NEAR(axis_->move_to(target, soon(), {}), target, 0.05);
    EXPECT_FALSE(axis_->state(soon()).moving);
  }
}

TEST_F(PymodbusPeer, WritesTheNumbersTheManualAsksFor) {
  axis_->home(soon(), {});
  axis_->move_to(350.0, soon(), {});  // 10 back: −5000 steps
  const auto path = bus_->read({"test", "read back", 1}, 0x6200, 8, soon());
  // 20 deg/s at 500 steps a degree and 10000 steps a turn: 60 rpm; 40 deg/s²: 1000 rpm take 8333 ms.
  EXPECT_THAT(path, testing::ElementsAre(1, 0xFFFF, 0xEC78, 60, 8333, 8333, 0, 0x10));
}

TEST_F(PymodbusPeer, ARegisterTheServerHasNotIsRefusedInWords) {
  try {
    bus_->read({"test", "read", 1}, 0xFFFF, 2, soon());
    FAIL() << "there is no register 0x10000";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("illegal address"));
  }
}

class MbpollPeer : public testing::Test {
 protected:
  void SetUp() override {
    if (!have_mbpoll())
      GTEST_SKIP()
          << "mbpoll is not installed (package mbpoll): the simulated drives are not read by an independent "
             "client";
  }
  SteadyClock clock_;
  sim::SimLab lab_{clock_};
};

TEST_F(MbpollPeer, HomesAndMovesTheSimulatedDriveOverTcp) {
  const sim::SimModbusServer server(lab_, {.speed_factor = 100.0});
  const std::string mbpoll = "mbpoll -m tcp -p " + std::to_string(server.port()) + " -a 1 -0 -1 -q -t 4";
  const std::string host = " 127.0.0.1";
  EXPECT_EQ(run(mbpoll + " -r 124" + host + " 0 16").status, 0) << "ZHOME";
  EXPECT_EQ(run(mbpoll + " -r 124" + host + " 0 0").status, 0);
  Ended status;
  const TimePoint patience = soon();
  do {
    status = run(mbpoll + ":hex -r 127 -c 1" + host);
    ASSERT_EQ(status.status, 0) << status.output;
  } while (status.output.find("0x4030") == std::string::npos && clock_.now() < patience);
  EXPECT_THAT(status.output, HasSubstr("0x4030")) << "homed, ready, in position";
  // Direct data operation: absolute, 1234 steps, 3000 Hz, rates, current, go.
  EXPECT_EQ(run(mbpoll + " -r 88" + host + " 0 0 0 1 0 1234 0 3000 1 4464 1 4464 0 1000 0 1").status, 0);
  Ended position;
  do {
    position = run(mbpoll + ":int -B -r 204 -c 1" + host);
  } while (position.output.find("1234") == std::string::npos && clock_.now() < patience);
  EXPECT_THAT(position.output, HasSubstr("1234"));
  EXPECT_NEAR(lab_.axis_position_deg(sim::LabAxis::table, clock_.now()), 12.34, 1e-6);
}

TEST_F(MbpollPeer, ReadsTheSimulatedDriveOverASerialLine) {
  const test::TemporaryFolder folder;
  const std::string line = folder.path() / "line";
  const sim::SimRtuServer server(lab_, {.port = line});
  const std::string mbpoll = "mbpoll -m rtu -b 115200 -P even -a 1 -0 -1 -q -t 4:hex -r 127 -c 1 ";
  EXPECT_THAT(run(mbpoll + line).output, HasSubstr("0x4020")) << "ready, in position, not homed";
}

}  // namespace
}  // namespace eigenpose
