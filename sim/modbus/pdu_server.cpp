#include "sim/modbus/pdu_server.h"

#include <stdexcept>
#include <string>

namespace eigenpose::sim {
namespace {

using Bytes = std::vector<std::uint8_t>;
using View = std::span<const std::uint8_t>;

enum Function : std::uint8_t {
  read_holding_registers = 0x03,
  write_single_register = 0x06,
  diagnostics = 0x08,
  write_multiple_registers = 0x10,
  read_write_registers = 0x17,
};

constexpr std::size_t most_read = 125;
constexpr std::size_t most_written = 123;
constexpr std::size_t most_written_in_exchange = 121;

std::uint16_t word_at(View bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] << 8U | bytes[at + 1]);
}

void append_word(Bytes& bytes, std::uint16_t word) {
  bytes.push_back(static_cast<std::uint8_t>(word >> 8U));
  bytes.push_back(static_cast<std::uint8_t>(word));
}

std::vector<std::uint16_t> words_of(View bytes) {
  std::vector<std::uint16_t> words(bytes.size() / 2);
  for (std::size_t i = 0; i < words.size(); ++i) words[i] = word_at(bytes, 2 * i);
  return words;
}

Bytes read_answer(AzDrive& drive, std::uint8_t function, std::uint16_t address, std::size_t count) {
  std::vector<std::uint16_t> values(count);
  if (const auto failure = drive.read(address, values); failure != ModbusException::none) {
    return exception_answer(function, failure);
  }
  Bytes answer{function, static_cast<std::uint8_t>(2 * count)};
  for (const std::uint16_t value : values) append_word(answer, value);
  return answer;
}

Bytes serve_read(AzDrive& drive, View pdu) {
  if (pdu.size() != 5) return exception_answer(pdu[0], ModbusException::illegal_value);
  const std::size_t count = word_at(pdu, 3);
  if (count < 1 || count > most_read) return exception_answer(pdu[0], ModbusException::illegal_value);
  return read_answer(drive, pdu[0], word_at(pdu, 1), count);
}

Bytes serve_write_single(AzDrive& drive, View pdu) {
  if (pdu.size() != 5) return exception_answer(pdu[0], ModbusException::illegal_value);
  const std::uint16_t value = word_at(pdu, 3);
  const auto failure = drive.write(word_at(pdu, 1), {&value, 1});
  return failure == ModbusException::none ? Bytes(pdu.begin(), pdu.end()) : exception_answer(pdu[0], failure);
}

Bytes serve_write_multiple(AzDrive& drive, View pdu) {
  if (pdu.size() < 6) return exception_answer(pdu[0], ModbusException::illegal_value);
  const std::size_t count = word_at(pdu, 3);
  if (count < 1 || count > most_written || pdu[5] != 2 * count || pdu.size() != 6 + 2 * count) {
    return exception_answer(pdu[0], ModbusException::illegal_value);
  }
  const auto failure = drive.write(word_at(pdu, 1), words_of(pdu.subspan(6)));
  return failure == ModbusException::none ? Bytes(pdu.begin(), pdu.begin() + 5)
                                          : exception_answer(pdu[0], failure);
}

// The write comes before the read.
Bytes serve_exchange(AzDrive& drive, View pdu) {
  if (pdu.size() < 10) return exception_answer(pdu[0], ModbusException::illegal_value);
  const std::size_t to_read = word_at(pdu, 3);
  const std::size_t to_write = word_at(pdu, 7);
  if (to_read < 1 || to_read > most_read || to_write < 1 || to_write > most_written_in_exchange ||
      pdu[9] != 2 * to_write || pdu.size() != 10 + 2 * to_write) {
    return exception_answer(pdu[0], ModbusException::illegal_value);
  }
  const auto failure = drive.write(word_at(pdu, 5), words_of(pdu.subspan(10)));
  if (failure != ModbusException::none) return exception_answer(pdu[0], failure);
  return read_answer(drive, pdu[0], word_at(pdu, 1), to_read);
}

// Only sub-function 0, "return query data", is served.
Bytes serve_diagnostics(View pdu) {
  if (pdu.size() < 5 || word_at(pdu, 1) != 0) return exception_answer(pdu[0], ModbusException::illegal_value);
  return {pdu.begin(), pdu.end()};
}

Bytes answer_of(AzDrive& drive, View pdu) {
  switch (pdu[0]) {
    case read_holding_registers:
      return serve_read(drive, pdu);
    case write_single_register:
      return serve_write_single(drive, pdu);
    case diagnostics:
      return serve_diagnostics(pdu);
    case write_multiple_registers:
      return serve_write_multiple(drive, pdu);
    case read_write_registers:
      return serve_exchange(drive, pdu);
    default:
      return exception_answer(pdu[0], ModbusException::illegal_function);
  }
}

}  // namespace

std::vector<std::uint8_t> exception_answer(std::uint8_t function, ModbusException reason) {
  return {static_cast<std::uint8_t>(function | 0x80U), static_cast<std::uint8_t>(reason)};
}

std::vector<DriveOptions> default_drives() {
  DriveOptions table;
  DriveOptions azimuth;
  azimuth.unit = 2;
  azimuth.axis = LabAxis::arm_azimuth;
  azimuth.lower_deg = -100.0;
  azimuth.upper_deg = 190.0;
  DriveOptions elevation;
  elevation.unit = 3;
  elevation.axis = LabAxis::arm_elevation;
  elevation.home_deg = 50.0;
  elevation.lower_deg = 5.0;
  elevation.upper_deg = 85.0;
  return {table, azimuth, elevation};
}

PduServer::PduServer(SimLab& lab, const std::vector<DriveOptions>& drives, double speed_factor) {
  for (const DriveOptions& options : drives) {
    if (find(options.unit) != nullptr) {
      throw std::invalid_argument("two simulated drives have Modbus unit " + std::to_string(options.unit));
    }
    drives_.push_back(std::make_unique<AzDrive>(lab, options, speed_factor));
  }
}

AzDrive* PduServer::find(std::uint8_t unit) {
  for (const auto& drive : drives_) {
    if (drive->options().unit == unit) return drive.get();
  }
  return nullptr;
}

AzDrive& PduServer::drive(std::uint8_t unit) {
  AzDrive* found = find(unit);
  if (found == nullptr) throw std::out_of_range("no simulated drive has Modbus unit " + std::to_string(unit));
  return *found;
}

std::vector<std::uint8_t> PduServer::units() const {
  std::vector<std::uint8_t> result;
  for (const auto& drive : drives_) result.push_back(drive->options().unit);
  return result;
}

std::optional<std::vector<std::uint8_t>> PduServer::serve(std::uint8_t unit,
                                                          std::span<const std::uint8_t> pdu) {
  if (pdu.empty()) return std::nullopt;
  if (unit == 0) {
    for (const auto& drive : drives_) {
      if (drive->faults().dead) continue;
      drive->note_message();
      answer_of(*drive, pdu);
    }
    return std::nullopt;
  }
  AzDrive* drive = find(unit);
  if (drive == nullptr || drive->faults().dead) return std::nullopt;
  drive->note_message();
  return answer_of(*drive, pdu);
}

void PduServer::tick() {
  for (const auto& drive : drives_) drive->tick();
}

}  // namespace eigenpose::sim
