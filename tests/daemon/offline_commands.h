#pragma once

/// Commands that need no service, run as a person runs them.

#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "core/image/picture_file.h"
#include "tests/daemon/shell.h"
#include "tests/support/synthetic_objects.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {

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
