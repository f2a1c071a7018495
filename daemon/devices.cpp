#include "daemon/devices.h"

#include <functional>
#include <map>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "config/modbus_profile.h"
#include "core/base/error.h"
#include "drivers/modbus/endpoint.h"
#include "drivers/modbus/modbus_axis.h"
#include "drivers/modbus/modbus_bus.h"
#include "drivers/modbus/modbus_lamp.h"
#include "drivers/v4l2/v4l2_camera.h"

namespace eigenpose {
namespace {

/// What the constructors below share while a configuration is turned into devices.
struct Workbench {
  const Config& config;
  const Clock& clock;
  std::map<std::string, std::shared_ptr<ModbusBus>> buses;  ///< by endpoint: devices on one line share it

  std::shared_ptr<ModbusBus> bus(const std::string& endpoint, const SerialDefaults& serial) {
    std::shared_ptr<ModbusBus>& found = buses[endpoint];
    if (!found) {
      ModbusBusOptions options;
      options.endpoint = parse_modbus_endpoint(endpoint, serial);
      found = std::make_shared<ModbusBus>(std::move(options), clock);
    }
    return found;
  }
};

// Cameras ------------------------------------------------------------------------------------------------

FrameHub::OpenCamera v4l2_camera(const CameraOptions& camera, Workbench& bench) {
  V4l2CameraOptions options;
  options.name = camera.name;
  options.selector = {camera.serial, camera.bus_path, "", camera.device.string()};
  options.mode.width = camera.width;
  options.mode.height = camera.height;
  options.mode.frames_per_second = camera.frames_per_second;
  options.mode.color = camera.color;
  if (const auto format = pixel_format_from_name(camera.format)) options.mode.formats = {*format};
  options.controls = {camera.controls.begin(), camera.controls.end()};
  options.lock_automatics = camera.lock_automatics;
  options.log = [](const std::string& facts) { spdlog::info("event=camera {}", facts); };
  const auto system = std::make_shared<LinuxVideoSystem>();
  return [options, system, &clock = bench.clock] {
    return std::make_unique<V4l2Camera>(options, *system, clock);
  };
}

// Axes ---------------------------------------------------------------------------------------------------

std::function<std::unique_ptr<Axis>()> modbus_axis(const AxisOptions& axis, Workbench& bench) {
  ModbusProfile profile =
      axis.profile.empty() ? oriental_motor_az_profile() : read_modbus_profile(axis.profile);
  const AxisDefaults& defaults = profile.defaults;
  ModbusAxisOptions options;
  options.name = axis.dof.name;
  options.dof = axis.dof;
  options.unit = axis.station;
  options.steps_per_unit = axis.steps_per_unit.value_or(defaults.steps_per_unit);
  options.reversed = axis.reversed;
  options.zero_offset = axis.home_offset;
  options.speed = axis.speed.value_or(defaults.speed);
  options.acceleration = defaults.acceleration;
  options.arrival_tolerance = axis.arrival_tolerance.value_or(defaults.arrival_tolerance);
  options.watchdog = defaults.watchdog;
  std::shared_ptr<ModbusBus> bus = bench.bus(axis.endpoint, profile.serial);
  return [profile = std::move(profile), options, bus = std::move(bus), &clock = bench.clock] {
    return std::make_unique<ModbusAxis>(profile, options, bus, clock);
  };
}

// Lamps --------------------------------------------------------------------------------------------------

std::function<std::unique_ptr<Lamp>()> modbus_lamp(const LampOptions& lamp, Workbench& bench) {
  ModbusLampProfile profile = read_modbus_lamp_profile(lamp.profile);
  const ModbusLampOptions options{lamp.name, lamp.station};
  std::shared_ptr<ModbusBus> bus = bench.bus(lamp.endpoint, profile.serial);
  return [profile = std::move(profile), options, bus = std::move(bus), &clock = bench.clock] {
    return std::make_unique<ModbusLamp>(profile, options, bus, clock);
  };
}

// The table ----------------------------------------------------------------------------------------------

const std::map<std::string, FrameHub::OpenCamera (*)(const CameraOptions&, Workbench&)> cameras = {
    {"v4l2", v4l2_camera},
};

const std::map<std::string, std::function<std::unique_ptr<Axis>()> (*)(const AxisOptions&, Workbench&)> axes =
    {
        {"modbus", modbus_axis},
};

const std::map<std::string, std::function<std::unique_ptr<Lamp>()> (*)(const LampOptions&, Workbench&)>
    lamps = {
        {"modbus", modbus_lamp},
};

/// The row of a table, and with it the device; what the driver refuses is the configuration's fault.
template <typename Table, typename Options>
auto look_up(const Table& table, const std::string& driver, const std::string& name, const Options& options,
             Workbench& bench) {
  const std::string where = fmt::format("{}: \"{}\"", bench.config.file.string(), name);
  const auto row = table.find(driver);
  if (row == table.end())
    throw ConfigError(fmt::format("{}: this eigenposed was built without the driver \"{}\"", where, driver));
  try {
    return row->second(options, bench);
  } catch (const std::invalid_argument& error) {
    throw ConfigError(fmt::format("{}: {}", where, error.what()));
  }
}

}  // namespace

Devices make_devices(const Config& config, const Clock& clock) {
  Devices devices;
  Workbench bench{config, clock, {}};
  if (config.camera)
    devices.camera = look_up(cameras, config.camera->driver, config.camera->name, *config.camera, bench);
  for (const AxisOptions& axis : config.axes)
    devices.axes.push_back({axis, look_up(axes, axis.driver, axis.dof.name, axis, bench)});
  for (const LampOptions& lamp : config.lamps)
    devices.lamps.push_back({lamp, look_up(lamps, lamp.driver, lamp.name, lamp, bench)});
  return devices;
}

}  // namespace eigenpose
