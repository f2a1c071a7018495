#pragma once

/// Simulated drives on an RS-485 line: a pseudo-terminal whose other end a driver opens as its serial port.
/// Frames and checksum after "MODBUS over Serial Line Specification and Implementation Guide V1.02".

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "sim/modbus/pdu_server.h"
#include "sim/modbus/wire_faults.h"

namespace eigenpose::sim {

struct SimRtuServerOptions {
  std::filesystem::path port;  ///< the name the line gets: a symbolic link that the server makes and removes
  double speed_factor = 1.0;   ///< motion takes the time of a real drive divided by this
  std::vector<DriveOptions> drives = default_drives();
};

/// Serves on a thread of its own from construction to destruction. A request to a unit that nobody has is
/// left unanswered, as on a real line. Thread-safe. The lab must outlive it.
class SimRtuServer {
 public:
  /// @throws Error when the pseudo-terminal or its name cannot be had.
  SimRtuServer(SimLab& lab, SimRtuServerOptions options);
  SimRtuServer(const SimRtuServer&) = delete;
  SimRtuServer& operator=(const SimRtuServer&) = delete;
  ~SimRtuServer();

  [[nodiscard]] FaultPlan& faults();
  [[nodiscard]] AzDrive& drive(std::uint8_t unit);
  /// Requests understood so far.
  [[nodiscard]] std::uint64_t requests() const;

  /// The driver's adapter hears itself from now on: what is sent comes in again, before the answer.
  void set_echo(bool echo);

  /// Pulls the adapter out: who has the port open gets an error, and its name is gone. The drives live on.
  void unplug();
  /// Puts it back under the same name.
  void plug_in();

 private:
  class Worker;
  std::unique_ptr<Worker> worker_;
};

/// The checksum of a frame: polynomial 0xA001, start 0xFFFF; sent low byte first.
std::uint16_t modbus_crc(std::span<const std::uint8_t> frame);

}  // namespace eigenpose::sim
