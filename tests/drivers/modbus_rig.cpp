#include "tests/drivers/modbus_rig.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/modbus_profile.h"

namespace eigenpose {

namespace {

using namespace std::chrono_literals;
using sim::WireFault;
using sim::WireFaultKind;

constexpr std::uint64_t seed = 11;

}  // namespace

std::vector<WireFault> survivable_faults(ModbusLine line, std::chrono::milliseconds response_timeout) {
  std::vector<WireFault> faults = {
      {WireFaultKind::silence},
      {WireFaultKind::loss},
      {WireFaultKind::late, response_timeout / 2},
      {WireFaultKind::late, 7 * response_timeout / 4},  // after the driver has given up
      {WireFaultKind::partial},
      {WireFaultKind::wrong_unit},
      {WireFaultKind::exception, {}, 6},  // "busy"
  };
  if (line == ModbusLine::tcp) {
    faults.push_back({WireFaultKind::wrong_transaction});
    faults.push_back({WireFaultKind::close_connection});
  } else {
    faults.push_back({WireFaultKind::bad_crc});
  }
  return faults;
}

ModbusRig::ModbusRig(ModbusLine line, double fault_rate, std::chrono::milliseconds response_timeout)
    : lab_(clock_), line_(line), fault_rate_(fault_rate) {
  ModbusBusOptions bus;
  if (line == ModbusLine::tcp) {
    tcp_.emplace(lab_, sim::SimModbusServerOptions{.speed_factor = quick});
    bus.endpoint = ModbusTcpEndpoint{"127.0.0.1", tcp_->port()};
  } else {
    rtu_.emplace(lab_, sim::SimRtuServerOptions{.port = this->line(), .speed_factor = quick});
    bus.endpoint = ModbusRtuEndpoint{.device = this->line()};
  }
  bus.response_timeout = response_timeout;
  bus.retry_pause = 5ms;
  bus.attempts = fault_rate > 0.0 ? 8 : 4;
  bus_ = std::make_shared<ModbusBus>(bus, clock_);

  const ModbusProfile profile = oriental_motor_az_profile();
  options_.speed = profile.defaults.speed;
  options_.acceleration = profile.defaults.acceleration;
  options_.arrival_tolerance = profile.defaults.arrival_tolerance;
  options_.patience.poll_interval = 5ms;
  options_.patience.start_time = std::max(80ms, 2 * response_timeout);
  options_.patience.settle_time = options_.patience.start_time;
  options_.patience.stall_time = 4 * options_.patience.start_time;
  options_.watchdog = 0ms;
  axis_ = std::make_unique<ModbusAxis>(profile, options_, bus_, clock_);
  random_faults();
}

ModbusRig::~ModbusRig() {
  faults().clear();
  axis_.reset();
  rtu_.reset();
}

void ModbusRig::random_faults() {
  faults().clear();
  if (fault_rate_ > 0.0) faults().at_random(fault_rate_, seed, survivable_faults(line_));
}

double ModbusRig::true_position() {
  return wrap(lab_.axis_position_deg(sim::LabAxis::table, clock_.now()), 0.0, 360.0);
}

double ModbusRig::unwrapped_position() {
  return lab_.axis_position_deg(sim::LabAxis::table, clock_.now());
}

void ModbusRig::turn_steadily(double degrees_per_s) {
  // Direct data operation of type 16, continuous, as its registers stand from 0x0058 on.
  const auto hz = static_cast<std::uint16_t>(degrees_per_s * 100.0 / quick);
  const std::vector<std::uint16_t> registers = {0, 0, 0, 16, 0, 0, 0, hz, 0, 60000, 0, 60000, 0, 1000, 0, 1};
  if (drive().write(0x0058, registers) != sim::ModbusException::none)
    throw std::runtime_error("the drive does not turn");
}

bool ModbusRig::truly_moving() {
  const TimePoint now = clock_.now();
  return lab_.axis_position_deg(sim::LabAxis::table, now) !=
         lab_.axis_position_deg(sim::LabAxis::table, now - 2ms);
}

void ModbusRig::silence(bool silent) {
  random_faults();
  if (silent) faults().at_random(1.0, seed, {{WireFaultKind::loss}});
}

void ModbusRig::unplug() {
  if (tcp_)
    tcp_->die();
  else
    rtu_->unplug();
}

void ModbusRig::plug_in() {
  if (tcp_)
    tcp_->revive();
  else
    rtu_->plug_in();
}

void ModbusRig::jam(bool jammed) {
  drive().set_faults({.stuck = jammed});
}

void ModbusRig::slip() {
  faults().clear();  // a move whose answer is lost is sent again, and the second one makes good what was lost
  drive().set_faults({.slip_steps = 40.0});
}

void ModbusRig::raise_alarm() {
  drive().raise_alarm(0x30);
}

}  // namespace eigenpose
