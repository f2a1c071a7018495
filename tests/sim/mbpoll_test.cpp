/// The simulated drives driven by mbpoll, a Modbus client made by others.

#include <array>
#include <cstdio>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/modbus/modbus_server.h"

namespace eigenpose::sim {
namespace {

using testing::ContainsRegex;
using testing::HasSubstr;

std::string output_of(const std::string& command) {
  std::string text;
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen((command + " 2>&1").c_str(), "r"), pclose);
  std::array<char, 512> chunk{};
  while (pipe && std::fgets(chunk.data(), chunk.size(), pipe.get()) != nullptr) text += chunk.data();
  return text;
}

TEST(Mbpoll, ReadsStatusHomesMovesAndReadsThePosition) {
  if (std::system("command -v mbpoll >/dev/null 2>&1") != 0) {
    GTEST_SKIP()
        << "mbpoll is not installed: not shown that a foreign client can drive the simulated turntable";
  }
  const SteadyClock clock;
  SimLab lab(clock);
  SimModbusServerOptions options;
  options.speed_factor = 50.0;
  SimModbusServer server(lab, options);
  const auto mbpoll = [&](const std::string& how, const std::string& values = {}) {
    return output_of("mbpoll -m tcp -p " + std::to_string(server.port()) + " -0 -1 -a 1 " + how +
                     " 127.0.0.1 " + values);
  };
  // -B: high word first, :hex as two registers would hide the words' order.
  EXPECT_THAT(mbpoll("-t 4:hex -r 126 -c 2"), ContainsRegex("\\[127\\]:[[:space:]]+0x4020"));
  EXPECT_THAT(mbpoll("-t 4 -r 124", "0 16"), HasSubstr("Written 2 references"));  // ZHOME
  EXPECT_THAT(mbpoll("-t 4 -r 124", "0 0"), HasSubstr("Written 2 references"));
  EXPECT_THAT(mbpoll("-t 4:int -B -r 88", "0 1 4500 9000 36000 36000 1000 1"),
              HasSubstr("Written 8 references"));
  std::string position;
  for (int attempt = 0; attempt < 50; ++attempt) {
    position = mbpoll("-t 4:int -B -r 204 -c 1");
    if (position.find("4500") != std::string::npos) break;
  }
  EXPECT_THAT(position, HasSubstr("4500"));
  EXPECT_NEAR(lab.truth().table.degrees(), 45.0, 1e-9);
  EXPECT_THAT(mbpoll("-t 4 -r 2 -c 1"), HasSubstr("Illegal data address"));
}

}  // namespace
}  // namespace eigenpose::sim
