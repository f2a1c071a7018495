#include "daemon/hardware/checkup.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>

#include <fmt/format.h>
#include <grp.h>
#include <pwd.h>
#include <unistd.h>

#include "core/base/error.h"
#include "daemon/api/client/local_address.h"
#include "drivers/modbus/endpoint.h"
#include "drivers/v4l2/v4l2_camera.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;

Machine present(Machine machine) {
  if (!machine.user.empty()) return machine;
  const struct passwd* user = getpwuid(geteuid());
  machine.user = user == nullptr ? std::to_string(geteuid()) : user->pw_name;
  machine.is_root = geteuid() == 0;
  if (machine.groups.empty()) {
    std::vector<gid_t> ids(256);
    const int count = getgroups(static_cast<int>(ids.size()), ids.data());
    for (int i = 0; i < count; ++i) {
      const struct group* group = getgrgid(ids[static_cast<std::size_t>(i)]);
      if (group != nullptr) machine.groups.emplace_back(group->gr_name);
    }
  }
  return machine;
}

bool is_member(const Machine& machine, const std::string& group) {
  return machine.is_root ||
         std::find(machine.groups.begin(), machine.groups.end(), group) != machine.groups.end();
}

void check_folder(const fs::path& folder, const char* key, const Report& report) {
  std::error_code failed;
  if (fs::is_directory(folder, failed)) {
    if (access(folder.c_str(), W_OK | X_OK) == 0) {
      report({Health::good, key, folder.string() + " can be written", {}});
    } else {
      report({Health::note, key, folder.string() + " cannot be written by this user",
              "the service's user needs it, you do not; to run eigenposed by hand give --runtime-dir and "
              "--state-dir"});
    }
    return;
  }
  fs::path above = folder;
  while (!above.empty() && above != "/" && !fs::exists(above, failed)) above = above.parent_path();
  if (access(above.c_str(), W_OK) == 0) {
    report({Health::good, key, folder.string() + " will be made at the start", {}});
  } else {
    report(
        {Health::note, key, folder.string() + " is not there and this user cannot make it",
         "systemd makes it for the service; to run eigenposed by hand give --runtime-dir and --state-dir"});
  }
}

void check_rules(const Machine& machine, const Report& report) {
  for (const char* folder : {"etc/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d"}) {
    const fs::path rules = machine.root / folder / "60-eigenpose.rules";
    std::error_code failed;
    if (fs::exists(rules, failed)) {
      report({Health::good, "udev rules", rules.string() + " is installed", {}});
      return;
    }
  }
  report({Health::fault, "udev rules",
          "60-eigenpose.rules is not installed, so USB devices belong to root alone",
          "cp systemd/60-eigenpose.rules /etc/udev/rules.d/ && udevadm control --reload && udevadm trigger"});
}

void check_node(const Machine& machine, const std::string& subject, const fs::path& node, bool accessible,
                const Report& report) {
  if (accessible) {
    report({Health::good, subject, node.string() + " may be opened by " + machine.user, {}});
    return;
  }
  const std::string group = group_of(node);
  if (!group.empty() && group != "root" && !is_member(machine, group)) {
    report(
        {Health::fault, subject,
         fmt::format("{} belongs to the group '{}', and {} is not in it", node.string(), group, machine.user),
         fmt::format("adduser {} {}, then log in again", machine.user, group)});
  } else {
    report({Health::fault, subject, fmt::format("{} may not be opened by {}", node.string(), machine.user),
            "install the udev rules (see there) and plug the device in again"});
  }
}

/// "rtu:/dev/ttyUSB0:115200:8E1" → "/dev/ttyUSB0"; nothing for another kind of endpoint.
std::optional<std::string> port_of(const std::string& endpoint) {
  if (!endpoint.starts_with("rtu:")) return std::nullopt;
  try {
    // Names below /dev/serial/by-path have colons of their own, which the driver's own reader knows.
    return std::get<ModbusRtuEndpoint>(parse_modbus_endpoint(endpoint)).device;
  } catch (const std::invalid_argument&) {
    return std::nullopt;  // a fault of the configuration, which making the devices tells
  }
}

