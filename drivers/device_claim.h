#pragma once

/// Two masters must never drive one device: each would send the motor where the other does not expect it.

#include <optional>
#include <string>
#include <string_view>

namespace eigenpose {

/// What to tell a person whose device is held by somebody else.
inline constexpr std::string_view held_by_another =
    "another program drives it: is eigenposed running, or another eigenpose? Stop it first (systemctl stop "
    "eigenposed)";

/// A device's name, held for this program from `make` to destruction, against every other user of this
/// machine; the kernel lets go of it when the program ends in any way. (An abstract Unix socket: it leaves
/// no file, and nobody needs the right to write one.)
class DeviceClaim {
 public:
  /// @param name what all programs call the device, "tcp 192.168.0.10:502 unit 1".
  /// @return nothing when it is held already, by this program or another. @throws Error when the system has
  /// no sockets left.
  static std::optional<DeviceClaim> make(std::string name);

  DeviceClaim(DeviceClaim&& other) noexcept;
  DeviceClaim& operator=(DeviceClaim&& other) noexcept;
  ~DeviceClaim();
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  DeviceClaim(std::string name, int socket) : name_(std::move(name)), socket_(socket) {}
  std::string name_;
  int socket_;
};

}  // namespace eigenpose
