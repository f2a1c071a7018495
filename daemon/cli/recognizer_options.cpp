#include "daemon/cli/recognizer_options.h"

#include <CLI/CLI.hpp>

namespace eigenpose::cli {

void add_recognizer_options(CLI::App& command, RecognizerOptions& options) {
  command
      .add_option("--search", options.search,
                  "How the nearest manifold is found: tree, slab or flann, all exact; or rbf, networks, "
                  "approximate")
      ->check(CLI::IsMember({"tree", "slab", "flann", "rbf"}))
      ->capture_default_str();
  command.add_flag("--rejector", options.rejector,
                   "Leave out before the search, by a composite rejector, what is certainly too far");
}

}  // namespace eigenpose::cli
