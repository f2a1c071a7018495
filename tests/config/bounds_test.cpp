// Every key of the configuration that holds a number: its bounds hold, and no other kind of value is taken.

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/config.h"
#include "core/base/error.h"

namespace eigenpose {
namespace {

using testing::HasSubstr;

std::string answer_to(const std::string& text) {
  try {
    (void)parse_config(text, "rig.toml");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

const std::string table_header = "[[axis]]\nname = \"t\"\ndriver = \"modbus\"\nendpoint = \"tcp://h:502\"\n";
const std::string v4l2 = "[camera]\ndriver = \"v4l2\"\n";
const std::string simulated = "[sim]\n[camera]\ndriver = \"simulated\"\n";
const std::string replay = "[sim]\n[camera]\ndriver = \"replay\"\nfolder = \"f\"\n";

struct Bounds {
  std::string before;  ///< what stands before the key
  std::string key;
  std::string below, lowest, highest, above;
};

const std::vector<Bounds> whole_numbers = {
    {"[api]\n", "max_connections", "0", "1", "1000", "1001"},
    {"[api]\n", "max_body_kib", "0", "1", "16384", "16385"},
    {"[api]\n", "request_timeout_ms", "99", "100", "600000", "600001"},
    {"[api]\n", "event_buffer", "0", "1", "100000", "100001"},
    {v4l2, "input", "-1", "0", "63", "64"},
    {v4l2, "width", "63", "64", "8192", "8193"},
    {v4l2, "height", "63", "64", "8192", "8193"},
    {table_header, "station", "0", "1", "247", "248"},
    {table_header, "settle_ms", "-1", "0", "60000", "60001"},
    {table_header, "move_timeout_ms", "99", "100", "3600000", "3600001"},
    {"[[lamp]]\nname = \"l\"\ndriver = \"dmx\"\nendpoint = \"usb:1\"\n", "channel", "0", "1", "512", "513"},
    {"[[lamp]]\nname = \"l\"\ndriver = \"modbus\"\nendpoint = \"tcp://h:502\"\nprofile = \"p\"\n", "station",
     "0", "1", "247", "248"},
    {"[learn]\n", "components", "0", "1", "1024", "1025"},
    {"[learn]\n", "size", "7", "8", "256", "257"},
    {"[watch]\n", "settle_ms", "-1", "0", "60000", "60001"},
    {"[sim]\n", "seed", "-1", "0", "9223372036854775807", "9223372036854775808"},
};

const std::vector<Bounds> floating_point_numbers = {
    {v4l2, "frames_per_second", "0.099", "0.1", "1000.0", "1000.001"},
    {simulated, "exposure_ms", "-0.001", "0.0", "1000.0", "1000.001"},
    {replay, "degrees_per_index", "0.0009", "0.001", "180.0", "180.001"},
    {table_header, "home_offset", "-1.000001e9", "-1e9", "1e9", "1.000001e9"},
    {table_header, "steps_per_unit", "0.0009", "0.001", "1e7", "10000001.0"},
    {table_header, "speed", "0.9e-6", "1e-6", "1e6", "1000001.0"},
    {table_header, "arrival_tolerance", "0.9e-6", "1e-6", "10.0", "10.001"},
    {"[[lamp]]\nname = \"l\"\ndriver = \"dmx\"\nendpoint = \"usb:1\"\n", "level", "-0.001", "0.0", "1.0",
     "1.001"},
    {"[learn]\n", "energy", "0.009", "0.01", "1.0", "1.001"},
    {"[learn]\n", "false_rejection", "-0.001", "0.0", "0.5", "0.501"},
    {"[learn]\n", "false_acceptance", "-0.001", "0.0", "1.0", "1.001"},
    {"[watch]\n", "threshold", "0.499", "0.5", "255.0", "255.001"},
    {"[sim]\n", "speed_factor", "0.009", "0.01", "1000.0", "1000.001"},
};

void expect_bounds(const Bounds& bounds) {
  const auto said = [&](const std::string& value) {
    return answer_to(bounds.before + bounds.key + " = " + value + "\n");
  };
  EXPECT_EQ(said(bounds.lowest), "accepted") << bounds.key;
  EXPECT_EQ(said(bounds.highest), "accepted") << bounds.key;
  for (const std::string& wrong :
       {bounds.below, bounds.above, std::string("true"), std::string("\"1\""), std::string("[1]"),
        std::string("2026-01-01"), std::string("nan"), std::string("inf")})
    EXPECT_THAT(said(wrong), testing::StartsWith("rig.toml:")) << bounds.key << " = " << wrong;
}

TEST(ConfigBounds, EveryWholeNumberHasBothBounds) {
  for (const Bounds& bounds : whole_numbers) {
    expect_bounds(bounds);
    EXPECT_THAT(answer_to(bounds.before + bounds.key + " = 200.5\n"), HasSubstr("whole number"))
        << bounds.key;
    EXPECT_THAT(answer_to(bounds.before + bounds.key + " = 200.0\n"), HasSubstr("whole number"))
        << bounds.key;
  }
}

TEST(ConfigBounds, EveryFloatingPointNumberHasBothBounds) {
  for (const Bounds& bounds : floating_point_numbers) expect_bounds(bounds);
}

}  // namespace
}  // namespace eigenpose
