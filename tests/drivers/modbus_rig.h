#pragma once

/// A simulated drive of the lab, the real driver in front of it, and a Modbus line between them.

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <ostream>

#include "core/base/clock.h"
#include "drivers/modbus/modbus_axis.h"
#include "sim/lab/sim_lab.h"
#include "sim/modbus/modbus_server.h"
#include "sim/modbus/rtu_server.h"
#include "tests/drivers/axis_conformance.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {

enum class ModbusLine { tcp, rtu };

inline std::ostream& operator<<(std::ostream& stream, ModbusLine line) {
  return stream << (line == ModbusLine::tcp ? "Tcp" : "Rtu");
}

/// Longer than a busy machine keeps the simulated drives waiting, some attempts on end.
constexpr std::chrono::milliseconds rig_response_timeout{100};

/// What may go wrong on the line while the suite runs: everything that the driver can live through.
std::vector<sim::WireFault> survivable_faults(
    ModbusLine line, std::chrono::milliseconds response_timeout = rig_response_timeout);

/// A table of 30 deg/s and 60 deg/s² that is so much faster crosses a half turn in 0.2 s.
constexpr double quick = 30.0;

class ModbusRig final : public AxisRig {
 public:
  /// @param fault_rate of all requests, meets one of `survivable_faults`.
  ModbusRig(ModbusLine line, double fault_rate,
            std::chrono::milliseconds response_timeout = rig_response_timeout);
  ~ModbusRig() override;

  Axis& axis() override { return *axis_; }
  void discard_axis() override { axis_.reset(); }
  double true_position() override;
  bool truly_moving() override;
  void slow_down(bool slow) override { drive().set_speed_factor(slow ? quick / 10.0 : quick); }
  void silence(bool silent) override;
  void unplug() override;
  void plug_in() override;
  void jam(bool jammed) override;
  void slip() override;
  void raise_alarm() override;

  sim::SimLab& lab() { return lab_; }
  sim::AzDrive& drive() { return tcp_ ? tcp_->drive(1) : rtu_->drive(1); }
  sim::FaultPlan& faults() { return tcp_ ? tcp_->faults() : rtu_->faults(); }
  std::shared_ptr<ModbusBus> bus() { return bus_; }
  int port() { return tcp_->port(); }
  std::string line() { return (folder_.path() / "line").string(); }
  /// The serial adapter hears itself.
  void set_echo(bool echo) { rtu_->set_echo(echo); }
  /// Lets go of the line; `discard_axis` first.
  void hang_up() { bus_.reset(); }
  /// Lets the drive turn steadily, with nobody asking the driver. @param degrees_per_s above 0.
  void turn_steadily(double degrees_per_s);
  /// Where the table really is, whole turns counted.
  double unwrapped_position();
  /// Another axis of the same table on the same bus.
  ModbusAxisOptions options() const { return options_; }

 private:
  void random_faults();

  SteadyClock clock_;
  sim::SimLab lab_;
  ModbusLine line_;
  double fault_rate_;
  test::TemporaryFolder folder_;  ///< of the serial line
  std::optional<sim::SimModbusServer> tcp_;
  std::optional<sim::SimRtuServer> rtu_;
  std::shared_ptr<ModbusBus> bus_;
  ModbusAxisOptions options_;
  std::unique_ptr<ModbusAxis> axis_;
};

}  // namespace eigenpose