/// "usb:SERIAL" → SERIAL; nothing for another kind of endpoint.
std::optional<std::string> serial_of(const std::string& endpoint) {
  constexpr std::string_view scheme = "usb:";
  if (!endpoint.starts_with(scheme)) return std::nullopt;
  return endpoint.substr(scheme.size());
}

void check_serial_port(const Machine& machine, const std::string& subject, const std::string& port,
                       const Inventory& inventory, const Report& report) {
  const fs::path node = machine.root / fs::path(port).relative_path();
  std::error_code failed;
  if (!fs::exists(node, failed)) {
    std::string others;
    for (const SerialPortFound& found : inventory.serial_ports) {
      others += (others.empty() ? "" : ", ") + (found.by_id.empty() ? found.path : found.by_id);
    }
    report({Health::fault, subject, "there is no " + port,
            others.empty() ? "plug in the serial adapter; no other is there"
                           : "plug in the adapter, or set the endpoint to one that is there: " + others});
    return;
  }
  check_node(machine, subject, node, is_accessible(node), report);
  if (port.starts_with("/dev/ttyUSB") || port.starts_with("/dev/ttyACM")) {
    for (const SerialPortFound& found : inventory.serial_ports) {
      if (found.path != node.string() || found.by_id.empty()) continue;
      report({Health::note, subject, port + " changes with the order of plugging in",
              "set the endpoint to " + found.by_id});
    }
  }
}

void check_usb(const Machine& machine, const std::string& subject, const std::string& serial,
               const Inventory& inventory, const Report& report) {
  std::string others;
  for (const UsbFound& usb : inventory.usb) {
    if (usb.serial == serial) {
      check_node(machine, subject, usb.node, usb.accessible, report);
      return;
    }
    others += (others.empty() ? "" : ", ") + usb.serial + " (" + usb.name + ")";
  }
  report({Health::fault, subject, "no USB device with the serial number " + serial + " is plugged in",
          others.empty()
              ? "plug it in and switch it on; no FTDI device is there"
              : "plug it in and switch it on, or set the endpoint to one that is there: " + others});
}

/// The service runs as a user of its own, who must be there and in the groups that open its devices.
void check_service_user(const Machine& machine, const Report& report) {
  const std::string user = "eigenpose";
  const auto find = [&](const char* file, const std::string& name) {
    std::ifstream lines(machine.root / file);
    for (std::string line; std::getline(lines, line);)
      if (line.starts_with(name + ":")) return line;
    return std::string();
  };
  if (find("etc/passwd", user).empty()) {
    report({Health::note, "service user", "there is no user '" + user + "', as whom the service runs",
            "cp systemd/eigenpose.sysusers /etc/sysusers.d/eigenpose.conf && systemd-sysusers"});
    return;
  }
  for (const char* group : {"video", "dialout"}) {
    const std::string line = find("etc/group", group);
    const std::string members = "," + line.substr(line.rfind(':') + 1) + ",";
    if (!line.empty() && members.find("," + user + ",") == std::string::npos)
      report({Health::note, "service user", fmt::format("'{}' is not in the group '{}'", user, group),
              fmt::format("adduser {} {}, then systemctl restart eigenposed", user, group)});
  }
}

void check_camera_node(const Machine& machine, const CameraOptions& camera, const Inventory& inventory,
                       const Report& report) {
  if (camera.driver != "v4l2") return;
  const CameraSelector selector{camera.serial, camera.bus_path, "", camera.device.string()};
  const VideoNode* forbidden = nullptr;
  bool usable = false;
  for (const CameraFound& found : inventory.cameras) {
    if (!is_meant(found.node, selector)) continue;
    usable = usable || (found.node.open_error == 0 && found.node.can_capture);
    if (found.node.open_error == EACCES) forbidden = &found.node;
  }
  if (forbidden != nullptr && !usable) {
    check_node(machine, "camera", forbidden->path, false, report);
    return;
  }
  if (camera.serial.empty() && camera.bus_path.empty()) {
    report({Health::note, "camera", "the configuration names neither serial number nor bus path",
            "set serial or bus_path in [camera], so that no other camera is ever taken for it; 'eigenpose "
            "devices' lists them"});
  }
}

