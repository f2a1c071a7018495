#include "daemon/hardware/inventory.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <set>

#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/v4l2/camera_controls.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;

std::string first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

/// Entries of a folder, by name; none if it is not there.
std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> all;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed)) all.push_back(entry.path());
  std::sort(all.begin(), all.end());
  return all;
}

/// The USB device that a sysfs path belongs to; empty if none.
fs::path usb_device_above(const fs::path& path) {
  std::error_code failed;
  for (fs::path up = fs::canonical(path, failed); !failed && up.has_relative_path(); up = up.parent_path()) {
    if (fs::exists(up / "idVendor", failed)) return up;
  }
  return {};
}

std::string usb_name(const fs::path& device) {
  const std::string maker = first_line(device / "manufacturer"), product = first_line(device / "product");
  return maker.empty() ? product : product.empty() ? maker : maker + " " + product;
}

std::vector<CameraFound> find_cameras(const fs::path& root) {
  std::vector<CameraFound> cameras;
  LinuxVideoSystem system((root / "dev").string(), (root / "sys").string());
  for (VideoNode& node : system.nodes()) {
    CameraFound camera;
    int error = 0;
    if (const auto device = node.can_capture ? system.open(node.path, error) : nullptr) {
      std::set<std::string> seen;
      for (const CaptureMode& mode : offered_modes(*device, {})) {
        if (seen.insert(to_string(mode)).second) camera.modes.push_back(to_string(mode));
      }
      const CameraControls controls(*device);
      for (const ControlInfo& control : controls.list()) {
        const auto value = controls.read(control);
        if (!control.settable || !value) continue;
        camera.controls.push_back(control.name + " " + std::to_string(control.minimum) + "…" +
                                  std::to_string(control.maximum) + ", now " + std::to_string(*value));
      }
    }
    camera.node = std::move(node);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

std::vector<SerialPortFound> find_serial_ports(const fs::path& root) {
  std::vector<SerialPortFound> ports;
  for (const fs::path& entry : entries(root / "sys/class/tty")) {
    // Terminals without hardware have no device; the PC's own ttyS0…31 exist whether or not a plug does.
    std::error_code failed;
    const std::string name = entry.filename();
    if (!fs::exists(entry / "device", failed) || name.starts_with("ttyS")) continue;
    SerialPortFound port;
    port.path = (root / "dev" / name).string();
    const fs::path usb = usb_device_above(entry / "device");
    if (!usb.empty()) {
      port.serial = first_line(usb / "serial");
      port.name = usb_name(usb);
    }
    for (const fs::path& link : entries(root / "dev/serial/by-id")) {
      if (fs::canonical(link, failed).filename() == name) port.by_id = link.string();
    }
    port.accessible = is_accessible(port.path);
    ports.push_back(std::move(port));
  }
  return ports;
}

std::vector<UsbFound> find_usb(const fs::path& root) {
  std::vector<UsbFound> found;
  for (const fs::path& entry : entries(root / "sys/bus/usb/devices")) {
    const std::string vendor = first_line(entry / "idVendor");
    if (vendor != "0403") continue;
    UsbFound usb;
    usb.numbers = vendor + ":" + first_line(entry / "idProduct");
    usb.serial = first_line(entry / "serial");
    usb.name = usb_name(entry);
    usb.port = entry.filename();
    char node[64];
    std::snprintf(node, sizeof node, "dev/bus/usb/%03d/%03d", std::atoi(first_line(entry / "busnum").c_str()),
                  std::atoi(first_line(entry / "devnum").c_str()));
    usb.node = (root / node).string();
    usb.accessible = is_accessible(usb.node);
    found.push_back(std::move(usb));
  }
  return found;
}

}  // namespace

bool is_accessible(const fs::path& node) {
  return access(node.c_str(), R_OK | W_OK) == 0;
}

std::string group_of(const fs::path& node) {
  struct stat facts {};
  if (stat(node.c_str(), &facts) != 0) return {};
  const struct group* group = getgrgid(facts.st_gid);
  return group == nullptr ? std::to_string(facts.st_gid) : group->gr_name;
}

Inventory take_inventory(const fs::path& root) {
  return {find_cameras(root), find_serial_ports(root), find_usb(root)};
}

}  // namespace eigenpose
