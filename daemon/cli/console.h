#pragma once

/// How a command shows something: progress and warnings on stderr, results on stdout.

#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>

#include "core/base/progress.h"

namespace eigenpose::cli {

/// Prepares the process for writing: a reader that has gone and a file that may not grow are errors of the
/// write, no signals; and a standard stream that is closed is held by /dev/null, so that no file of ours gets
/// its number and is printed into. To be called first.
void prepare_output();

/// Hands everything that was printed on stdout to the system. A command that prints for as long as it runs
/// calls it after each result, main at the end of every command. @throws Error when something printed since
/// the start was not written.
void flush_output();

/// One line on stderr, made printable: "eigenpose: TEXT". What was printed on stdout before comes first.
void warn(const std::string& text);

/// Progress on stderr: one line that rewrites itself on a terminal, a plain line every few seconds otherwise.
/// Thread-safe.
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
  void clear_line();

  bool quiet_;
  bool terminal_;
  std::mutex mutex_;  ///< guards what follows
  bool line_shown_ = false;
  std::string stage_;
  std::chrono::steady_clock::time_point stage_began_{};
  std::chrono::steady_clock::time_point last_shown_{};
};

}  // namespace eigenpose::cli
