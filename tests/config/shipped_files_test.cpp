/// The files that are shipped are good, and the explained one shows every key.

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "config/config.h"

namespace eigenpose {
namespace {

const std::filesystem::path config_folder = std::filesystem::path(EIGENPOSE_SOURCE_DIR) / "config";

std::string content(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

/// The shipped file with every key that stands behind "# " brought to life.
std::string with_every_key(const std::string& text) {
  std::istringstream lines(text);
  std::string result;
  for (std::string line; std::getline(lines, line);) {
    const bool setting = line.starts_with("# ") && (line.find(" = ") != std::string::npos || line[2] == '[');
    const bool sentence = line.find(':') != std::string::npos && line.find("\"usb:") == std::string::npos;
    result += (setting && !sentence ? line.substr(2) : line) + "\n";
  }
  return result;
}

TEST(ShippedFiles, AllOfThemAreAccepted) {
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(config_folder)) {
    if (entry.path().extension() != ".toml" || entry.path().parent_path().filename() == "profiles") continue;
    EXPECT_NO_THROW(read_config(entry.path())) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 3);
}

TEST(ShippedFiles, TheExplainedFileHasOnlyDefaultsInItsCommonSections) {
  const Config shipped = read_config(config_folder / "eigenposed.toml");
  const DaemonOptions daemon;
  const ApiOptions api;
  const LearnOptions learn;
  const WatchOptions watch;
  EXPECT_EQ(shipped.daemon.runtime_dir, daemon.runtime_dir);
  EXPECT_EQ(shipped.daemon.state_dir, daemon.state_dir);
  EXPECT_EQ(shipped.api.results_mode, api.results_mode);
  EXPECT_EQ(shipped.api.control_mode, api.control_mode);
  EXPECT_EQ(shipped.api.max_connections, api.max_connections);
  EXPECT_EQ(shipped.api.max_body_kib, api.max_body_kib);
  EXPECT_EQ(shipped.api.request_timeout, api.request_timeout);
  EXPECT_EQ(shipped.api.event_buffer, api.event_buffer);
  EXPECT_EQ(shipped.learn.components, learn.components);
  EXPECT_EQ(shipped.learn.size, learn.size);
  EXPECT_EQ(shipped.learn.color, learn.color);
  EXPECT_EQ(shipped.learn.false_rejection, learn.false_rejection);
  EXPECT_EQ(shipped.learn.false_acceptance, learn.false_acceptance);
  EXPECT_EQ(shipped.watch.settle, watch.settle);
}

TEST(ShippedFiles, EveryKeyThatIsAcceptedIsExplained) {
  const std::string text = content(config_folder / "eigenposed.toml");
  for (const char* key : {"runtime_dir",
                          "state_dir",
                          "log_level",
                          "results_mode",
                          "results_group",
                          "control_mode",
                          "control_group",
                          "max_connections",
                          "max_body_kib",
                          "request_timeout_ms",
                          "event_buffer",
                          "driver",
                          "device",
                          "format",
                          "width",
                          "height",
                          "frames_per_second",
                          "exposure_ms",
                          "folder",
                          "degrees_per_index",
                          "endpoint",
                          "station",
                          "profile",
                          "unit",
                          "periodic",
                          "lower",
                          "upper",
                          "home_offset",
                          "speed",
                          "arrival_tolerance",
                          "settle_ms",
                          "move_timeout_ms",
                          "channel",
                          "level",
                          "from",
                          "to",
                          "count",
                          "at",
                          "components",
                          "energy",
                          "size",
                          "color",
                          "enabled",
                          "threshold",
                          "seed",
                          "speed_factor"})
    EXPECT_NE(text.find(std::string(key) + " = "), std::string::npos) << key;
}

TEST(ShippedFiles, AKeyBroughtToLifeIsStillAKey) {
  std::string text = with_every_key(content(config_folder / "eigenposed.toml"));
  // Keys of other drivers stand beside each other in the file for explaining only.
  for (const char* key : {"exposure_ms = ", "folder = ", "degrees_per_index = ", "at = ["}) {
    const std::size_t at = text.find(std::string("\n") + key);
    ASSERT_NE(at, std::string::npos) << key;
    text.insert(at + 1, "# ");
  }
  EXPECT_NO_THROW(parse_config(text, config_folder / "eigenposed.toml"));
}

}  // namespace
}  // namespace eigenpose
