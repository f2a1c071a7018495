#pragma once

/// A program that a test runs beside itself: it may read what the program says, and closes its input to end
/// it.

#include <string>
#include <vector>

#include <sys/types.h>

namespace eigenpose {

class ChildProcess {
 public:
  /// @param arguments the program first.
  explicit ChildProcess(const std::vector<std::string>& arguments);
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;
  /// Closes its input, gives it a second, then kills it.
  ~ChildProcess();

  /// The next line of its output, without the end of line; empty when it has ended.
  std::string read_line();

 private:
  pid_t pid_ = -1;
  int input_ = -1;
  int output_ = -1;
};

}  // namespace eigenpose
