#pragma once

/// A lamp whose brightness is a Modbus register: a dimmer, or an analogue output in front of a driver.

#include <memory>
#include <string>

#include "core/base/clock.h"
#include "drivers/lamp.h"
#include "drivers/modbus/modbus_bus.h"
#include "drivers/modbus/profile.h"

namespace eigenpose {

struct ModbusLampOptions {
  std::string name = "lamp";
  int unit = 1;  ///< Modbus unit number, 1 … 247
};

/// Lives on one thread. Goes dark when destroyed.
class ModbusLamp final : public Lamp {
 public:
  /// Does not touch the device. @param clock must outlive the lamp.
  /// @throws std::invalid_argument on an impossible profile or option.
  ModbusLamp(ModbusLampProfile profile, ModbusLampOptions options, std::shared_ptr<ModbusBus> bus,
             const Clock& clock);
  ~ModbusLamp() override;

  [[nodiscard]] const LampInfo& info() const override { return info_; }
  void set_level(double level, TimePoint deadline) override;
  [[nodiscard]] double level() const override { return level_; }

 private:
  void write(const RegisterWrites& writes, const RegisterFill& fill, TimePoint deadline);

  ModbusLampProfile profile_;
  ModbusLampOptions options_;
  std::shared_ptr<ModbusBus> bus_;
  const Clock& clock_;
  LampInfo info_;
  double level_ = 0.0;
  bool touched_ = false;  ///< something was written that may have lit it
  std::uint64_t set_up_connection_ = 0;
};

}  // namespace eigenpose
