#pragma once

/// Runs a line of shell as a person would.

#include <array>
#include <cstdio>
#include <string>

#include <sys/wait.h>

namespace eigenpose {

/// How a command ended.
struct Ended {
  int code = -1;       ///< −1: killed by a signal
  std::string output;  ///< of both streams
};

/// @param line what the shell runs; its stderr, and its stdout where the line leaves it, are `output`.
inline Ended shell(const std::string& line) {
  Ended result;
  FILE* pipe = ::popen(("exec 2>&1; " + line).c_str(), "r");
  if (pipe == nullptr) return result;
  std::array<char, 4096> text{};
  for (std::size_t n = 0; (n = std::fread(text.data(), 1, text.size(), pipe)) > 0;)
    result.output.append(text.data(), n);
  const int status = ::pclose(pipe);
  result.code = WIFEXITED(status) && WEXITSTATUS(status) < 128 ? WEXITSTATUS(status) : -1;
  return result;
}

}  // namespace eigenpose
