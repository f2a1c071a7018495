#pragma once

/// Inside ModbusBus: one libmodbus context and one transaction over it. Not for other folders.

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <modbus/modbus.h>

#include "core/base/clock.h"
#include "drivers/modbus/modbus_bus.h"

namespace eigenpose {

/// Why a transaction failed.
enum class ModbusFault {
  no_connection,  ///< cannot be opened, or broke
  no_answer,
  damaged,  ///< an answer that is not one to our request
  refused,  ///< a proper exception answer
  held,     ///< another program drives the device
  busy      ///< a proper exception answer that asks for patience
};

/// Thrown within the bus only; `ModbusBus` turns it into a DeviceError with the caller's name.
struct ModbusFailure {
  ModbusFault fault;
  std::string cause;
};

/// An open connection. Lives on one thread at a time. Closes in the destructor.
class ModbusBus::Connection {
 public:
  /// @throws ModbusFailure.
  Connection(const ModbusBusOptions& options, Duration timeout);
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection();

  std::vector<std::uint16_t> read(int unit, std::uint16_t address, int count, Duration timeout);
  void write(int unit, std::uint16_t address, std::span<const std::uint16_t> values, Duration timeout);

  [[nodiscard]] bool is_serial() const { return serial_; }
  /// The address of a TCP connection's other end, however it was spelt: "tcp 192.168.1.20:502".
  [[nodiscard]] std::string far_end() const;
  /// Throws away what comes in, until nothing has come for `silence` or `limit` is over.
  void drain(Duration silence, Duration limit);

 private:
  /// Sends the PDU `request` and returns the PDU of the answer, its unit and function checked.
  std::span<const std::uint8_t> exchange(int unit, std::span<const std::uint8_t> request, Duration timeout);
  void send_tcp(int unit, std::span<const std::uint8_t> request);
  void send_serial(int unit, std::span<const std::uint8_t> request);
  void wait_for_silent_interval();

  modbus_t* context_ = nullptr;
  bool serial_ = false;
  std::uint16_t transaction_ = 0;
  Duration silent_interval_{};
  std::chrono::steady_clock::time_point last_frame_{};
  std::uint8_t answer_[MODBUS_MAX_ADU_LENGTH] = {};
};

}  // namespace eigenpose
