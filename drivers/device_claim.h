#pragma once

/// Two masters must never drive one device: each would send the motor where the other does not expect it.
///
/// A claim is a lock on a file that other users can neither open nor lock: else anybody on the machine could
/// keep a device from its service. The folder of these files is
///  - the machine's (`ClaimPlaces::shared`, made by systemd/eigenpose.tmpfiles), where the service, the
///  members
///    of its group and root exclude each other, if this user may write there;
///  - otherwise one of the user's own, where the programs of one user exclude each other.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

namespace eigenpose {

/// What to tell a person whose device is held by somebody else.
inline constexpr std::string_view held_by_another =
    "another program drives it: is eigenposed running, or another eigenpose? Stop it first (systemctl stop "
    "eigenposed)";

/// Where the files of claims may be.
struct ClaimPlaces {
  /// Trusted when it belongs to root, to `service_user` or to this user, and all other users may not write
  /// there.
  std::filesystem::path shared = "/run/lock/eigenpose";
  std::string service_user = "eigenpose";
  /// Where this user's own folder is made, the first that is there and no other user may write to.
  std::vector<std::filesystem::path> own_parents;

  /// Of this user on this machine: /run for root, /run/user/UID, the home folder's .cache.
  static ClaimPlaces of_this_user();
};

/// The folder of the claims, made if it has to be. @throws Error when there is none.
std::filesystem::path claims_folder(const ClaimPlaces& places);

/// A device's name, held for this program from `make` to destruction. The kernel lets go of it when the
/// program ends in any way. The file stays: whoever removed it could take it from somebody who waits for it.
class DeviceClaim {
 public:
  /// @param name what all programs call the device, "tcp 192.168.0.10:502 unit 1".
  /// @return nothing when it is held already, by this program or another. @throws Error when the system
  /// refuses the file.
  static std::optional<DeviceClaim> make(std::string name,
                                         const ClaimPlaces& places = ClaimPlaces::of_this_user());

  DeviceClaim(DeviceClaim&& other) noexcept;
  DeviceClaim& operator=(DeviceClaim&& other) noexcept;
  ~DeviceClaim();
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  DeviceClaim(std::string name, int file) : name_(std::move(name)), file_(file) {}
  std::string name_;
  int file_;
};

}  // namespace eigenpose
