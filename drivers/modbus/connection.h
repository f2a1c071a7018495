#pragma once

/// Inside ModbusBus: one open connection, made by libmodbus, and one transaction over it. Not for other
/// folders.

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <modbus/modbus.h>

#include "core/base/clock.h"
#include "drivers/modbus/modbus_bus.h"
#include "drivers/modbus/rtu_answer.h"

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
  /// @param address numeric. Waits for the connection up to `timeout`. @throws ModbusFailure.
  Connection(const std::string& address, int port, Duration timeout);
  /// Opens the port and locks it. @throws ModbusFailure.
  Connection(const ModbusRtuEndpoint& line, Duration timeout);
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
  void connect(Duration timeout);
  /// Sends the PDU `request` and returns the PDU of the answer, its unit and function checked.
  std::span<const std::uint8_t> exchange(int unit, std::span<const std::uint8_t> request, Duration timeout);
  std::span<const std::uint8_t> exchange_tcp(int unit, std::span<const std::uint8_t> request,
                                             Duration timeout);
  std::span<const std::uint8_t> exchange_serial(int unit, std::span<const std::uint8_t> request,
                                                Duration timeout);
  void discard_stale_input();
  void send_tcp(int unit, std::span<const std::uint8_t> request);
  /// @return the whole frame.
  std::vector<std::uint8_t> send_serial(int unit, std::span<const std::uint8_t> request);
  void receive_serial(rtu::Answer& answer, std::chrono::steady_clock::time_point deadline);
  void learn_echo(int unit, std::span<const std::uint8_t> request, Duration timeout);
  void wait_for_silent_interval();

  modbus_t* context_ = nullptr;
  bool serial_ = false;
  std::uint16_t transaction_ = 0;
  rtu::Echo echo_ = rtu::Echo::unknown;  ///< of a serial line
  Duration silent_interval_{};
  std::chrono::steady_clock::time_point last_frame_{};
  std::vector<std::uint8_t> answer_;
};

}  // namespace eigenpose
