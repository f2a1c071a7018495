#pragma once

/// The lab's control for people, demos and tests: a Unix socket on which each line is a request and each
/// answer a line.
///
///   {"do": "place", "object": "mug", "yaw_deg": 30, "x_mm": 0, "y_mm": 0, "hand": true}   → {"ok": true,
///   "id": 7}
///   {"do": "remove", "id": 7, "hand": true} · {"do": "clear"} · {"do": "hand", "in": true} · {"do": "lamp",
///   "level": 0.5}
///   {"do": "objects"} → {"ok": true, "objects": [{"name", "symmetric", "held_out", "recorded"}]}
///   {"do": "truth"}   → {"ok": true, "time_s", "table_deg", "arm_azimuth_deg", "arm_elevation_deg",
///   "lamp_level", "moving",
///                        "hand_in_view", "objects": [{"id", "name", "angle_deg", "yaw_deg", "x_mm", "y_mm",
///                        "symmetric", "held_out", "carried"}]}
///   {"do": "camera_faults", "stalled", "lost", "extra_noise", "damaged_fraction"}: those not named are off
///   {"do": "drive_faults", "unit": 1, "stuck", "slip_steps", "backlash_deg", "dead"}: the same
///   {"do": "wire_fault", "kind": "silence", "times": 1, "skip": 0, "delay_ms": 300, "exception_code": 4}
///   {"do": "modbus", "alive": false} · {"do": "alarm", "unit": 1, "code": 48}
/// What cannot be done is answered {"ok": false, "error": "…"}. `time_s` is CLOCK_MONOTONIC.

#include <filesystem>
#include <memory>

#include "sim/lab/sim_lab.h"

namespace eigenpose::sim {

class SimModbusServer;

/// Serves on a thread of its own from construction to destruction; several clients at once. The socket is
/// made with mode 0600 and removed at the end.
class LabServer {
 public:
  /// @param modbus may be null: then requests about drives are refused. Both must outlive the server.
  /// @throws Error when the socket cannot be made or another server answers on it.
  LabServer(SimLab& lab, std::filesystem::path socket, SimModbusServer* modbus = nullptr);
  LabServer(const LabServer&) = delete;
  LabServer& operator=(const LabServer&) = delete;
  ~LabServer();

  [[nodiscard]] const std::filesystem::path& socket() const;

 private:
  class Worker;
  std::unique_ptr<Worker> worker_;
};

}  // namespace eigenpose::sim
