#include "daemon/config_check.h"

#include <string>

#include <fmt/format.h>
#include <grp.h>
#include <sys/un.h>

#include "core/base/error.h"
#include "daemon/device_check.h"

namespace eigenpose {
namespace {

void check_socket(const Config& config, const std::filesystem::path& socket) {
  constexpr std::size_t room = sizeof(sockaddr_un::sun_path) - 1;
  if (socket.native().size() > room)
    throw ConfigError(
        fmt::format("{}: runtime_dir in [daemon]: the path of the socket {} has {} bytes, and a "
                    "socket's may have {}; choose a shorter folder",
                    config.file.string(), socket.string(), socket.native().size(), room));
}

void check_group(const Config& config, const std::string& key, const std::string& group) {
  if (!group.empty() && ::getgrnam(group.c_str()) == nullptr)
    throw ConfigError(
        fmt::format("{}: {} in [api]: this machine has no group \"{}\"; make it, or name another",
                    config.file.string(), key, group));
}

}  // namespace

void check_config(const Config& config) {
  check_socket(config, config.results_socket());
  check_socket(config, config.control_socket());
  if (config.sim) check_socket(config, config.lab_socket());
  check_group(config, "results_group", config.api.results_group);
  check_group(config, "control_group", config.api.control_group);
  check_device_options(config);
}

}  // namespace eigenpose
