#include "drivers/device_claim.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <grp.h>
#include <pwd.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/error.h"

namespace eigenpose {

namespace {

namespace fs = std::filesystem;

constexpr mode_t anybody_may_write = S_IWOTH;
constexpr mode_t others_may_anything = S_IRWXG | S_IRWXO;
constexpr std::size_t longest_file_name = 255;

std::optional<struct stat> facts_of(const fs::path& path) {
  struct stat facts {};
  if (::lstat(path.c_str(), &facts) != 0) return std::nullopt;
  return facts;
}

bool is_user(uid_t uid, const std::string& name) {
  const passwd* user = ::getpwnam(name.c_str());
  return user != nullptr && user->pw_uid == uid;
}

/// The machine's folder can be used: its owner is trusted, other users cannot write to it, and this user
/// may make files there.
bool is_trusted(const fs::path& folder, const std::string& service_user) {
  const auto facts = facts_of(folder);
  if (!facts || !S_ISDIR(facts->st_mode) || (facts->st_mode & anybody_may_write) != 0) return false;
  const bool ours =
      facts->st_uid == 0 || facts->st_uid == ::geteuid() || is_user(facts->st_uid, service_user);
  return ours && ::euidaccess(folder.c_str(), W_OK | X_OK) == 0;
}

/// A folder of this user alone below `parent`, or nothing.
std::optional<fs::path> own_folder(const fs::path& parent) {
  const auto above = facts_of(parent);
  // In a folder where others may write, any of them could have made ours.
  if (!above || !S_ISDIR(above->st_mode) || (above->st_mode & anybody_may_write) != 0) return std::nullopt;
  fs::path folder = parent / fmt::format("eigenpose-claims-{}", ::geteuid());
  if (::mkdir(folder.c_str(), S_IRWXU) != 0 && errno != EEXIST) return std::nullopt;
  const auto facts = facts_of(folder);
  const bool mine = facts && S_ISDIR(facts->st_mode) && facts->st_uid == ::geteuid() &&
                    (facts->st_mode & others_may_anything) == 0;
  if (!mine) return std::nullopt;
  return folder;
}

/// `name` as a file's: what is no letter, digit, dot or dash becomes %XX. Of a long one the end tells it from
/// others.
std::string file_name_of(const std::string& name) {
  std::string file;
  for (const char c : name) {
    const bool plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '-';
    file += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  file = "claim-" + file;
  return file.size() <= longest_file_name ? file : file.substr(file.size() - longest_file_name);
}

}  // namespace

ClaimPlaces ClaimPlaces::of_this_user() {
  ClaimPlaces places;
  const uid_t user = ::geteuid();
  if (user == 0) places.own_parents.emplace_back("/run");
  places.own_parents.emplace_back(fmt::format("/run/user/{}", user));
  if (const passwd* entry = ::getpwuid(user); entry != nullptr && entry->pw_dir != nullptr) {
    places.own_parents.emplace_back(fs::path(entry->pw_dir) / ".cache");
    places.own_parents.emplace_back(entry->pw_dir);
  }
  return places;
}

std::filesystem::path claims_folder(const ClaimPlaces& places) {
  if (is_trusted(places.shared, places.service_user)) return places.shared;
  for (const fs::path& parent : places.own_parents)
    if (const auto folder = own_folder(parent)) return *folder;
  throw Error(fmt::format(
      "no folder for the claims of devices: install systemd/eigenpose.tmpfiles, which makes {}, or give this "
      "user a home folder that others may not write to",
      places.shared.string()));
}

std::optional<DeviceClaim> DeviceClaim::make(std::string name, const ClaimPlaces& places) {
  const fs::path folder = claims_folder(places);
  const fs::path path = folder / file_name_of(name);
  const bool shared = folder == places.shared;
  const mode_t mode = shared ? S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP : S_IRUSR | S_IWUSR;
  const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, S_IRUSR | S_IWUSR);
  if (file < 0)
    throw Error(fmt::format("{}: cannot be claimed: {}: {}", name, path.string(), std::strerror(errno)));
  DeviceClaim claim(std::move(name), file);
  // Whoever of root, the service and its group comes first makes the file for all of them, whatever his
  // umask.
  if (shared) {
    const auto facts = facts_of(folder);
    if (facts &&
        ::fchown(file, ::geteuid() == 0 ? facts->st_uid : static_cast<uid_t>(-1), facts->st_gid) == 0)
      (void)::fchmod(file, mode);
  }
  if (::flock(file, LOCK_EX | LOCK_NB) == 0) return claim;
  if (errno == EWOULDBLOCK) return std::nullopt;
  throw Error(
      fmt::format("{}: cannot be claimed: {}: {}", claim.name(), path.string(), std::strerror(errno)));
}

DeviceClaim::DeviceClaim(DeviceClaim&& other) noexcept
    : name_(std::move(other.name_)), file_(std::exchange(other.file_, -1)) {}

DeviceClaim& DeviceClaim::operator=(DeviceClaim&& other) noexcept {
  std::swap(name_, other.name_);
  std::swap(file_, other.file_);
  return *this;
}

DeviceClaim::~DeviceClaim() {
  if (file_ >= 0) ::close(file_);
}

}  // namespace eigenpose
