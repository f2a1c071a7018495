#pragma once

/// One Modbus line (a TCP connection or an RS-485 pair) that several devices share.
///
/// A transaction is one request and its answer. Each has a deadline; each answer is checked for transaction
/// number, unit, function and length before its registers are believed. After any failure but a proper
/// exception answer the connection is closed, and the next attempt opens a new one: libmodbus's own recovery
/// is off, because it may block for ever when it reconnects and takes a late answer for the next one's. On
/// RS-485, where frames carry no number, the new connection first waits until the line has been silent as
/// long as an answer may take.
///
/// A transaction ends by its deadline whatever the other end does, one that sends without end included. A
/// host's name is looked up once, by a thread of its own (HostLookup); a stop never waits for that. An
/// adapter on a serial line may echo what is sent (rtu_answer.h).
///
/// The bus holds what it has spoken to against every other bus, in this program and others: a serial line as
/// a whole, as long as it is open; behind a TCP gateway each unit, as long as the bus lives.

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/base/clock.h"
#include "drivers/device_claim.h"
#include "drivers/modbus/host_lookup.h"

namespace eigenpose {

struct ModbusTcpEndpoint {
  std::string host;  ///< address or name
  int port = 502;
};

struct ModbusRtuEndpoint {
  std::string device;          ///< "/dev/serial/by-id/…"
  int baud = 115200;           ///< 1/s
  char parity = 'E';           ///< 'N', 'E', 'O'
  int stop_bits = 1;           ///< 1 or 2
  Duration silent_interval{};  ///< between frames, when more than the protocol's 3.5 characters
};

struct ModbusBusOptions {
  std::variant<ModbusTcpEndpoint, ModbusRtuEndpoint> endpoint;
  /// From the end of the request to the end of the answer; also for opening the connection. 10 ms … 10 s.
  Duration response_timeout = std::chrono::milliseconds(300);
  int attempts = 3;                                      ///< for one transaction, 1 … 10
  Duration retry_pause = std::chrono::milliseconds(50);  ///< between attempts
  HostLookup::Resolver resolve = resolve_by_system;      ///< of a TCP host that is a name
};

/// Counts since the bus was made.
struct ModbusBusStatistics {
  std::uint64_t transactions = 0;  ///< that ended well
  std::uint64_t failures = 0;      ///< attempts that did not
  std::uint64_t connections = 0;   ///< opened
};

/// Whose transaction it is: for errors and for order.
struct ModbusCaller {
  std::string_view device;     ///< "table": opens the text of every error
  std::string_view operation;  ///< "move to 30 deg"
  int unit = 1;                ///< 1 … 247
  bool urgent = false;         ///< a stop: goes before every other waiting transaction
  bool once = false;           ///< must not arrive twice (a relative move): one attempt only
};

/// Thread-safe. Opens the connection with the first transaction.
class ModbusBus {
 public:
  /// @param clock must outlive the bus. @throws std::invalid_argument on impossible options.
  ModbusBus(ModbusBusOptions options, const Clock& clock);
  ModbusBus(const ModbusBus&) = delete;
  ModbusBus& operator=(const ModbusBus&) = delete;
  ~ModbusBus();

  /// Holding registers `address` … `address + count − 1`; count 1 … 125.
  /// @throws DeviceTimeout (no answer), DeviceLost (no connection), DeviceError (damaged answers, the
  /// device's own refusal in words, or another program drives it). All say how often it was tried.
  std::vector<std::uint16_t> read(const ModbusCaller& caller, std::uint16_t address, int count,
                                  TimePoint deadline);

  /// Writes 1 … 123 holding registers: one with function 06, more with function 10h. Throws like `read`.
  /// A write whose answer is lost is sent again, unless the caller says `once`.
  void write(const ModbusCaller& caller, std::uint16_t address, std::span<const std::uint16_t> values,
             TimePoint deadline);

  /// Grows with each connection. Who must set a device up anew after a power cut compares it.
  [[nodiscard]] std::uint64_t connection_number() const;
  [[nodiscard]] ModbusBusStatistics statistics() const;
  /// "tcp 192.168.1.20:502", "serial /dev/ttyUSB0 115200 8E1".
  [[nodiscard]] const std::string& description() const { return description_; }

 private:
  class Connection;
  using Work = std::function<void(Connection&, Duration)>;

  class Turn;

  void transact(const ModbusCaller& caller, TimePoint deadline, const std::string& what, const Work& work);
  /// One attempt, after waiting for its turn. Throws ModbusFailure.
  void attempt(const ModbusCaller& caller, TimePoint deadline, const Work& work);
  void connect(const ModbusCaller& caller, Duration timeout);
  std::unique_ptr<Connection> connect_tcp(const ModbusTcpEndpoint& endpoint, const ModbusCaller& caller,
                                          Duration timeout);
  void claim(int unit);

  ModbusBusOptions options_;
  const Clock& clock_;
  std::string description_;
  std::optional<HostLookup> lookup_;  ///< of a TCP endpoint

  mutable std::mutex mutex_;
  std::condition_variable free_;
  bool busy_ = false;               ///< guarded by mutex_: someone uses connection_
  int urgent_waiting_ = 0;          ///< guarded by mutex_
  ModbusBusStatistics statistics_;  ///< guarded by mutex_

  std::unique_ptr<Connection> connection_;  ///< belongs to whoever has his Turn
  bool line_suspect_ = false;               ///< likewise: a late answer may still come
  std::string gateway_;                     ///< likewise: the far end of the last TCP connection
  std::map<int, DeviceClaim> claims_;       ///< likewise: of the drives behind it, by unit
};

}  // namespace eigenpose
