#pragma once

/// What a command shows a person while it works.

#include <chrono>
#include <cstddef>
#include <string>

#include "core/base/progress.h"

namespace eigenpose::cli {

/// Progress on stderr: one line that rewrites itself on a terminal, a plain line every few seconds otherwise.
/// One thread at a time.
class ConsoleProgress {
 public:
  /// @param quiet nothing is written at all.
  explicit ConsoleProgress(bool quiet = false);
  ConsoleProgress(const ConsoleProgress&) = delete;
  ConsoleProgress& operator=(const ConsoleProgress&) = delete;
  /// Clears the line on a terminal.
  ~ConsoleProgress();

  void update(const ProgressUpdate& update);
  /// The same as a callback; must not outlive this object.
  [[nodiscard]] Progress callback();
  /// Clears the line on a terminal, so that other output starts clean.
  void clear();

 private:
  bool quiet_;
  bool terminal_;
  bool line_shown_ = false;
  std::string stage_;
  std::chrono::steady_clock::time_point stage_began_{};
  std::chrono::steady_clock::time_point last_shown_{};
};

}  // namespace eigenpose::cli