/// What a picture tells of lens cap and exposure. Shares are of all pixels.
void check_picture(const Frame& frame, const Report& report) {
  const cv::Mat flat = frame.image.reshape(1);
  const double full = flat.depth() == CV_16U ? 65535.0 : 255.0;
  const double mean = cv::mean(flat)[0] / full;
  const double saturated =
      static_cast<double>(cv::countNonZero(flat >= full)) / static_cast<double>(flat.total());
  if (mean < 0.004) {
    report({Health::note, "picture", "it is black",
            "take off the lens cap, switch on the lamp, or set a longer exposure"});
  } else if (saturated > 0.05) {
    report({Health::note, "picture", fmt::format("{:.0f} % of it is saturated", 100.0 * saturated),
            "set a shorter exposure or less gain in [camera.controls]"});
  } else {
    report({Health::good,
            "picture",
            fmt::format("mean level {:.0f} %, {:.1f} % saturated", 100.0 * mean, 100.0 * saturated),
            {}});
  }
}

/// A failure in words, without the device's name, which is the finding's subject.
std::string words_of(const DeviceError& error) {
  const std::string words = error.what();
  const std::string name = error.device() + ": ";
  return words.starts_with(name) ? words.substr(name.size()) : words;
}

/// ": 3 cut short, 1 too short"; empty where the camera gives no reasons.
std::string damage_words(const CameraStatistics& counts) {
  std::string words;
  for (std::size_t fault = 0; fault < frame_fault_count; ++fault)
    if (counts.damaged_by[fault] > 0)
      words += fmt::format("{} {} {}", words.empty() ? ":" : ",", counts.damaged_by[fault],
                           name_of(static_cast<FrameFault>(fault)));
  return words;
}

void check_camera(const Devices& devices, const Clock& clock, const std::stop_token& stop,
                  const Report& report) {
  const std::unique_ptr<Camera> camera = devices.camera();
  const CameraInfo& info = camera->info();
  report({Health::good,
          "camera",
          fmt::format("{} (serial {}): {} {}x{} at {:.3g} fps", info.model,
                      info.serial.empty() ? "none" : info.serial, info.format, info.width, info.height,
                      info.frames_per_second),
          {}});
  constexpr int frames = 10;
  Frame frame;
  try {
    for (int i = 0; i < frames; ++i) frame = camera->next_frame(clock.now() + seconds(5), stop);
  } catch (const DeviceTimeout& timeout) {
    const std::uint64_t damaged = camera->statistics().frames_damaged;
    report({Health::fault, "camera", words_of(timeout),
            damaged > 0 ? "try another cable or USB port, or another format in [camera]"
                        : "see that nothing else uses the camera, that its trigger is off, and that its USB "
                          "port has the bandwidth for this size and rate"});
    return;
  }
  const CameraStatistics counts = camera->statistics();
  if (counts.frames_damaged > 0) {
    report({Health::note, "camera",
            fmt::format("{} of {} frames came damaged{}", counts.frames_damaged,
                        frames + counts.frames_damaged, damage_words(counts)),
            "try another cable or USB port"});
  }
  check_picture(frame, report);
}

void check_axis(const RigAxis& axis, const Clock& clock, const Report& report) {
  const std::string& name = axis.options.dof.name;
  const std::unique_ptr<Axis> opened = axis.open();
  const AxisState state = opened->state(clock.now() + seconds(3));
  const std::string subject = "axis " + name;
  if (state.alarm) {
    report({Health::fault, subject, "the drive raises an alarm: " + *state.alarm,
            "remove the cause, then 'eigenpose home " + name + "'"});
    return;
  }
  report({Health::good,
          subject,
          fmt::format("{} answers: at {:.2f} {}{}", opened->info().model, state.position,
                      axis.options.dof.unit, state.moving ? ", moving" : ""),
          {}});
  if (!state.homed) {
    report({Health::note, subject, "it has not been homed, so its position means nothing yet",
            "the service homes it before the first move; by hand: 'eigenpose home " + name + "'"});
  }
}

