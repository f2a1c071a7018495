#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "core/base/error.h"
#include "sim/lab/lab_client.h"
#include "sim/lab/lab_requests.h"
#include "sim/lab/lab_server.h"
#include "sim/modbus/modbus_server.h"

namespace eigenpose::sim {
namespace {

using testing::HasSubstr;

struct Folder {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("eigenpose-lab-" + std::to_string(::getpid()));
  Folder() { std::filesystem::create_directories(path); }
  ~Folder() { std::filesystem::remove_all(path); }
};

struct LabControl : testing::Test {
  Folder folder;
  SteadyClock clock;
  SimLab lab{clock};
  std::filesystem::path socket = folder.path / "lab.sock";
};

TEST_F(LabControl, PlacesTellsTheTruthAndRemoves) {
  const LabServer server(lab, socket);
  LabClient client(socket);
  const auto id = client.place("teapot", degrees(33.5), 4.0, -7.0);
  const Truth truth = client.truth();
  ASSERT_EQ(truth.objects.size(), 1U);
  EXPECT_EQ(truth.objects[0].id, id);
  EXPECT_EQ(truth.objects[0].name, "teapot");
  EXPECT_NEAR(truth.objects[0].angle.degrees(), 33.5, 1e-9);
  EXPECT_NEAR(truth.objects[0].y_mm, -7.0, 1e-9);
  client.remove(id);
  EXPECT_TRUE(client.truth().objects.empty());
  EXPECT_EQ(client.objects().size(), lab.objects().size());
}

TEST_F(LabControl, ServesSeveralClientsAtOnce) {
  const LabServer server(lab, socket);
  LabClient one(socket);
  LabClient two(socket);
  one.place("mug");
  two.place("duck", {}, 40.0, 0.0);
  EXPECT_EQ(one.truth().objects.size(), 2U);
  two.clear();
  EXPECT_TRUE(one.truth().objects.empty());
}

TEST_F(LabControl, SaysWhyItRefuses) {
  const LabServer server(lab, socket);
  LabClient client(socket);
  try {
    client.place("unicorn");
    FAIL() << "a unicorn was placed";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("has no object \"unicorn\""));
  }
  EXPECT_THROW(client.request("{\"do\": \"alarm\", \"unit\": 1, \"code\": 48}"), Error);  // no drives here
  EXPECT_THROW(client.request("this is no JSON"), Error);
  client.place("mug");  // and goes on
}

TEST_F(LabControl, BadLinesGetAnAnswerAndChangeNothing) {
  for (const char* line :
       {"", "{", "[]", "3", "{\"do\": 5}", "{\"do\": \"place\"}", "{\"do\": \"place\", \"object\": 4}",
        "{\"do\": \"lamp\", \"level\": 7}", "{\"do\": \"remove\", \"id\": -1}", "{\"do\": \"fly\"}",
        "{\"do\": \"lamp\", \"level\": true}", "{\"do\": \"lamp\", \"level\": \"1\"}",
        "{\"do\": \"hand\", \"in\": 1}", "{\"do\": \"hand\"}",
        "{\"do\": \"place\", \"object\": \"mug\", \"x_mm\": \"3\"}",
        "{\"do\": \"place\", \"object\": \"mug\", \"x_mm\": 500}",
        "{\"do\": \"place\", \"object\": \"mug\", \"hand\": 1}",
        "{\"do\": \"place\", \"object\": \"mug\", \"object\": \"duck\"}"}) {
    EXPECT_THAT(obey_lab_request(lab, nullptr, line), HasSubstr("\"ok\":false")) << line;
  }
  EXPECT_TRUE(lab.truth().objects.empty());
}

TEST_F(LabControl, NumbersThatCannotBeAreRefusedAndNotCut) {
  SimModbusServer modbus(lab, {});
  for (const char* line :
       {"{\"do\": \"alarm\", \"code\": 48, \"unit\": 257}",
        "{\"do\": \"alarm\", \"code\": 48, \"unit\": 1.0}", "{\"do\": \"alarm\", \"code\": 48.5}",
        "{\"do\": \"alarm\", \"code\": true}", "{\"do\": \"alarm\", \"code\": 4294967344}",
        "{\"do\": \"wire_fault\", \"kind\": \"silence\", \"times\": 4294967297}",
        "{\"do\": \"wire_fault\", \"kind\": \"exception\", \"exception_code\": 260}",
        "{\"do\": \"wire_fault\", \"kind\": \"late\", \"delay_ms\": -1}",
        "{\"do\": \"modbus\", \"alive\": 0}"})
    EXPECT_THAT(obey_lab_request(lab, &modbus, line), HasSubstr("\"ok\":false")) << line;
  EXPECT_EQ(modbus.drive(1).alarm(), 0);
  EXPECT_EQ(modbus.faults().next().kind, WireFaultKind::none);
}

TEST_F(LabControl, FaultsReachCameraDrivesAndWire) {
  SimModbusServer modbus(lab, {});
  const LabServer server(lab, socket, &modbus);
  LabClient client(socket);
  client.set_camera_faults({.stalled = true, .extra_noise = 3.0});
  EXPECT_TRUE(lab.camera_faults().stalled);
  EXPECT_EQ(lab.camera_faults().extra_noise, 3.0);
  client.request("{\"do\": \"drive_faults\", \"unit\": 2, \"stuck\": true}");
  EXPECT_TRUE(modbus.drive(2).faults().stuck);
  client.request("{\"do\": \"wire_fault\", \"kind\": \"silence\", \"times\": 2}");
  EXPECT_EQ(modbus.faults().next().kind, WireFaultKind::silence);
  client.request("{\"do\": \"alarm\", \"code\": 48}");
  EXPECT_EQ(modbus.drive(1).alarm(), 48);
}

TEST_F(LabControl, ASocketInUseIsRefusedAndALeftOneReplaced) {
  {
    const LabServer server(lab, socket);
    EXPECT_THROW(LabServer(lab, socket), Error);
  }
  EXPECT_FALSE(std::filesystem::exists(socket));
  EXPECT_THROW(LabClient{socket}, Error);
}

}  // namespace
}  // namespace eigenpose::sim
