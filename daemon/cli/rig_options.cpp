#include "daemon/cli/rig_options.h"

#include <CLI/CLI.hpp>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

namespace eigenpose::cli {

void RigOptions::add_to(CLI::App& command) {
  command.add_option("--config", config, "The rig: eigenposed's configuration file")
      ->capture_default_str()
      ->type_name("FILE");
  command
      .add_option("--runtime-dir", runtime_dir,
                  "Folder of eigenposed's sockets, in the place of the configured one")
      ->type_name("DIR");
}

Config RigOptions::read() const {
  // Devices log to stderr, and only faults: stdout is the command's own.
  auto log = std::make_shared<spdlog::logger>("eigenpose", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  log->set_level(spdlog::level::warn);
  spdlog::set_default_logger(std::move(log));
  Config rig = read_config(config);
  if (!runtime_dir.empty()) rig.daemon.runtime_dir = std::filesystem::absolute(runtime_dir);
  if (rig.sim) {
    std::error_code failed;
    std::filesystem::create_directories(rig.daemon.runtime_dir, failed);
  }
  return rig;
}

}  // namespace eigenpose::cli
