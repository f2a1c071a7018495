#pragma once

/// The part of a Modbus server that is the same on every wire: function codes, lengths, exceptions.
/// Written from the "MODBUS Application Protocol Specification V1.1b3".

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sim/modbus/az_drive.h"

namespace eigenpose::sim {

/// Drives behind one wire. Thread-safe; the lab must outlive it.
class PduServer {
 public:
  /// @throws std::invalid_argument when two drives have one unit.
  PduServer(SimLab& lab, const std::vector<DriveOptions>& drives, double speed_factor);

  /// @param pdu function code and data. @return the answer's function code and data; nothing when nobody
  /// answers: no drive of that unit, a dead one, or a broadcast (unit 0).
  std::optional<std::vector<std::uint8_t>> serve(std::uint8_t unit, std::span<const std::uint8_t> pdu);
  /// For all drives: AzDrive::tick.
  void tick();
  /// @throws std::out_of_range when there is none.
  [[nodiscard]] AzDrive& drive(std::uint8_t unit);
  [[nodiscard]] std::vector<std::uint8_t> units() const;

 private:
  AzDrive* find(std::uint8_t unit);
  std::vector<std::unique_ptr<AzDrive>> drives_;
};

/// Function code with its upper bit set, and the reason.
std::vector<std::uint8_t> exception_answer(std::uint8_t function, ModbusException reason);

/// Table = 1, arm azimuth = 2, arm elevation = 3; 100 steps a degree. The arm's elevation drive counts 0 at
/// 50° and reaches from 5° to 85°; azimuth −100° to 190°.
std::vector<DriveOptions> default_drives();

}  // namespace eigenpose::sim
