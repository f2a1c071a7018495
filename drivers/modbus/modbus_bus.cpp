#include "drivers/modbus/modbus_bus.h"

#include <algorithm>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/error.h"
#include "drivers/modbus/connection.h"
#include "drivers/modbus/endpoint.h"

namespace eigenpose {

namespace {

std::string describe(const ModbusBusOptions& options) {
  if (const auto* tcp = std::get_if<ModbusTcpEndpoint>(&options.endpoint))
    return fmt::format("tcp {}:{}", tcp->host, tcp->port);
  const auto& rtu = std::get<ModbusRtuEndpoint>(options.endpoint);
  return fmt::format("serial {} {} 8{}{}", rtu.device, rtu.baud, rtu.parity, rtu.stop_bits);
}

void check(const ModbusBusOptions& options) {
  using namespace std::chrono_literals;
  if (options.response_timeout < 10ms || options.response_timeout > 10s)
    throw std::invalid_argument("Modbus response timeout must be 10 ms … 10 s");
  if (options.attempts < 1 || options.attempts > 10)
    throw std::invalid_argument(fmt::format("Modbus attempts must be 1 … 10, got {}", options.attempts));
  if (const auto* tcp = std::get_if<ModbusTcpEndpoint>(&options.endpoint)) {
    if (tcp->host.empty()) throw std::invalid_argument("Modbus TCP needs a host");
    if (tcp->port < 1 || tcp->port > 65535)
      throw std::invalid_argument(fmt::format("Modbus TCP port must be 1 … 65535, got {}", tcp->port));
    return;
  }
  const auto& rtu = std::get<ModbusRtuEndpoint>(options.endpoint);
  if (rtu.device.empty()) throw std::invalid_argument("Modbus RTU needs a device");
  check_baud(rtu.baud);
  if (rtu.parity != 'N' && rtu.parity != 'E' && rtu.parity != 'O')
    throw std::invalid_argument(fmt::format("Modbus RTU parity must be N, E or O, got {}", rtu.parity));
  if (rtu.stop_bits != 1 && rtu.stop_bits != 2)
    throw std::invalid_argument(fmt::format("Modbus RTU stop bits must be 1 or 2, got {}", rtu.stop_bits));
}

/// For a turn, however far the deadline; a wait on the system's clock takes no endless one.
constexpr Duration longest_wait = std::chrono::hours(1);

bool is_final(ModbusFault fault) {
  return fault == ModbusFault::refused || fault == ModbusFault::held;
}

bool breaks_the_line(ModbusFault fault) {
  return fault != ModbusFault::refused && fault != ModbusFault::busy;
}

[[noreturn]] void raise(ModbusFault fault, const ModbusCaller& caller, const std::string& cause) {
  const std::string device(caller.device);
  const std::string operation(caller.operation);
  switch (fault) {
    case ModbusFault::no_connection:
      throw DeviceLost(device, operation, cause);
    case ModbusFault::no_answer:
      throw DeviceTimeout(device, operation, cause);
    default:
      throw DeviceError(device, operation, cause);
  }
}

}  // namespace

ModbusBus::ModbusBus(ModbusBusOptions options, const Clock& clock)
    : options_(std::move(options)), clock_(clock), description_(describe(options_)) {
  check(options_);
  if (const auto* tcp = std::get_if<ModbusTcpEndpoint>(&options_.endpoint))
    lookup_.emplace(tcp->host, options_.resolve);
}

ModbusBus::~ModbusBus() = default;

/// The right to use the connection, from construction to destruction.
class ModbusBus::Turn {
 public:
  /// Waits up to `patience`. @throws ModbusFailure when others take longer.
  Turn(ModbusBus& bus, bool urgent, Duration patience) : bus_(bus) {
    std::unique_lock lock(bus_.mutex_);
    if (urgent) ++bus_.urgent_waiting_;
    const bool mine = bus_.free_.wait_for(
        lock, patience, [&] { return !bus_.busy_ && (urgent || bus_.urgent_waiting_ == 0); });
    if (urgent) --bus_.urgent_waiting_;
    if (!mine) {
      lock.unlock();
      bus_.free_.notify_all();
      throw ModbusFailure{ModbusFault::no_answer, "other devices on the line took all the time"};
    }
    bus_.busy_ = true;
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;
  ~Turn() {
    {
      const std::lock_guard lock(bus_.mutex_);
      bus_.busy_ = false;
    }
    bus_.free_.notify_all();
  }

 private:
  ModbusBus& bus_;
};

void ModbusBus::claim(int unit) {
  if (connection_->is_serial() || claims_.contains(unit)) return;  // an open port is locked as a whole
  auto claim = DeviceClaim::make(fmt::format("{} unit {}", gateway_, unit));
  if (!claim) throw ModbusFailure{ModbusFault::held, std::string(held_by_another)};
  claims_.emplace(unit, std::move(*claim));
}

std::unique_ptr<ModbusBus::Connection> ModbusBus::connect_tcp(const ModbusTcpEndpoint& endpoint,
                                                              const ModbusCaller& caller, Duration timeout) {
  std::vector<std::string> addresses;
  try {
    addresses = lookup_->addresses(caller.urgent ? Duration::zero() : timeout);
  } catch (const std::runtime_error& error) {
    throw ModbusFailure{ModbusFault::no_connection, error.what()};
  }
  std::optional<ModbusFailure> last;
  for (const std::string& address : addresses) {
    try {
      return std::make_unique<Connection>(address, endpoint.port,
                                          timeout / static_cast<Duration::rep>(addresses.size()));
    } catch (const ModbusFailure& failure) {
      last = failure;
    }
  }
  lookup_->refresh();  // it may have another address by now
  throw *last;
}

void ModbusBus::connect(const ModbusCaller& caller, Duration timeout) {
  if (const auto* tcp = std::get_if<ModbusTcpEndpoint>(&options_.endpoint))
    connection_ = connect_tcp(*tcp, caller, timeout);
  else
    connection_ = std::make_unique<Connection>(std::get<ModbusRtuEndpoint>(options_.endpoint), timeout);
  {
    const std::lock_guard lock(mutex_);
    ++statistics_.connections;
  }
  if (connection_->is_serial()) return;
  std::string gateway = connection_->far_end();
  if (gateway != gateway_) claims_.clear();
  gateway_ = std::move(gateway);
}

void ModbusBus::attempt(const ModbusCaller& caller, TimePoint deadline, const Work& work) {
  const Turn turn(*this, caller.urgent, std::min<Duration>(deadline - clock_.now(), longest_wait));
  const Duration left = deadline - clock_.now();
  if (left <= Duration::zero())
    throw ModbusFailure{ModbusFault::no_answer, "other devices on the line took all the time"};
  const Duration timeout = std::min(left, options_.response_timeout);
  try {
    if (!connection_) connect(caller, timeout);
    claim(caller.unit);
    if (line_suspect_ && connection_->is_serial())
      connection_->drain(options_.response_timeout, std::min(left, 4 * options_.response_timeout));
    line_suspect_ = false;
    work(*connection_, timeout);
  } catch (const ModbusFailure& failure) {
    if (breaks_the_line(failure.fault)) {
      connection_.reset();
      line_suspect_ = true;
    }
    throw;
  }
}

void ModbusBus::transact(const ModbusCaller& caller, TimePoint deadline, const std::string& what,
                         const Work& work) {
  std::optional<ModbusFailure> last;
  const int attempts = caller.once ? 1 : options_.attempts;
  int attempted = 0;
  while (attempted < attempts && clock_.now() < deadline) {
    if (attempted > 0) clock_.sleep_for(std::min<Duration>(options_.retry_pause, deadline - clock_.now()));
    ++attempted;
    try {
      attempt(caller, deadline, work);
      const std::lock_guard lock(mutex_);
      ++statistics_.transactions;
      return;
    } catch (const ModbusFailure& failure) {
      last = failure;
      const std::lock_guard lock(mutex_);
      ++statistics_.failures;
    }
    if (is_final(last->fault)) break;
  }
  const std::string where = fmt::format("{}, unit {}, {}", description_, caller.unit, what);
  if (!last)
    throw DeviceTimeout(std::string(caller.device), std::string(caller.operation),
                        fmt::format("no time left before the deadline ({})", where));
  raise(last->fault, caller,
        attempted > 1 ? fmt::format("{} ({}; tried {} times)", last->cause, where, attempted)
                      : fmt::format("{} ({})", last->cause, where));
}

std::vector<std::uint16_t> ModbusBus::read(const ModbusCaller& caller, std::uint16_t address, int count,
                                           TimePoint deadline) {
  if (count < 1 || count > MODBUS_MAX_READ_REGISTERS)
    throw std::invalid_argument(
        fmt::format("a read has 1 … {} registers, got {}", MODBUS_MAX_READ_REGISTERS, count));
  std::vector<std::uint16_t> registers;
  transact(caller, deadline, fmt::format("reading {} at {:#06x}", count, address),
           [&](Connection& connection, Duration timeout) {
             registers = connection.read(caller.unit, address, count, timeout);
           });
  return registers;
}

void ModbusBus::write(const ModbusCaller& caller, std::uint16_t address,
                      std::span<const std::uint16_t> values, TimePoint deadline) {
  if (values.empty() || values.size() > MODBUS_MAX_WRITE_REGISTERS)
    throw std::invalid_argument(
        fmt::format("a write has 1 … {} registers, got {}", MODBUS_MAX_WRITE_REGISTERS, values.size()));
  transact(caller, deadline, fmt::format("writing {} at {:#06x}", values.size(), address),
           [&](Connection& connection, Duration timeout) {
             connection.write(caller.unit, address, values, timeout);
           });
}

std::uint64_t ModbusBus::connection_number() const {
  const std::lock_guard lock(mutex_);
  return statistics_.connections;
}

ModbusBusStatistics ModbusBus::statistics() const {
  const std::lock_guard lock(mutex_);
  return statistics_;
}

}  // namespace eigenpose
