#pragma once

/// Commands that need no service, run as a person runs them.

#include <array>
#include <cstdio>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <sys/wait.h>

#include "core/image/picture_file.h"
#include "tests/support/synthetic_objects.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {

/// How a command ended.
struct Ended {
  int code = -1;
  std::string output;  ///< of both streams
};

inline Ended shell(const std::string& line) {
  Ended result;
  FILE* pipe = ::popen(("exec 2>&1; " + line).c_str(), "r");
  if (pipe == nullptr) return result;
  std::array<char, 4096> text{};
  for (std::size_t n = 0; (n = std::fread(text.data(), 1, text.size(), pipe)) > 0;)
    result.output.append(text.data(), n);
  const int status = ::pclose(pipe);
  result.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return result;
}

inline const std::string program = EIGENPOSE;

/// Runs commands in a folder of their own.
class OfflineCommands : public ::testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  [[nodiscard]] Ended eigenpose(const std::string& arguments) const {
    return shell("cd '" + folder_.path().string() + "' && '" + program + "' " + arguments);
  }
  void write_objects() const {
    testing::write_turn(folder_.path() / "sets", "duck", 1, 18);
    testing::write_turn(folder_.path() / "sets", "mug", 2, 18);
    const auto png = encode_png(testing::scene_with(2, 120.0));
    std::ofstream(path("mug.png"), std::ios::binary)
        .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
  }

 private:
  test::TemporaryFolder folder_;
};

}  // namespace eigenpose
