#include "drivers/modbus/modbus_lamp.h"

#include <chrono>
#include <cmath>
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
  info_ = {options_.name, profile_.model};
}

ModbusLamp::~ModbusLamp() {
  if (!touched_) return;
  try {
    set_level(0.0, clock_.now() + std::chrono::seconds(2));
  } catch (const Error&) {
    // Nobody is left to tell.
  }
}

void ModbusLamp::write(const RegisterWrites& writes, const RegisterFill& fill, TimePoint deadline) {
  const std::string operation = fmt::format("set level to {} of {}", fill.level, profile_.full);
  for (const RegisterWrite& one : writes)
    bus_->write({options_.name, operation, options_.unit}, one.address,
                encode(one, profile_.word_order, fill), deadline);
}

void ModbusLamp::set_level(double level, TimePoint deadline) {
  if (!(level >= 0.0 && level <= 1.0))
    throw std::out_of_range(fmt::format("{}: level {} is outside 0 … 1", options_.name, level));
  RegisterFill fill;
  fill.level = std::llround(level * static_cast<double>(profile_.full));
  touched_ = true;
  if (bus_->connection_number() != set_up_connection_ || set_up_connection_ == 0) {
    write(profile_.connect, fill, deadline);
    set_up_connection_ = bus_->connection_number();
  }
  write(profile_.set_level, fill, deadline);
  level_ = level;
}

}  // namespace eigenpose
