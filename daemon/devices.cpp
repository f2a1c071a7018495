#include "daemon/devices.h"

#include <functional>
#include <map>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "config/modbus_profile.h"
#include "core/base/error.h"
#include "daemon/device_check.h"
#include "drivers/modbus/endpoint.h"
#include "drivers/modbus/modbus_axis.h"
#include "drivers/modbus/modbus_bus.h"
#include "drivers/modbus/modbus_lamp.h"
#include "drivers/usb/apt_axis.h"
#include "drivers/usb/enttec_dmx_lamp.h"
#include "drivers/usb/ftdi_link.h"
#include "drivers/v4l2/v4l2_camera.h"
#ifdef EIGENPOSE_SIM
#include "sim/camera/replay_camera.h"
#include "sim/camera/sim_camera.h"
#include "sim/lab/lab_server.h"
#include "sim/lab/sim_lab.h"
#include "sim/lab/sim_lamp.h"
#include "sim/modbus/modbus_server.h"
#include "sim/modbus/pdu_server.h"
#include "sim/usb/apt_controller.h"
#include "sim/usb/sim_link.h"
#endif

namespace eigenpose {
namespace {

#ifdef EIGENPOSE_SIM
/// The simulated lab with its drives and its control, in the order they depend on each other.
struct SimulatedLab {
  SimulatedLab(const SimOptions& options, const Clock& clock) : lab(clock, {.seed = options.seed}) {}
  /// Opens the drives' port and the control socket.
  void start(const SimOptions& options, const std::filesystem::path& socket) {
    drives = std::make_unique<sim::SimModbusServer>(
        lab, sim::SimModbusServerOptions{.speed_factor = options.speed_factor});
    control = std::make_unique<sim::LabServer>(lab, socket, drives.get());
  }
  sim::SimLab lab;
  std::unique_ptr<sim::SimModbusServer> drives;
  std::unique_ptr<sim::LabServer> control;
};
#else
struct SimulatedLab;
#endif

/// What the makers below share while a configuration is turned into devices.
struct Workbench {
  const Config& config;
  const Clock& clock;
  std::shared_ptr<SimulatedLab> lab;  ///< null without [sim]
  std::optional<SimulationInfo> simulation;
  std::map<std::string, std::shared_ptr<ModbusBus>> buses;          ///< by line: devices on one line share it
  std::map<std::string, std::shared_ptr<EnttecDmxWidget>> widgets;  ///< by USB serial number: likewise

