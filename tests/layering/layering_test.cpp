// Refuses an include that goes against the layers. The table below is the one place that says who may know
// whom.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/layering/drawing.h"

namespace {

namespace fs = std::filesystem;

const fs::path source_root = EIGENPOSE_SOURCE_DIR;

/// The rooms of the library, lowest first. Each may include those before it.
const std::vector<std::string> core_rooms = {
    "core/base",     "core/simd",        "core/image",     "core/dataset",    "core/subspace",
    "core/manifold", "core/search",      "core/alignment", "core/windows",    "core/color",
    "core/model",    "core/recognition", "core/learning",  "core/evaluation", "core/example"};

/// Room outside core → rooms it may include. Every room may include its own.
const std::map<std::string, std::set<std::string>> outer_licences = {
    {"drivers", {"core/base", "core/image"}},
    {"drivers/v4l2", {"drivers", "core/base", "core/simd", "core/image"}},
    {"drivers/modbus", {"drivers", "core/base"}},
    {"drivers/usb", {"drivers", "core/base"}},
    {"sim", {"drivers", "drivers/usb", "core/base", "core/image"}},
    {"config", {"drivers", "drivers/v4l2", "drivers/modbus", "drivers/usb", "core/base"}},
    {"daemon/rig", {"drivers", "core/base", "core/image", "core/dataset"}},
    {"daemon/service",
     {"daemon/rig", "drivers", "core/base", "core/image", "core/dataset", "core/subspace", "core/model",
      "core/recognition", "core/learning", "core/evaluation"}},
    {"daemon/api/client", {"core/base"}},
    {"daemon/api/json",
     {"core/base", "core/image", "core/dataset", "core/manifold", "core/model", "core/recognition"}},
    {"daemon/api",
     {"daemon/api/client", "daemon/api/json", "daemon/service", "daemon/rig", "core/base", "core/image",
      "core/dataset", "core/model", "core/recognition"}},
    {"daemon/hardware",
     {"daemon", "daemon/rig", "daemon/api/client", "config", "drivers", "drivers/v4l2", "drivers/modbus",
      "drivers/usb", "core/base"}},
    {"daemon/manual", {}},
    {"daemon/cli",
     {"daemon/api/client", "daemon/api/json", "daemon/hardware", "daemon/manual", "config", "drivers", "sim",
      "core/base", "core/image", "core/dataset", "core/subspace", "core/manifold", "core/model",
      "core/recognition", "core/learning", "core/evaluation"}},
    {"daemon/demo", {"daemon/api/client", "daemon/cli", "sim", "core/base"}},
    {"daemon",
     {"daemon/manual", "daemon/rig", "daemon/service", "daemon/api", "config", "sim", "drivers",
      "drivers/v4l2", "drivers/modbus", "drivers/usb", "core/base", "core/image"}},
};

std::map<std::string, std::set<std::string>> all_licences() {
  auto result = outer_licences;
  std::set<std::string> below;
  for (const std::string& room : core_rooms) {
    result[room] = below;
    below.insert(room);
  }
  return result;
}

const std::map<std::string, std::set<std::string>> licences = all_licences();

/// Outside headers that the library must not know: devices, sockets, the daemon's world.
const std::regex foreign_to_core(
    R"(^(sys/socket\.h|sys/un\.h|netinet/.*|linux/.*|modbus.*|libusb.*|boost/(asio|beast).*|systemd/.*|sqlite3\.h|toml.*|CLI/.*|spdlog/.*|embree.*)$)");

/// The longest key of `licences` that is the file's folder or a folder above it; empty if none.
std::string layer_of(const std::string& path) {
  for (fs::path folder = fs::path(path).parent_path(); !folder.empty(); folder = folder.parent_path())
    if (licences.count(folder.generic_string())) return folder.generic_string();
  return {};
}

struct Include {
  std::string file;
  int line = 0;
  std::string target;
  bool quoted = false;
};

std::vector<Include> includes_below(const std::string& folder) {
  static const std::regex pattern(R"(^\s*#\s*include\s*([<"])([^>"]+)[>"])");
  std::vector<Include> result;
  for (const auto& entry : fs::recursive_directory_iterator(source_root / folder)) {
    const auto extension = entry.path().extension();
    if (extension != ".h" && extension != ".cpp") continue;
    std::ifstream in(entry.path());
    std::string text;
    for (int line = 1; std::getline(in, text); ++line) {
      std::smatch match;
      if (std::regex_search(text, match, pattern))
        result.push_back(
            {fs::relative(entry.path(), source_root).generic_string(), line, match[2], match[1] == "\""});
    }
  }
  return result;
}

