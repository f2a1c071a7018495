#include "drivers/modbus/modbus_lamp.h"

#include <chrono>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/error.h"

namespace eigenpose {

ModbusLamp::ModbusLamp(ModbusLampProfile profile, ModbusLampOptions options, std::shared_ptr<ModbusBus> bus,
                       const Clock& clock)
    : profile_(std::move(profile)), options_(std::move(options)), bus_(std::move(bus)), clock_(clock) {
  if (!bus_) throw std::invalid_argument("lamp " + options_.name + ": no Modbus bus");
  if (options_.unit < 1 || options_.unit > 247)
    throw std::invalid_argument(
        fmt::format("lamp {}: Modbus unit must be 1 … 247, got {}", options_.name, options_.unit));
  profile_.check();
  level_register_ = *register_of(profile_.set_level, RegisterMeaning::level);
  info_ = {options_.name, profile_.model};
}

ModbusLamp::~ModbusLamp() {
  if (!touched_) return;
  try {
    write_level({}, clock_.now() + std::chrono::seconds(2));
  } catch (const std::exception&) {
    // Nobody is left to report to.
  }
}

void ModbusLamp::write(const RegisterWrites& writes, const RegisterFill& fill, TimePoint deadline) {
  const std::string operation = fmt::format("set level to {} of {}", fill.level, profile_.full);
  for (const RegisterWrite& one : writes)
    bus_->write({options_.name, operation, options_.unit}, one.address,
                encode(one, profile_.word_order, fill), deadline);
}

std::int64_t ModbusLamp::read_level(TimePoint deadline) {
  return decode(level_register_, profile_.word_order,
                bus_->read({options_.name, "read level", options_.unit}, level_register_.address,
                           level_register_.bits / 16, deadline));
}

void ModbusLamp::write_level(const RegisterFill& fill, TimePoint deadline) {
  do {
    if (bus_->connection_number() != set_up_connection_ || set_up_connection_ == 0) {
      write(profile_.connect, fill, deadline);
      set_up_connection_ = bus_->connection_number();
      read_back_ = ReadBack::untried;
    }
    write(profile_.set_level, fill, deadline);
    // Each write may have had to connect anew; then the dimmer has not been set up on this connection.
  } while (bus_->connection_number() != set_up_connection_);
}

void ModbusLamp::check_level(std::int64_t written, TimePoint deadline) {
  if (read_back_ == ReadBack::impossible) return;
  std::optional<std::int64_t> shown;
  try {
    shown = read_level(deadline);
  } catch (const DeviceLost&) {
    throw;
  } catch (const DeviceTimeout&) {
    throw;
  } catch (const DeviceError&) {
    if (read_back_ == ReadBack::works) throw;  // otherwise: it may be written, and not read
  }
  if (shown != written && read_back_ == ReadBack::works)
    throw DeviceError(options_.name, "set level",
                      fmt::format("it was set to {} of {} and shows {}: see that nothing else drives it",
                                  written, profile_.full, *shown));
  read_back_ = shown == written ? ReadBack::works : ReadBack::impossible;
}

void ModbusLamp::set_level(double level, TimePoint deadline) {
  if (!(level >= 0.0 && level <= 1.0))
    throw std::out_of_range(fmt::format("{}: level {} is outside 0 … 1", options_.name, level));
  RegisterFill fill;
  fill.level = std::llround(level * static_cast<double>(profile_.full));
  touched_ = true;
  const bool lost = lit_connection_ != 0 && read_back_ == ReadBack::works && read_level(deadline) != written_;
  write_level(fill, deadline);
  if (lost || (lit_connection_ != 0 && lit_connection_ != set_up_connection_)) ++interruptions_;
  lit_connection_ = set_up_connection_;
  written_ = fill.level;
  check_level(fill.level, deadline);
  level_ = level;
}

}  // namespace eigenpose