  /// @throws std::invalid_argument when two devices want one serial line set in different ways.
  std::shared_ptr<ModbusBus> bus(const std::string& endpoint, const SerialDefaults& serial) {
    ModbusBusOptions options;
    const bool simulated = endpoint == "simulated" && simulation;
    options.endpoint = parse_modbus_endpoint(
        simulated ? fmt::format("tcp://127.0.0.1:{}", simulation->modbus_port) : endpoint, serial);
    std::shared_ptr<ModbusBus>& found = buses[line_name(options.endpoint)];
    auto wanted = std::make_shared<ModbusBus>(std::move(options), clock);
    if (!found) found = wanted;
    const bool serial_line = endpoint.starts_with("rtu:");
    if (serial_line && found->description() != wanted->description())
      throw std::invalid_argument(
          fmt::format("one line cannot be set in two ways: {}, and {} for another "
                      "device; give baud rate and frame in each endpoint",
                      wanted->description(), found->description()));
    return found;
  }
};

// Cameras ------------------------------------------------------------------------------------------------

FrameHub::OpenCamera v4l2_camera(const CameraOptions& camera, Workbench& bench) {
  V4l2CameraOptions options;
  options.name = camera.name;
  options.selector = {camera.serial, camera.bus_path, "", camera.device.string()};
  options.input = camera.input;
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

#ifdef EIGENPOSE_SIM
FrameHub::OpenCamera simulated_camera(const CameraOptions& camera, Workbench& bench) {
  sim::SimCameraOptions options;
  options.name = camera.name;
  options.width = camera.width;
  options.height = camera.height;
  options.frames_per_second = camera.frames_per_second;
  options.exposure = std::chrono::microseconds(static_cast<std::int64_t>(camera.exposure_ms * 1000.0));
  return [options, lab = bench.lab] { return std::make_unique<sim::SimCamera>(lab->lab, options); };
}

FrameHub::OpenCamera replay_camera(const CameraOptions& camera, Workbench& bench) {
  sim::ReplayCameraOptions options;
  options.name = camera.name;
  options.folder = camera.folder;
  options.degrees_per_index = camera.degrees_per_index;
  options.frames_per_second = camera.frames_per_second;
  return [options, lab = bench.lab] { return std::make_unique<sim::ReplayCamera>(lab->lab, options); };
}
#endif

// Axes ---------------------------------------------------------------------------------------------------

/// @throws std::invalid_argument when the simulated lab has no drive there.
void check_simulated_station([[maybe_unused]] int station) {
#ifdef EIGENPOSE_SIM
  std::string known;
  for (const sim::DriveOptions& drive : sim::default_drives()) {
    if (drive.unit == station) return;
    known += (known.empty() ? "" : ", ") + std::to_string(drive.unit);
  }
  throw std::invalid_argument(
      fmt::format("the simulated lab has no drive at station {}; it has: {}", station, known));
#endif
}

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
  if (axis.endpoint == "simulated") check_simulated_station(axis.station);
  std::shared_ptr<ModbusBus> bus = bench.bus(axis.endpoint, profile.serial);
  return [profile = std::move(profile), options, bus = std::move(bus), &clock = bench.clock] {
    return std::make_unique<ModbusAxis>(profile, options, bus, clock);
  };
}

/// "usb:SERIAL" → SERIAL.
std::string usb_serial(const std::string& endpoint) {
  constexpr std::string_view scheme = "usb:";
  if (!endpoint.starts_with(scheme) || endpoint.size() == scheme.size())
    throw std::invalid_argument(
        fmt::format("endpoint \"{}\": a device on USB is named \"usb:SERIAL\"", endpoint));
  return endpoint.substr(scheme.size());
}

#ifdef EIGENPOSE_SIM
/// The simulated light arm on an APT controller, and the cable to it.
struct SimulatedArm {
  SimulatedArm(std::shared_ptr<SimulatedLab> lab_it_stands_in, const sim::AptControllerOptions& options,
               const Clock& clock)
      : lab(std::move(lab_it_stands_in)), controller(lab->lab, options), cable(controller, clock) {}
  std::shared_ptr<SimulatedLab> lab;
  sim::AptController controller;
  sim::Cable cable;
};

std::shared_ptr<SimulatedArm> simulated_arm(const AptStage& stage, Workbench& bench) {
  if (stage.unit != "deg")
    throw std::invalid_argument(
        fmt::format("the simulated arm turns, and {} moves in {}", stage.name, stage.unit));
  sim::AptControllerOptions options;
  options.model = stage.name;
  options.stepper = stage.stepper;
  options.counts_per_degree = stage.counts_per_unit;
  options.velocity_per_degree = stage.velocity_per_unit;
  options.acceleration_per_degree = stage.acceleration_per_unit;
  options.speed_factor = bench.config.sim->speed_factor;
  return std::make_shared<SimulatedArm>(bench.lab, options, bench.clock);
}
#endif

std::function<std::unique_ptr<Axis>()> apt_axis(const AxisOptions& axis, Workbench& bench) {
  AptAxisOptions options;
  options.name = axis.dof.name;
  options.dof = axis.dof;
  options.stage = apt_stage(axis.stage);
  options.reversed = axis.reversed;
  options.zero_offset = axis.home_offset;
  options.speed = axis.speed.value_or(0.0);
  options.arrival_tolerance = axis.arrival_tolerance.value_or(0.0);
#ifdef EIGENPOSE_SIM
  if (axis.endpoint == "simulated")
    return [options, arm = simulated_arm(options.stage, bench), &clock = bench.clock] {
      return std::make_unique<AptAxis>(options, std::make_unique<sim::SimLink>(arm->cable, clock), clock);
    };
#endif
  FtdiLinkOptions link;
  link.serial = usb_serial(axis.endpoint);
  link.flow_control = FtdiFlowControl::rts_cts;
  return [options, link, &clock = bench.clock] {
    return std::make_unique<AptAxis>(options, std::make_unique<FtdiLink>(link, clock), clock);
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

#ifdef EIGENPOSE_SIM
std::function<std::unique_ptr<Lamp>()> simulated_lamp(const LampOptions& lamp, Workbench& bench) {
  return [name = lamp.name, lab = bench.lab] { return std::make_unique<sim::SimLamp>(lab->lab, name); };
}
#endif

std::function<std::unique_ptr<Lamp>()> dmx_lamp(const LampOptions& lamp, Workbench& bench) {
  std::shared_ptr<EnttecDmxWidget>& widget = bench.widgets[usb_serial(lamp.endpoint)];
  if (!widget) {
    FtdiLinkOptions link;
    link.serial = usb_serial(lamp.endpoint);
    link.baud = 57600;
    widget = std::make_shared<EnttecDmxWidget>(EnttecDmxWidgetOptions{},
                                               std::make_unique<FtdiLink>(link, bench.clock), bench.clock);
  }
  EnttecDmxLampOptions options;
  options.name = lamp.name;
  options.channels = {{lamp.channel, 1.0}};
  return [options, widget, &clock = bench.clock] {
    return std::make_unique<EnttecDmxLamp>(options, widget, clock);
  };
}

// The table ----------------------------------------------------------------------------------------------

const std::map<std::string, FrameHub::OpenCamera (*)(const CameraOptions&, Workbench&)> cameras = {
    {"v4l2", v4l2_camera},
#ifdef EIGENPOSE_SIM
    {"simulated", simulated_camera},
    {"replay", replay_camera},
#endif
};

const std::map<std::string, std::function<std::unique_ptr<Axis>()> (*)(const AxisOptions&, Workbench&)> axes =
    {
        {"modbus", modbus_axis},
        {"apt", apt_axis},
};

const std::map<std::string, std::function<std::unique_ptr<Lamp>()> (*)(const LampOptions&, Workbench&)>
    lamps = {
        {"modbus", modbus_lamp},
        {"dmx", dmx_lamp},
#ifdef EIGENPOSE_SIM
        {"simulated", simulated_lamp},
#endif
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

/// Two ways to the one simulated arm: its Modbus drive, and its APT controller.
void refuse_simulated_arm_twice([[maybe_unused]] const Config& config) {
#ifdef EIGENPOSE_SIM
  std::string modbus;
  std::string apt;
  for (const AxisOptions& axis : config.axes) {
    if (axis.endpoint != "simulated") continue;
    if (axis.driver == "apt") apt = axis.dof.name;
    for (const sim::DriveOptions& drive : sim::default_drives())
      if (axis.driver == "modbus" && drive.unit == axis.station && drive.axis == sim::LabAxis::arm_azimuth)
        modbus = axis.dof.name;
  }
  if (!modbus.empty() && !apt.empty())
    throw ConfigError(fmt::format(
        "{}: axis \"{}\" and axis \"{}\" would both turn the simulated light arm; leave one of them out",
        config.file.string(), modbus, apt));
#endif
}

std::shared_ptr<SimulatedLab> make_lab([[maybe_unused]] const Config& config,
                                       [[maybe_unused]] const Clock& clock) {
#ifdef EIGENPOSE_SIM
  return std::make_shared<SimulatedLab>(*config.sim, clock);
#else
  throw ConfigError(config.file.string() + ": [sim]: this eigenposed was built without the simulated lab");
#endif
}

void start_lab([[maybe_unused]] Workbench& bench) {
#ifdef EIGENPOSE_SIM
  bench.lab->start(*bench.config.sim, bench.config.lab_socket());
  bench.simulation = SimulationInfo{bench.config.lab_socket(), bench.lab->drives->port()};
  spdlog::info("event=simulated_lab control={} modbus_port={}", bench.simulation->lab_socket.string(),
               bench.simulation->modbus_port);
#endif
}

Devices devices_on(Workbench& bench) {
  const Config& config = bench.config;
  refuse_simulated_arm_twice(config);
  Devices devices;
  if (config.camera)
    devices.camera = look_up(cameras, config.camera->driver, config.camera->name, *config.camera, bench);
  for (const AxisOptions& axis : config.axes)
    devices.axes.push_back(
        {{axis.dof, axis.settle, axis.move_timeout}, look_up(axes, axis.driver, axis.dof.name, axis, bench)});
  for (const LampOptions& lamp : config.lamps)
    devices.lamps.push_back({{lamp.name, lamp.level}, look_up(lamps, lamp.driver, lamp.name, lamp, bench)});
  devices.lab = bench.lab;
  devices.simulation = bench.simulation;
  return devices;
}

}  // namespace

Devices make_devices(const Config& config, const Clock& clock) {
  Workbench bench{config, clock, nullptr, std::nullopt, {}, {}};
  if (config.sim) {
    bench.lab = make_lab(config, clock);
    start_lab(bench);
  }
  return devices_on(bench);
}

void check_device_options(const Config& config) {
  const SteadyClock clock;
  Workbench bench{config, clock, nullptr, std::nullopt, {}, {}};
  if (config.sim) {
    bench.lab = make_lab(config, clock);
    bench.simulation = SimulationInfo{config.lab_socket(), 502};  // any port: nobody connects
  }
  const Devices devices = devices_on(bench);
  // A driver checks its options when it is made, and touches its device only later; but a real camera is
  // opened at once.
  const auto check = [&](const std::string& name, const auto& make) {
    try {
      (void)make();
    } catch (const std::invalid_argument& error) {
      throw ConfigError(fmt::format("{}: \"{}\": {}", config.file.string(), name, error.what()));
    }
  };
  if (config.camera && config.camera->driver != "v4l2") check(config.camera->name, devices.camera);
  for (const RigAxis& axis : devices.axes) check(axis.options.dof.name, axis.open);
  for (const RigLamp& lamp : devices.lamps) check(lamp.options.name, lamp.open);
}

}  // namespace eigenpose
