#pragma once

/// What is plugged into this machine that Eigenpose could use.

#include <filesystem>
#include <string>
#include <vector>

#include "drivers/v4l2/capture_mode.h"
#include "drivers/v4l2/video_system.h"

namespace eigenpose {

/// A camera node, and what it can do.
struct CameraFound {
  VideoNode node;
  std::vector<std::string> modes;     ///< "YUYV 640x480 at 30 fps"; those this program reads
  std::vector<std::string> controls;  ///< "gain 0…100, now 17"
};

/// A serial port that belongs to a device: USB adapters and real UARTs.
struct SerialPortFound {
  std::string path;         ///< "/dev/ttyUSB0"; changes with the order of plugging in
  std::string by_id;        ///< "/dev/serial/by-id/…"; stays with the adapter; empty if udev made none
  std::string serial;       ///< of the USB adapter
  std::string name;         ///< what the adapter calls itself
  bool accessible = false;  ///< this user may read and write it
};

/// A USB device with a chip of FTDI: a Thorlabs stage, an Enttec lamp, or a serial adapter.
struct UsbFound {
  std::string numbers;  ///< "0403:faf0"
  std::string serial;
  std::string name;
  std::string port;  ///< "1-2.3"
  std::string node;  ///< "/dev/bus/usb/001/004"
  bool accessible = false;
};

struct Inventory {
  std::vector<CameraFound> cameras;
  std::vector<SerialPortFound> serial_ports;
  std::vector<UsbFound> usb;
};

/// Looks; opens cameras only to ask them. @param root stands for "/" in tests.
Inventory take_inventory(const std::filesystem::path& root = "/");

/// Whether this user may read and write a node.
bool is_accessible(const std::filesystem::path& node);
/// The group that owns a node; empty when there is none.
std::string group_of(const std::filesystem::path& node);

}  // namespace eigenpose
