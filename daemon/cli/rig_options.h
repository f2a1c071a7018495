#pragma once

/// The options by which a command that touches devices finds its rig.

#include <filesystem>

#include "config/config.h"

namespace CLI {
class App;
}

namespace eigenpose::cli {

struct RigOptions {
  std::filesystem::path config = "/etc/eigenpose/eigenposed.toml";
  std::filesystem::path runtime_dir;  ///< empty: the configuration's

  void add_to(CLI::App& command);
  /// Reads the configuration; from then on devices log faults to stderr. For a simulated rig the folder of
  /// its sockets is made. @throws ConfigError.
  [[nodiscard]] Config read() const;
};

}  // namespace eigenpose::cli