std::vector<Include> all_includes() {
  std::vector<Include> result;
  for (const char* folder : {"core", "drivers", "sim", "config", "daemon"}) {
    auto part = includes_below(folder);
    result.insert(result.end(), part.begin(), part.end());
  }
  return result;
}

std::string where(const Include& include) {
  return include.file + ":" + std::to_string(include.line) + " includes " + include.target;
}

TEST(Layering, EveryIncludeOfOursIsLicensed) {
  const auto includes = all_includes();
  ASSERT_GT(includes.size(), 20U) << "the sources were not found below " << source_root;
  for (const Include& include : includes) {
    if (!include.quoted) continue;
    const std::string from = layer_of(include.file);
    const std::string to = layer_of(include.target);
    ASSERT_FALSE(from.empty()) << include.file << " stands in no known layer: add it to the table";
    EXPECT_FALSE(to.empty()) << where(include) << ", which is in no layer; write the path from the top level";
    if (to.empty() || from == to) continue;
    EXPECT_TRUE(licences.at(from).count(to)) << where(include) << ": " << from << " may not know " << to;
  }
}

TEST(Layering, TheRoomsAreDrawnWithoutACircle) {
  eigenpose::layering::Edges edges;
  for (const Include& include : all_includes()) {
    if (!include.quoted) continue;
    const std::string from = layer_of(include.file);
    const std::string to = layer_of(include.target);
    if (!from.empty() && !to.empty() && from != to) ++edges[{from, to}];
  }
  const auto floors = eigenpose::layering::floors(edges);
  EXPECT_EQ(floors.at("core/base"), 0);
  for (const auto& [edge, count] : edges)
    EXPECT_GT(floors.at(edge.first), floors.at(edge.second)) << edge.first << " includes " << edge.second;
  const fs::path picture = fs::path(EIGENPOSE_BINARY_DIR) / "rooms.svg";
  std::ofstream(picture) << eigenpose::layering::draw(edges);
  std::cout << eigenpose::layering::describe(edges) << "drawn in " << picture.string() << "\n";
}

TEST(Layering, ARoomThatReachesItselfIsRefused) {
  EXPECT_THROW(eigenpose::layering::floors({{{"a", "b"}, 1}, {{"b", "c"}, 1}, {{"c", "a"}, 1}}),
               std::logic_error);
  EXPECT_EQ(eigenpose::layering::floors({{{"a", "b"}, 1}, {{"a", "c"}, 1}, {{"b", "c"}, 1}}).at("a"), 2);
}

TEST(Layering, TheLibraryKnowsNoDeviceAndNoSocket) {
  for (const Include& include : includes_below("core"))
    EXPECT_FALSE(std::regex_match(include.target, foreign_to_core)) << where(include);
}

TEST(Layering, TheTableHasNoCircle) {
  // Depth-first: a layer that reaches itself is a circle.
  for (const auto& [start, unused] : licences) {
    std::set<std::string> seen;
    std::vector<std::string> open(licences.at(start).begin(), licences.at(start).end());
    while (!open.empty()) {
      const std::string layer = open.back();
      open.pop_back();
      EXPECT_NE(layer, start) << start << " reaches itself";
      if (!seen.insert(layer).second) continue;
      open.insert(open.end(), licences.at(layer).begin(), licences.at(layer).end());
    }
  }
}

TEST(Layering, OnlyTheDeviceTableNamesRealAndSimulatedDevicesSideBySide) {
  std::map<std::string, std::set<std::string>> kinds;  // file of daemon → kinds of device it includes
  for (const Include& include : includes_below("daemon")) {
    const std::string layer = layer_of(include.target);
    if (layer == "sim") kinds[include.file].insert("simulated");
    if (layer.starts_with("drivers/")) kinds[include.file].insert("real");
  }
  for (const auto& [file, which] : kinds)
    EXPECT_TRUE(which.size() < 2 || file == "daemon/devices.cpp") << file << " names both";
}

}  // namespace
