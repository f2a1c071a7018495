#include "config/config.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

const std::string axis = "[[axis]]\nname = \"table\"\ndriver = \"modbus\"\nendpoint = \"tcp://h:502\"\n";

std::string refusal(const std::string& text) {
  try {
    (void)parse_config(text, "rig.toml");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Config, AnEmptyFileIsAWatchfulDaemonWithoutDevices) {
  const Config config = parse_config("", "rig.toml");
  EXPECT_FALSE(config.camera);
  EXPECT_TRUE(config.axes.empty());
  EXPECT_FALSE(config.sim);
  EXPECT_EQ(config.control_socket(), "/run/eigenpose/control.sock");
  EXPECT_EQ(config.model_file(), "/var/lib/eigenpose/model.h5");
}

TEST(Config, AnUnknownKeyIsRefusedWithFileLineAndWhatIsAllowed) {
  EXPECT_THAT(refusal("[watch]\nenabled = true\ncolour = true\n"),
              AllOf(StartsWith("rig.toml:3: "), HasSubstr("unknown key \"colour\" in [watch]"),
                    HasSubstr("allowed: enabled, settle_ms, threshold")));
}

TEST(Config, AMisspelledKeyIsMetWithTheOneThatWasMeant) {
  EXPECT_THAT(refusal("[learn]\ncomponets = 3\n"), HasSubstr("did you mean \"components\"?"));
}

TEST(Config, AWrongUnitIsRefusedWithTheRightOne) {
  EXPECT_THAT(refusal("[watch]\nsettle_s = 1\n"),
              AllOf(StartsWith("rig.toml:2: "), HasSubstr("did you mean \"settle_ms\"?")));
  EXPECT_THAT(refusal(axis + "unit = \"rad\"\n"),
              AllOf(StartsWith("rig.toml:5: "), HasSubstr("\"deg\", \"mm\"")));
}

TEST(Config, AValueOutOfRangeIsRefusedWithTheRange) {
  EXPECT_THAT(refusal("[learn]\nsize = 4\n"), AllOf(StartsWith("rig.toml:2: "), HasSubstr("8 to 256")));
  EXPECT_THAT(refusal("[learn]\nenergy = nan\n"), HasSubstr("0.01 to 1"));
  EXPECT_THAT(refusal("[api]\nmax_connections = 0\n"), HasSubstr("1 to 1000"));
  EXPECT_THAT(refusal(axis + "station = 248\n"), HasSubstr("1 to 247"));
}

TEST(Config, EndsOfARangeAreNumbersWithinReason) {
  const std::string linear = axis + "periodic = false\n";
  EXPECT_EQ(refusal(linear + "lower = -1e9\nupper = 1e9\n"), "accepted");
  EXPECT_THAT(refusal(linear + "lower = -1.1e9\nupper = 0\n"), HasSubstr("lower"));
  EXPECT_THAT(refusal(linear + "lower = 0\nupper = 1.1e9\n"), HasSubstr("upper"));
  EXPECT_THAT(refusal(linear + "lower = 0\nupper = inf\n"), HasSubstr("upper"));
}

TEST(Config, AnEndpointThatCannotBeIsRefusedWithItsLine) {
  const auto modbus = [](const std::string& endpoint) {
    return "[[axis]]\nname = \"t\"\ndriver = \"modbus\"\nendpoint = \"" + endpoint + "\"\n";
  };
  for (const char* endpoint :
       {"tcp://10.0.0.1:99999", "tcp://:502", "tcp://10.0.0.1:502/", "tcp://10.0.0.1/x", "tcp://",
        "rtu:ttyUSB0", "rtu:/dev/ttyS0:12345", "usb:831", "Simulated"})
    EXPECT_THAT(refusal(modbus(endpoint)), AllOf(StartsWith("rig.toml:4: "), HasSubstr("endpoint")))
        << endpoint;
  for (const char* endpoint : {"usb:", "usb", "tcp://10.0.0.1", ""})
    EXPECT_THAT(
        refusal("[[lamp]]\nname = \"l\"\ndriver = \"dmx\"\nendpoint = \"" + std::string(endpoint) + "\"\n"),
        AllOf(StartsWith("rig.toml:4: "), HasSubstr("usb:SERIAL")))
        << endpoint;
  EXPECT_THAT(refusal("[[lamp]]\nname = \"l\"\ndriver = \"modbus\"\nendpoint = \"tcp://h:0\"\n"
                      "profile = \"p\"\n"),
              StartsWith("rig.toml:4: "));
}

std::string modbus_axis(const std::string& name, const std::string& rest) {
  return "[[axis]]\nname = \"" + name + "\"\ndriver = \"modbus\"\n" + rest;
}

std::string apt_axis(const std::string& name, const std::string& endpoint) {
  return "[[axis]]\nname = \"" + name + "\"\ndriver = \"apt\"\nendpoint = \"" + endpoint +
         "\"\nstage = \"PRM1-Z8\"\n";
}

std::string dmx_lamp(const std::string& name, const std::string& endpoint, int channel) {
  return "[[lamp]]\nname = \"" + name + "\"\ndriver = \"dmx\"\nendpoint = \"" + endpoint +
         "\"\nchannel = " + std::to_string(channel) + "\n";
}

TEST(Config, TwoNamesOfOneDeviceAreRefusedHoweverTheyAreSpelt) {
  const auto expect_refused = [](const std::string& text, const std::string& first,
                                 const std::string& second) {
    EXPECT_THAT(refusal(text), AllOf(HasSubstr("\"" + first + "\""), HasSubstr("\"" + second + "\""),
                                     HasSubstr("would both drive")))
        << text;
  };
  const auto tcp = [](const std::string& endpoint) { return "endpoint = \"" + endpoint + "\"\n"; };
  // The station forgotten in both.
  expect_refused(modbus_axis("a", tcp("tcp://10.0.0.1")) + modbus_axis("b", tcp("tcp://10.0.0.1")), "a", "b");
  for (const char* other : {"tcp://10.0.0.1:502", "tcp://[::ffff:10.0.0.1]", "tcp://10.1"})
    expect_refused(modbus_axis("a", tcp("tcp://10.0.0.1")) + modbus_axis("b", tcp(other)), "a", "b");
  expect_refused(modbus_axis("a", tcp("tcp://LocalHost")) + modbus_axis("b", tcp("tcp://127.0.0.1:502")), "a",
                 "b");
  expect_refused(
      modbus_axis("a", tcp("rtu:/dev/ttyUSB0")) + modbus_axis("b", tcp("rtu:/dev/../dev/ttyUSB0:9600:8N1")),
      "a", "b");
  expect_refused("[sim]\n" + modbus_axis("a", tcp("simulated") + "station = 2\n") +
                     modbus_axis("b", tcp("simulated") + "station = 2\n"),
                 "a", "b");
  expect_refused(apt_axis("a", "usb:831") + apt_axis("b", "usb:831"), "a", "b");
  expect_refused("[sim]\n" + apt_axis("a", "simulated") + apt_axis("b", "simulated"), "a", "b");
  // A drive is no lamp.
  expect_refused(apt_axis("a", "usb:831") + dmx_lamp("l", "usb:831", 1), "a", "l");
  expect_refused(modbus_axis("a", tcp("tcp://h")) +
                     "[[lamp]]\nname = \"l\"\ndriver = \"modbus\"\nprofile = \"p\"\n" + tcp("tcp://H.:502"),
                 "a", "l");
  // Lamps.
  expect_refused(dmx_lamp("k", "usb:EN1", 7) + dmx_lamp("l", "usb:EN1", 7), "k", "l");
  expect_refused(
      "[sim]\n[[lamp]]\nname = \"k\"\ndriver = \"simulated\"\n"
      "[[lamp]]\nname = \"l\"\ndriver = \"simulated\"\n",
      "k", "l");
}

TEST(Config, TheLineOfTheSecondNameIsGiven) {
  EXPECT_THAT(refusal(modbus_axis("a", "endpoint = \"tcp://h\"\nstation = 3\n") +
                      modbus_axis("b", "endpoint = \"tcp://h\"\nstation = 3\n")),
              StartsWith("rig.toml:10: station in [[axis]]: "));
}

TEST(Config, SeveralDevicesOnOneLineAreAccepted) {
  const std::string endpoint = "endpoint = \"tcp://10.0.0.1\"\n";
  EXPECT_EQ(
      refusal(modbus_axis("a", endpoint + "station = 1\n") + modbus_axis("b", endpoint + "station = 2\n") +
              modbus_axis("c", "endpoint = \"tcp://10.0.0.1:503\"\n") + apt_axis("d", "usb:1") +
              apt_axis("e", "usb:2") + dmx_lamp("k", "usb:EN1", 1) + dmx_lamp("l", "usb:EN1", 2)),
      "accepted");
}

TEST(Config, AValueOfAnotherTypeIsRefused) {
  EXPECT_THAT(refusal("[learn]\nsize = \"big\"\n"),
              AllOf(StartsWith("rig.toml:2: "), HasSubstr("whole number")));
  EXPECT_THAT(refusal("[learn]\ncolor = 1\n"), HasSubstr("true or false"));
  EXPECT_THAT(refusal("[daemon]\nlog_level = 3\n"), HasSubstr("text in quotes"));
  EXPECT_THAT(refusal("daemon = 3\n"), HasSubstr("[daemon]"));
}

TEST(Config, WhatIsNotTomlIsRefusedWithItsLine) {
  EXPECT_THAT(refusal("[daemon]\nruntime_dir = \n"), StartsWith("rig.toml:2: not valid TOML"));
}

TEST(Config, AMissingFileIsRefusedByName) {
  try {
    (void)read_config("/nonexistent/rig.toml");
    FAIL() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/nonexistent/rig.toml"));
  }
}

TEST(Config, AnAxisThatIsNotPeriodicGivesItsRange) {
  EXPECT_THAT(refusal(axis + "periodic = false\n"), HasSubstr("lower is missing in [[axis]]"));
  EXPECT_THAT(refusal(axis + "unit = \"mm\"\nlower = 5\nupper = 5\n"), HasSubstr("not above lower"));
  EXPECT_THAT(refusal(axis + "upper = 180.0\n"), HasSubstr("spans 360 deg"));
  EXPECT_EQ(refusal(axis + "unit = \"mm\"\nlower = 0\nupper = 5\n"), "accepted");
}

TEST(Config, TwoAxesOfOneNameAreRefused) {
  EXPECT_THAT(refusal(axis + axis),
              AllOf(StartsWith("rig.toml:6: "), HasSubstr("\"table\" is there already")));
}

TEST(Config, AnEndpointThatIsNotUnderstoodIsRefused) {
  EXPECT_THAT(refusal("[[axis]]\nname = \"t\"\ndriver = \"modbus\"\nendpoint = \"10.0.0.1\"\n"),
              AllOf(StartsWith("rig.toml:4: "), HasSubstr("tcp://HOST:PORT")));
}

TEST(Config, APlanIsKeptAsItIsWrittenWithItsPlace) {
  const std::string plan = axis + "[[plan]]\nname = \"p\"\n[[plan.axis]]\n";
  EXPECT_THAT(refusal(plan + "axis = \"table\"\n"), HasSubstr("either at"));
  EXPECT_THAT(refusal(plan + "axis = \"table\"\nfrom = 0\nto = 360\ncount = 36\nat = [0]\n"),
              HasSubstr("either at"));
  const Config config = parse_config(
      plan + "axis = \"table\"\nfrom = -10\nto = 360\ncount = 36\n[[plan.axis]]\naxis = \"x\"\nat = [1, 2]\n",
      "rig.toml");
  ASSERT_EQ(config.plans.size(), 1U);
  EXPECT_THAT(config.plans[0].place, StartsWith("rig.toml:"));
  ASSERT_EQ(config.plans[0].axes.size(), 2U);
  const PlanAxisOptions& spaced = config.plans[0].axes[0];
  EXPECT_TRUE(spaced.spaced);
  EXPECT_EQ(spaced.axis, "table");
  EXPECT_EQ(spaced.from, -10.0);
  EXPECT_EQ(spaced.to, 360.0);
  EXPECT_EQ(spaced.count, 36);
  EXPECT_FALSE(config.plans[0].axes[1].spaced);
  EXPECT_EQ(config.plans[0].axes[1].at, (std::vector<double>{1.0, 2.0}));
}

TEST(Config, AnAptAxisNamesAStageThatIsKnown) {
  const std::string apt = "[[axis]]\nname = \"arm\"\ndriver = \"apt\"\nendpoint = \"usb:83000001\"\n";
  EXPECT_THAT(refusal(apt), HasSubstr("stage"));
  EXPECT_THAT(refusal(apt + "stage = \"PRM2\"\n"), AllOf(StartsWith("rig.toml:5: "), HasSubstr("PRM1-Z8")));
  EXPECT_EQ(refusal(apt + "stage = \"PRM1-Z8\"\n"), "accepted");
}

TEST(Config, ASimulatedDeviceNeedsASimulatedLab) {
  const std::string camera = "[camera]\ndriver = \"simulated\"\n";
  EXPECT_THAT(refusal(camera), AllOf(StartsWith("rig.toml:2: "), HasSubstr("[sim]")));
  EXPECT_EQ(refusal(camera + "[sim]\n"), "accepted");
  EXPECT_THAT(refusal("[[axis]]\nname = \"t\"\ndriver = \"modbus\"\nendpoint = \"simulated\"\n"),
              AllOf(StartsWith("rig.toml:4: "), HasSubstr("[sim]")));
}

TEST(Config, AKeyOfAnotherDriverIsRefused) {
  EXPECT_THAT(refusal("[sim]\n[camera]\ndriver = \"simulated\"\ndevice = \"/dev/video0\"\n"),
              AllOf(StartsWith("rig.toml:4: "), HasSubstr("unknown key \"device\"")));
}

TEST(Config, RelativePathsStartAtTheFilesFolder) {
  const Config config =
      parse_config("[daemon]\nruntime_dir = \"run\"\nstate_dir = \"/s\"\n", "/etc/lab/rig.toml");
  EXPECT_EQ(config.daemon.runtime_dir, "/etc/lab/run");
  EXPECT_EQ(config.daemon.state_dir, "/s");
}

TEST(Config, ASocketModeIsOctalAndLeavesTheOwnerIn) {
  EXPECT_THAT(refusal("[api]\ncontrol_mode = \"rw\"\n"), HasSubstr("\"0600\" to \"0777\""));
  for (const std::string key : {"results_mode", "control_mode"})
    for (unsigned owner = 0; owner <= 8; ++owner) {
      const std::string text = "[api]\n" + key + " = \"0" + std::to_string(owner) + "40\"\n";
      if (owner == 8)
        EXPECT_THAT(refusal(text), HasSubstr("no file mode"));
      else if (owner < 6)
        EXPECT_THAT(refusal(text), HasSubstr("owner needs to read and write")) << text;
      else
        EXPECT_EQ(refusal(text), "accepted") << text;
    }
  const ApiOptions api =
      parse_config("[api]\nresults_mode = \"0777\"\ncontrol_mode = \"0600\"\n", "rig.toml").api;
  EXPECT_EQ(api.results_mode, 0777U);
  EXPECT_EQ(api.control_mode, 0600U);
}

}  // namespace
}  // namespace eigenpose
