/// `eigenpose devices`: what is plugged in.

#include <cstdio>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "daemon/cli/hardware_commands.h"
#include "daemon/hardware/inventory.h"

namespace eigenpose::cli {
namespace {

void print_inventory(const Inventory& found, bool details) {
  std::printf("Cameras:\n");
  for (const CameraFound& camera : found.cameras) {
    if (!camera.node.can_capture && camera.node.open_error == 0) continue;  // a camera's metadata node
    const VideoNode& node = camera.node;
    std::printf("  %s  %s\n      serial = \"%s\"  bus_path = \"%s\"\n", node.path.c_str(), node.name.c_str(),
                node.serial.c_str(), (node.bus_info.empty() ? node.port : node.bus_info).c_str());
    if (node.open_error != 0) std::printf("      cannot be opened; 'eigenpose doctor' says what to do\n");
    const std::size_t shown = details ? camera.modes.size() : std::min<std::size_t>(camera.modes.size(), 6);
    for (std::size_t i = 0; i < shown; ++i) std::printf("      %s\n", camera.modes[i].c_str());
    if (shown < camera.modes.size())
      std::printf("      … and %zu more modes (--details)\n", camera.modes.size() - shown);
    if (!details) continue;
    for (const std::string& control : camera.controls) std::printf("      control %s\n", control.c_str());
  }
  if (found.cameras.empty()) std::printf("  none\n");

  std::printf("Serial ports:\n");
  for (const SerialPortFound& port : found.serial_ports) {
    std::printf("  %s  %s%s\n      endpoint = \"rtu:%s\"\n", port.path.c_str(), port.name.c_str(),
                port.accessible ? "" : "  (not accessible to this user)",
                (port.by_id.empty() ? port.path : port.by_id).c_str());
  }
  if (found.serial_ports.empty()) std::printf("  none\n");

  std::printf("USB devices with an FTDI chip:\n");
  for (const UsbFound& usb : found.usb) {
    std::printf("  %s  %s%s\n      endpoint = \"usb:%s\"\n", usb.numbers.c_str(), usb.name.c_str(),
                usb.accessible ? "" : "  (not accessible to this user)", usb.serial.c_str());
  }
  if (found.usb.empty()) std::printf("  none\n");
}

nlohmann::json to_json(const Inventory& found) {
  nlohmann::json cameras = nlohmann::json::array(), ports = cameras, usb = cameras;
  for (const CameraFound& camera : found.cameras) {
    const VideoNode& node = camera.node;
    cameras.push_back({{"device", node.path},
                       {"name", node.name},
                       {"driver", node.driver},
                       {"serial", node.serial},
                       {"bus_path", node.bus_info.empty() ? node.port : node.bus_info},
                       {"can_capture", node.can_capture},
                       {"accessible", node.open_error == 0},
                       {"modes", camera.modes},
                       {"controls", camera.controls}});
  }
  for (const SerialPortFound& port : found.serial_ports) {
    ports.push_back({{"device", port.path},
                     {"by_id", port.by_id},
                     {"serial", port.serial},
                     {"name", port.name},
                     {"accessible", port.accessible}});
  }
  for (const UsbFound& device : found.usb) {
    usb.push_back({{"numbers", device.numbers},
                   {"serial", device.serial},
                   {"name", device.name},
                   {"port", device.port},
                   {"accessible", device.accessible}});
  }
  return {{"cameras", cameras}, {"serial_ports", ports}, {"usb", usb}};
}

}  // namespace

void add_devices_command(CLI::App& app, CommandLine& line) {
  struct Options {
    bool details = false;
    bool json = false;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "devices", "List cameras, serial ports and USB devices, as the configuration names them");
  command->add_flag("--details", options->details, "All modes and controls of each camera");
  command->add_flag("--json", options->json, "Print as JSON");
  command->footer("What is printed as KEY = \"…\" can be copied into the configuration.");
  command->callback([options, &line] {
    line.action = [options] {
      const Inventory found = take_inventory();
      if (options->json) {
        std::printf("%s\n", to_json(found).dump(2).c_str());
      } else {
        print_inventory(found, options->details);
      }
      return static_cast<int>(exit_done);
    };
  });
}

}  // namespace eigenpose::cli