void check_lamp(const RigLamp& lamp, const Clock& clock, const Report& report) {
  const std::unique_ptr<Lamp> opened = lamp.open();
  opened->set_level(0.0, clock.now() + seconds(3));
  report({Health::good, "lamp " + lamp.options.name, opened->info().model + " answers", {}});
}

/// Runs one check; a failing device is a finding, not the end.
template <class Check>
void guarded(const std::string& subject, const std::stop_token& stop, const Report& report,
             const Check& check) {
  if (stop.stop_requested()) throw Interrupted();
  try {
    check();
  } catch (const Interrupted&) {
    throw;
  } catch (const DeviceLost& lost) {
    report({Health::fault, subject, words_of(lost),
            "see that it is plugged in, switched on, and named rightly in the configuration"});
  } catch (const DeviceTimeout& timeout) {
    report({Health::fault, subject, words_of(timeout),
            "see that it is switched on, and that address and line settings are the device's"});
  } catch (const std::exception& error) {
    report({Health::fault, subject, error.what(),
            "see that the configuration describes this device: endpoint, station, profile, controls"});
  }
}

}  // namespace

void check_machine(const Machine& given, const Config& config, const Inventory& inventory,
                   const Report& report) {
  const Machine machine = present(given);
  check_folder(config.daemon.runtime_dir, "runtime_dir", report);
  check_folder(config.daemon.state_dir, "state_dir", report);
  check_service_user(machine, report);

  bool needs_rules = false;
  if (config.camera) check_camera_node(machine, *config.camera, inventory, report);
  const auto check_endpoint = [&](const std::string& subject, const std::string& endpoint) {
    if (const auto port = port_of(endpoint)) {
      check_serial_port(machine, subject, *port, inventory, report);
    } else if (const auto serial = serial_of(endpoint)) {
      needs_rules = true;
      check_usb(machine, subject, *serial, inventory, report);
    }
  };
  for (const AxisOptions& axis : config.axes) check_endpoint("axis " + axis.dof.name, axis.endpoint);
  for (const LampOptions& lamp : config.lamps) check_endpoint("lamp " + lamp.name, lamp.endpoint);
  if (needs_rules) check_rules(machine, report);

  std::error_code failed;
  if (fs::exists(machine.root / "usr/sbin/ModemManager", failed) && !inventory.serial_ports.empty()) {
    report({Health::note, "ModemManager",
            "it talks to serial ports when they are plugged in, and may disturb a drive",
            "install the udev rules, which keep it off, or: apt-get remove modemmanager"});
  }
}

void check_found(const Machine& given, const Inventory& inventory, const Report& report) {
  const Machine machine = present(given);
  check_service_user(machine, report);
  for (const CameraFound& camera : inventory.cameras)
    if (camera.node.can_capture || camera.node.open_error != 0)
      check_node(machine, "camera", camera.node.path, camera.node.open_error == 0, report);
  for (const SerialPortFound& port : inventory.serial_ports)
    check_node(machine, "serial port", port.path, port.accessible, report);
  for (const UsbFound& usb : inventory.usb)
    check_node(machine, "USB " + usb.serial, usb.node, usb.accessible, report);
  if (!inventory.usb.empty()) check_rules(machine, report);
  if (inventory.cameras.empty() && inventory.serial_ports.empty() && inventory.usb.empty())
    report({Health::note, "devices", "no camera, serial port or FTDI chip is plugged in",
            "none is needed for the simulated lab: sim/demo"});
}

void check_devices(const Devices& devices, const Clock& clock, const std::stop_token& stop,
                   const Report& report) {
  if (devices.camera) guarded("camera", stop, report, [&] { check_camera(devices, clock, stop, report); });
  for (const RigAxis& axis : devices.axes) {
    guarded("axis " + axis.options.dof.name, stop, report, [&] { check_axis(axis, clock, report); });
  }
  for (const RigLamp& lamp : devices.lamps) {
    guarded("lamp " + lamp.options.name, stop, report, [&] { check_lamp(lamp, clock, report); });
  }
}

bool is_service_running(const Config& config) {
  return is_answered(config.results_socket());
}

}  // namespace eigenpose
