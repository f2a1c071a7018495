// What the driver costs: our bus and axis against bare libmodbus calls, on the same simulated drive in the
// same run. Both pay for the same loopback connection and the same server; the difference is ours.

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>
#include <modbus/modbus.h>

#include "config/modbus_profile.h"
#include "drivers/modbus/modbus_axis.h"
#include "sim/lab/sim_lab.h"
#include "sim/modbus/modbus_server.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;

constexpr std::uint16_t feedback_position = 0x00CC;
constexpr std::uint16_t output_status = 0x007F;

struct Table {
  SteadyClock clock;
  sim::SimLab lab{clock};
  sim::SimModbusServer server{lab, {}};
};

Table& table() {
  static Table the_table;
  return the_table;
}

/// A context opened once and closed at the end.
class Bare {
 public:
  Bare() : context_(modbus_new_tcp_pi("127.0.0.1", std::to_string(table().server.port()).c_str())) {
    modbus_set_slave(context_, 1);
    modbus_connect(context_);
  }
  Bare(const Bare&) = delete;
  Bare& operator=(const Bare&) = delete;
  ~Bare() {
    modbus_close(context_);
    modbus_free(context_);
  }
  void read(benchmark::State& state, int address, int count) {
    std::uint16_t registers[8];
    if (modbus_read_registers(context_, address, count, registers) != count) state.SkipWithError("no answer");
    benchmark::DoNotOptimize(registers[0]);
  }

 private:
  modbus_t* context_;
};

std::shared_ptr<ModbusBus> new_bus() {
  ModbusBusOptions options;
  options.endpoint = ModbusTcpEndpoint{"127.0.0.1", table().server.port()};
  return std::make_shared<ModbusBus>(options, table().clock);
}

void bare_read_of_2_registers(benchmark::State& state) {
  Bare bare;
  for (auto _ : state) bare.read(state, feedback_position, 2);
}

void our_bus_read_of_2_registers(benchmark::State& state) {
  const auto bus = new_bus();
  const ModbusCaller caller{"table", "measure", 1};
  for (auto _ : state)
    benchmark::DoNotOptimize(bus->read(caller, feedback_position, 2, table().clock.now() + 1s));
}

/// The same two transactions that an axis's state takes.
void bare_status_and_position(benchmark::State& state) {
  Bare bare;
  for (auto _ : state) {
    bare.read(state, output_status, 3);
    bare.read(state, feedback_position, 2);
  }
}

void our_axis_state(benchmark::State& state) {
  ModbusAxis axis(oriental_motor_az_profile(), {}, new_bus(), table().clock);
  for (auto _ : state) benchmark::DoNotOptimize(axis.state(table().clock.now() + 1s));
}

// Real time: most of a transaction is waiting for the other side.
BENCHMARK(bare_read_of_2_registers)->UseRealTime()->Unit(benchmark::kMicrosecond);
BENCHMARK(our_bus_read_of_2_registers)->UseRealTime()->Unit(benchmark::kMicrosecond);
BENCHMARK(bare_status_and_position)->UseRealTime()->Unit(benchmark::kMicrosecond);
BENCHMARK(our_axis_state)->UseRealTime()->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace eigenpose
