#pragma once

/// Simulated drives behind a Modbus TCP gateway on the loopback interface.
/// Written from "MODBUS Messaging on TCP/IP Implementation Guide V1.0b", apart from any driver.

#include <cstdint>
#include <memory>
#include <vector>

#include "sim/modbus/pdu_server.h"
#include "sim/modbus/wire_faults.h"

namespace eigenpose::sim {

struct SimModbusServerOptions {
  std::uint16_t port = 0;     ///< 0: one that is free
  double speed_factor = 1.0;  ///< motion takes the time of a real drive divided by this
  std::vector<DriveOptions> drives = default_drives();
};

/// Serves on a thread of its own from construction to destruction; several connections at once. A unit that
/// nobody has is answered for by the gateway: exception 0x0B. Thread-safe. The lab must outlive it.
class SimModbusServer {
 public:
  /// @throws Error when the port cannot be had.
  SimModbusServer(SimLab& lab, const SimModbusServerOptions& options);
  SimModbusServer(const SimModbusServer&) = delete;
  SimModbusServer& operator=(const SimModbusServer&) = delete;
  ~SimModbusServer();

  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] FaultPlan& faults();
  [[nodiscard]] AzDrive& drive(std::uint8_t unit);
  [[nodiscard]] std::vector<std::uint8_t> units() const;
  /// Requests understood so far.
  [[nodiscard]] std::uint64_t requests() const;

  /// Closes all connections and refuses new ones; drives and their watchdogs live on.
  void die();
  /// The same at a chosen time.
  void die_at(TimePoint when);
  /// Listens again on the same port. @throws Error when it was taken meanwhile.
  void revive();

 private:
  class Worker;
  std::unique_ptr<Worker> worker_;
};

}  // namespace eigenpose::sim
