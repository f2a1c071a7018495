#pragma once

/// The options of recognising that `recognize` and `evaluate` share.

#include "core/recognition/recognizer.h"

namespace CLI {
class App;
}

namespace eigenpose::cli {

/// Adds --search and --rejector.
void add_recognizer_options(CLI::App& command, RecognizerOptions& options);

}  // namespace eigenpose::cli
