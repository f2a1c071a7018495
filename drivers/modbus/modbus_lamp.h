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
///
/// The register that the level is written to is read back where the dimmer lets it be read: after each level,
/// which must then stand there, and before the next, which shows a dimmer that has lost it. Of a dimmer whose
/// register cannot be read or shows something else only a lost connection is noticed.
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
  [[nodiscard]] std::uint64_t interruptions() const override { return interruptions_; }

 private:
  enum class ReadBack { untried, works, impossible };

  void write(const RegisterWrites& writes, const RegisterFill& fill, TimePoint deadline);
  /// Writes the level on a connection on which `connect` was written before.
  void write_level(const RegisterFill& fill, TimePoint deadline);
  [[nodiscard]] std::int64_t read_level(TimePoint deadline);
  /// @throws DeviceError when the dimmer shows another level than was just written.
  void check_level(std::int64_t written, TimePoint deadline);

  ModbusLampProfile profile_;
  ModbusLampOptions options_;
  std::shared_ptr<ModbusBus> bus_;
  const Clock& clock_;
  LampInfo info_;
  double level_ = 0.0;
  bool touched_ = false;  ///< something was written that may have lit it
  RegisterNumber level_register_;
  ReadBack read_back_ = ReadBack::untried;  ///< on this connection
  std::int64_t written_ = 0;                ///< what stands in the register if it works
  std::uint64_t set_up_connection_ = 0;
  std::uint64_t lit_connection_ = 0;  ///< on which the level was last written; 0: none
  std::uint64_t interruptions_ = 0;
};

}  // namespace eigenpose
