#include "drivers/modbus/modbus_bus.h"

#include <algorithm>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/error.h"
#include "drivers/modbus/connection.h"

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
  if (rtu.baud < 1200)
    throw std::invalid_argument(fmt::format("Modbus RTU baud must be 1200 or more, got {}", rtu.baud));
  if (rtu.parity != 'N' && rtu.parity != 'E' && rtu.parity != 'O')
    throw std::invalid_argument(fmt::format("Modbus RTU parity must be N, E or O, got {}", rtu.parity));
  if (rtu.stop_bits != 1 && rtu.stop_bits != 2)
    throw std::invalid_argument(fmt::format("Modbus RTU stop bits must be 1 or 2, got {}", rtu.stop_bits));
}

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
}

ModbusBus::~ModbusBus() = default;

void ModbusBus::enter(bool urgent) {
  std::unique_lock lock(mutex_);
  if (urgent) ++urgent_waiting_;
  free_.wait(lock, [&] { return !busy_ && (urgent || urgent_waiting_ == 0); });
  if (urgent) --urgent_waiting_;
  busy_ = true;
}

void ModbusBus::leave() {
  {
    const std::lock_guard lock(mutex_);
    busy_ = false;
  }
  free_.notify_all();
}

void ModbusBus::claim(int unit) {
  if (connection_->is_serial() || claims_.contains(unit)) return;  // an open port is locked as a whole
  auto claim = DeviceClaim::make(fmt::format("{} unit {}", gateway_, unit));
  if (!claim) throw ModbusFailure{ModbusFault::held, std::string(held_by_another)};
  claims_.emplace(unit, std::move(*claim));
}

void ModbusBus::transact(const ModbusCaller& caller, TimePoint deadline, const std::string& what,
                         const Work& work) {
  std::optional<ModbusFailure> last;
  const int attempts = caller.once ? 1 : options_.attempts;
  int attempt = 0;
  for (; attempt < attempts; ++attempt) {
    if (attempt > 0) clock_.sleep_for(std::min<Duration>(options_.retry_pause, deadline - clock_.now()));
    const Duration left = deadline - clock_.now();
    if (left <= Duration::zero()) break;
    const Duration timeout = std::min(left, options_.response_timeout);

    enter(caller.urgent);
    struct Leave {
      ModbusBus& bus;
      ~Leave() { bus.leave(); }
    } const leave_at_the_end{*this};
    try {
      if (!connection_) {
        connection_ = std::make_unique<Connection>(options_, timeout);
        {
          const std::lock_guard lock(mutex_);
          ++statistics_.connections;
        }
        if (!connection_->is_serial()) {
          std::string gateway = connection_->far_end();
          if (gateway != gateway_) claims_.clear();
          gateway_ = std::move(gateway);
        }
      }
      claim(caller.unit);
      if (line_suspect_ && connection_->is_serial())
        connection_->drain(options_.response_timeout, 4 * options_.response_timeout);
      line_suspect_ = false;
      work(*connection_, timeout);
      const std::lock_guard lock(mutex_);
      ++statistics_.transactions;
      return;
    } catch (const ModbusFailure& failure) {
      last = failure;
      {
        const std::lock_guard lock(mutex_);
        ++statistics_.failures;
      }
      if (breaks_the_line(failure.fault)) {
        connection_.reset();
        line_suspect_ = true;
      }
      if (is_final(failure.fault)) {
        ++attempt;
        break;
      }
    }
  }
  const std::string where = fmt::format("{}, unit {}, {}", description_, caller.unit, what);
  if (!last)
    throw DeviceTimeout(std::string(caller.device), std::string(caller.operation),
                        fmt::format("no time left before the deadline ({})", where));
  raise(last->fault, caller,
        attempt > 1 ? fmt::format("{} ({}; tried {} times)", last->cause, where, attempt)
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
