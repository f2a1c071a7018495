/// eigenposed as a program: starts, answers, refuses a second one, and stops cleanly.

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/base/clock.h"
#include "daemon/api/client/api_client.h"
#include "sim/lab/lab_client.h"
#include "sim/lab/sim_lab.h"
#include "sim/modbus/modbus_server.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using test::Program;
using testing::HasSubstr;
using testing::Not;

class DaemonProcess : public testing::Test {
 protected:
  std::vector<std::string> arguments() const {
    return {"--config",      std::string(EIGENPOSE_SOURCE_DIR) + "/config/rigs/simulated.toml",
            "--runtime-dir", run_.string(),
            "--state-dir",   state_.string()};
  }
  nlohmann::json status_once_ready() const {
    for (;;) {
      try {
        return ApiClient(run_ / "results.sock").get("/v1/status");
      } catch (const FileError&) {
        std::this_thread::yield();  // it is starting; ctest's limit ends a start that never comes
      }
    }
  }
  std::string log() const { return text_of(log_); }
  static std::string text_of(const std::filesystem::path& file) {
    std::ifstream stream(file);
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
  }
  test::TemporaryFolder folder_;
  std::filesystem::path run_ = folder_.path() / "run";
  std::filesystem::path state_ = folder_.path() / "state";
  std::filesystem::path log_ = folder_.path() / "log";
};

TEST_F(DaemonProcess, StopsCleanlyInTheMiddleOfAnAcquisition) {
  Program daemon(EIGENPOSED, arguments(), log_);
  const nlohmann::json status = status_once_ready();
  EXPECT_EQ(status.at("program"), "eigenposed");
  {
    sim::LabClient lab(run_ / "lab.sock");
    lab.place("car");
  }
  const ApiClient control(run_ / "control.sock");
  const nlohmann::json job = control.post("/v1/acquisitions", {{"object", "car"}});
  while (control.get("/v1/jobs/" + job.at("id").get<std::string>()).at("done").get<int>() < 1)
    std::this_thread::yield();
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << log();
  EXPECT_TRUE(std::filesystem::is_empty(run_)) << "sockets are gone";
  for (const auto& entry : std::filesystem::recursive_directory_iterator(state_))
    EXPECT_EQ(entry.path().string().find("-part-"), std::string::npos) << entry.path() << " is half-written";
  EXPECT_THAT(log(), HasSubstr("event=job_cancelled"));
  EXPECT_THAT(log(), HasSubstr("event=stopped"));
}

TEST_F(DaemonProcess, ASecondOneIsRefusedAndTheFirstGoesOn) {
  Program first(EIGENPOSED, arguments(), log_);
  status_once_ready();
  const std::filesystem::path second_log = folder_.path() / "second";
  Program second(EIGENPOSED, arguments(), second_log);
  EXPECT_EQ(second.wait(), 1);
  EXPECT_THAT(text_of(second_log), HasSubstr("another eigenposed answers on this socket: stop it first"));
  EXPECT_NO_THROW(status_once_ready());
}

TEST_F(DaemonProcess, ASecondOneWithTheSameStateFolderIsRefusedAndNamesTheFirst) {
  Program first(EIGENPOSED, arguments(), log_);
  status_once_ready();
  const std::filesystem::path second_log = folder_.path() / "second";
  std::vector<std::string> elsewhere = arguments();
  elsewhere[3] = (folder_.path() / "run2").string();
  Program second(EIGENPOSED, elsewhere, second_log);
  EXPECT_EQ(second.wait(), 1);
  EXPECT_THAT(text_of(second_log),
              AllOf(HasSubstr("another eigenposed (process " + std::to_string(first.process()) + ")"),
                    HasSubstr(state_.string())));
  EXPECT_NO_THROW(status_once_ready());
}

TEST_F(DaemonProcess, FeedsTheWatchdogAndReportsItsStartAndItsStop) {
  const std::filesystem::path path = folder_.path() / "notify";
  const int notified = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
  ASSERT_EQ(::bind(notified, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
  ::setenv("WATCHDOG_USEC", "300000", 1);
  Program daemon(EIGENPOSED, arguments(), log_);
  ::unsetenv("NOTIFY_SOCKET");
  ::unsetenv("WATCHDOG_USEC");
  const auto wait_for = [&](const std::string& wanted) {
    std::array<char, 256> bytes{};
    for (;;) {
      const ssize_t count = ::recv(notified, bytes.data(), bytes.size(), 0);
      if (std::string_view(bytes.data(), static_cast<std::size_t>(std::max<ssize_t>(0, count))) == wanted)
        return;
    }
  };
  wait_for("READY=1");
  wait_for("WATCHDOG=1");
  wait_for("WATCHDOG=1");
  daemon.signal(SIGTERM);
  wait_for("STOPPING=1");
  EXPECT_EQ(daemon.wait(), 0) << log();
  ::close(notified);
}

/// A rig whose table is a drive of its own, apart from the service that is tried with it.
class DrivenByHand : public DaemonProcess {
 protected:
  DrivenByHand() {
    std::ofstream(rig_)
        << "[daemon]\nruntime_dir = \"run\"\nstate_dir = \"state\"\n"
        << "[[axis]]\nname = \"table\"\ndriver = \"modbus\"\nstation = 1\n"
        << "endpoint = \"tcp://127.0.0.1:" << drives_.port() << "\"\n"
        << "[[lamp]]\nname = \"key\"\ndriver = \"dmx\"\nendpoint = \"usb:NONE\"\nchannel = 1\n";
  }
  /// What `eigenpose COMMAND` says, and its exit code.
  std::pair<int, std::string> eigenpose(std::vector<std::string> command, const std::string& runtime_dir) {
    command.insert(command.end(),
                   {"--config", rig_.string(), "--runtime-dir", (folder_.path() / runtime_dir).string()});
    const std::filesystem::path words = folder_.path() / "words";
    Program program(EIGENPOSE, std::move(command), words);
    const int code = program.wait();
    return {code, text_of(words)};
  }
  double table_deg() const { return lab_.axis_position_deg(sim::LabAxis::table, clock_.now()); }

  SteadyClock clock_;
  sim::SimLab lab_{clock_};
  sim::SimModbusServer drives_{lab_, {.speed_factor = 50.0}};
  std::filesystem::path rig_ = folder_.path() / "rig.toml";
};

TEST_F(DrivenByHand, NothingMovesWhileTheServiceHoldsTheRig) {
  Program daemon(EIGENPOSED, {"--config", rig_.string()}, log_);
  while (status_once_ready().at("axes").at(0).at("position").is_null()) std::this_thread::yield();
  const double before = table_deg();
  const std::vector<std::vector<std::string>> commands = {
      {"jog", "table", "90"}, {"jog", "table", "5", "--by"}, {"home"}, {"lamp", "key", "1", "--for", "0"}};
  for (const std::vector<std::string>& command : commands) {
    const auto [code, words] = eigenpose(command, "run");
    EXPECT_NE(code, 0) << command[0];
    EXPECT_THAT(words, HasSubstr("eigenposed is running and holds the devices")) << command[0];
    EXPECT_THAT(words, HasSubstr("systemctl stop eigenposed")) << command[0];
  }
  // Nor with another configuration of the same drive, from which the running service cannot be known.
  for (const std::vector<std::string>& command : {commands[0], commands[1], commands[2]}) {
    const auto [code, words] = eigenpose(command, "elsewhere");
    EXPECT_NE(code, 0) << command[0];
    EXPECT_THAT(words, HasSubstr("table: ")) << command[0];
    EXPECT_THAT(words, HasSubstr("another program drives it")) << command[0];
    EXPECT_THAT(words, HasSubstr("systemctl stop eigenposed")) << command[0];
  }
  EXPECT_EQ(table_deg(), before);

  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << log();
  const auto [code, words] = eigenpose({"jog", "table", "90", "--home"}, "run");
  EXPECT_EQ(code, 0) << words;
  EXPECT_NEAR(table_deg(), 90.0, 0.05);
}

/// A table and a dimmer that stop and go dark for nobody but who tells them to: the drive's own watchdog is
/// off.
class InTheHandsOfACommand : public DrivenByHand {
 protected:
  static constexpr std::uint16_t dimmer = 0x0068;  // a spare register of the drive

  InTheHandsOfACommand() {
    std::string profile =
        text_of(std::string(EIGENPOSE_SOURCE_DIR) + "/config/profiles/oriental_motor_az.toml");
    const std::string watchdog = "watchdog_ms = 2000";
    EXPECT_NE(profile.find(watchdog), std::string::npos);
    profile.replace(profile.find(watchdog), watchdog.size(), "watchdog_ms = 0");
    std::ofstream(folder_.path() / "table.toml") << profile;
    std::ofstream(folder_.path() / "dimmer.toml")
        << "format = 1\nkind = \"lamp\"\nmodel = \"dimmer\"\nword_order = \"high_first\"\nfull = "
           "1000\n[commands]\n"
        << "set_level = [{ register = 0x68, values = [\"level:32\"] }]\n";
    const std::string endpoint = "endpoint = \"tcp://127.0.0.1:" + std::to_string(drives_.port()) + "\"\n";
    std::ofstream(rig_) << "[daemon]\nruntime_dir = \"run\"\nstate_dir = \"state\"\n"
                        << "[[axis]]\nname = \"table\"\ndriver = \"modbus\"\nstation = 1\n"
                        << "profile = \"table.toml\"\n"
                        << endpoint << "[[lamp]]\nname = \"key\"\ndriver = \"modbus\"\nstation = 2\n"
                        << "profile = \"dimmer.toml\"\n"
                        << endpoint;
  }
  /// Begins a long turn of the table and waits until it turns.
  std::unique_ptr<Program> begin_to_turn() {
    EXPECT_EQ(eigenpose({"home", "table"}, "run").first, 0) << text_of(words_);
    drives_.drive(1).set_speed_factor(0.5);
    const double before = table_deg();
    auto program = std::make_unique<Program>(
        EIGENPOSE, std::vector<std::string>{"jog", "table", "170", "--config", rig_.string()}, words_);
    while (table_deg() == before && !has_ended(*program)) std::this_thread::yield();
    return program;
  }
  static bool has_ended(const Program& program) {
    siginfo_t information{};
    ::waitid(P_PID, static_cast<id_t>(program.process()), &information, WEXITED | WNOHANG | WNOWAIT);
    return information.si_pid != 0;
  }
  /// Two signals of which the second finds the first one's work not done: the line is dead until then.
  void signal_twice(const Program& program) {
    drives_.faults().at_random(1.0, 1, {{sim::WireFaultKind::loss}});
    program.signal(SIGINT);
    program.signal(SIGTERM);
    while (!has_ended(program) && text_of(words_).find("as soon as its devices") == std::string::npos)
      std::this_thread::yield();
    drives_.faults().clear();
  }
  /// Waits until the table stands.
  double table_at_rest() {
    double before = table_deg();
    for (TimePoint since = clock_.now(); clock_.now() - since < std::chrono::milliseconds(20);) {
      if (table_deg() == before) continue;
      before = table_deg();
      since = clock_.now();
    }
    return before;
  }
  int dimmed() {
    std::array<std::uint16_t, 2> registers{};
    drives_.drive(2).read(dimmer, registers);
    return registers[0] * 65536 + registers[1];
  }
  static constexpr double well_before_the_target = 160.0;

  std::filesystem::path words_ = folder_.path() / "words";
};

TEST_F(InTheHandsOfACommand, TheTableStopsWhenTheTerminalIsClosed) {
  const std::unique_ptr<Program> jog = begin_to_turn();
  jog->signal(SIGHUP);
  EXPECT_EQ(jog->wait(), 130) << text_of(words_);
  EXPECT_LT(table_at_rest(), well_before_the_target);
  EXPECT_THAT(text_of(words_), HasSubstr("interrupted on request; the drive was told to stop"));
}

TEST_F(InTheHandsOfACommand, ASecondSignalDoesNotEndTheProgramBeforeTheTableWasToldToStop) {
  const std::unique_ptr<Program> jog = begin_to_turn();
  signal_twice(*jog);
  EXPECT_EQ(jog->wait(), 130) << text_of(words_);
  EXPECT_LT(table_at_rest(), well_before_the_target);
}

TEST_F(InTheHandsOfACommand, ASecondSignalDoesNotEndTheProgramBeforeTheLampIsDark) {
  Program lamp(EIGENPOSE, {"lamp", "key", "0.5", "--config", rig_.string()}, words_);
  while (dimmed() != 500 && !has_ended(lamp)) std::this_thread::yield();
  signal_twice(lamp);
  EXPECT_EQ(lamp.wait(), 0) << text_of(words_);
  EXPECT_EQ(dimmed(), 0);
}

TEST_F(DaemonProcess, ReplacesTheSocketsOfOneThatWasKilled) {
  {
    Program killed(EIGENPOSED, arguments(), log_);
    status_once_ready();
    killed.signal(SIGKILL);
    killed.wait();
  }
  ASSERT_TRUE(std::filesystem::exists(run_ / "control.sock"));
  Program next(EIGENPOSED, arguments(), log_);
  EXPECT_EQ(status_once_ready().at("program"), "eigenposed");
}

TEST_F(DaemonProcess, NothingFromOutsideMakesALogLineOfItsOwn) {
  const std::filesystem::path file = folder_.path() / "a\nlevel=error event=forged \x1b[2J.toml";
  std::filesystem::copy_file(std::string(EIGENPOSE_SOURCE_DIR) + "/config/rigs/simulated.toml", file);
  Program daemon(EIGENPOSED,
                 {"--config", file.string(), "--runtime-dir", run_.string(), "--state-dir", state_.string()},
                 log_);
  status_once_ready();
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << log();
  EXPECT_THAT(log(), HasSubstr("/a\\nlevel=error event=forged \\x1b[2J.toml"));
  EXPECT_THAT(log(), Not(HasSubstr("\nlevel=error event=forged")));
  EXPECT_THAT(log(), Not(HasSubstr("\x1b")));
}

TEST_F(DaemonProcess, AnUnknownKeyStopsItBeforeAnythingIsOpened) {
  const std::filesystem::path file = folder_.path() / "rig.toml";
  std::ofstream(file) << "[daemon]\nruntme_dir = \"x\"\n";
  Program daemon(EIGENPOSED, {"--config", file.string(), "--runtime-dir", run_.string()}, log_);
  EXPECT_EQ(daemon.wait(), 1);
  EXPECT_THAT(log(),
              HasSubstr("rig.toml:2: unknown key \"runtme_dir\" in [daemon], did you mean \"runtime_dir\"?"));
  EXPECT_FALSE(std::filesystem::exists(run_));
}

/// A configuration, and what is said of it before anything is opened.
struct Misconfiguration {
  std::string text;
  std::string complaint;
};

TEST_F(DaemonProcess, TheCheckRefusesWhatTheStartWouldRefuse) {
  const std::string sim = "[sim]\n";
  const std::string modbus = "[[axis]]\nname = \"t\"\ndriver = \"modbus\"\nendpoint = ";
  const std::string lamp = "[[lamp]]\nname = \"key\"\n";
  const std::string camera = sim + "[camera]\ndriver = \"simulated\"\n";
  const std::vector<Misconfiguration> all = {
      {modbus + "\"tcp://10.0.0.1:99999\"\n", "the port is above 65535"},
      {modbus + "\"tcp://:502\"\n", "no host"},
      {modbus + "\"tcp://10.0.0.1:502/\"\n", "is no port"},
      {modbus + "\"tcp://10.0.0.1\"\nprofile = \"nope.toml\"\n", "nope.toml"},
      {modbus + "\"tcp://10.0.0.1\"\nprofile = \"rig.toml\"\n", "rig.toml:"},
      {sim + modbus + "\"simulated\"\nstation = 9\n", "no drive at station 9"},
      {modbus + "\"rtu:/dev/ttyS0:9600:8N1\"\n[[axis]]\nname = \"u\"\ndriver = \"modbus\"\nstation = 2\n"
                "endpoint = \"rtu:/dev/ttyS0:19200:8N1\"\n",
       "one line cannot be set in two ways"},
      {sim + modbus +
           "\"simulated\"\nstation = 2\n[[axis]]\nname = \"u\"\ndriver = \"apt\"\n"
           "endpoint = \"simulated\"\nstage = \"PRM1-Z8\"\n",
       "both turn the simulated light arm"},
      {sim + "[[axis]]\nname = \"u\"\ndriver = \"apt\"\nendpoint = \"simulated\"\nstage = \"MTS50-Z8\"\n"
             "unit = \"mm\"\nlower = 0\nupper = 50\n",
       "moves in mm"},
      {"[[axis]]\nname = \"u\"\ndriver = \"apt\"\nendpoint = \"usb:1\"\nstage = \"MTS50-Z8\"\n",
       "moves in mm, the axis in deg"},
      {lamp + "driver = \"modbus\"\nendpoint = \"tcp://h\"\nprofile = \"nope.toml\"\n", "nope.toml"},
      {"[learn]\ntype = \"greyish\"\n", "greyish"},
      {sim + "[camera]\ndriver = \"replay\"\nfolder = \"nope\"\n", "nope"},
      {camera + "width = 641\n", "641"},
      {camera + "height = 8000\n", "8000"},
      {camera + "exposure_ms = 100\n", "exposure"},
      {"[daemon]\nruntime_dir = \"" + std::string(100, 'x') + "\"\n", "choose a shorter folder"},
      {"[api]\ncontrol_group = \"no-such-group\"\n", "no group \"no-such-group\""},
      {"[api]\nresults_group = \"no-such-group\"\n", "no group \"no-such-group\""},
  };
  const std::filesystem::path file = folder_.path() / "rig.toml";
  for (const Misconfiguration& wrong : all) {
    std::ofstream(file) << wrong.text;
    for (const bool check : {true, false}) {
      std::vector<std::string> arguments = {"--config", file.string(), "--state-dir", state_.string()};
      if (check) arguments.emplace_back("--check-config");
      Program daemon(EIGENPOSED, arguments, log_);
      EXPECT_EQ(daemon.wait(), 1) << wrong.text;
      EXPECT_THAT(log(), HasSubstr(wrong.complaint)) << wrong.text;
      EXPECT_FALSE(std::filesystem::exists(state_)) << "something was opened";
    }
  }
}

TEST_F(DaemonProcess, TheCheckAcceptsEveryShippedRigAndOpensNothing) {
  const std::filesystem::path rigs = std::filesystem::path(EIGENPOSE_SOURCE_DIR) / "config" / "rigs";
  int checked = 0;
  for (const auto& entry : std::filesystem::directory_iterator(rigs)) {
    if (entry.path().filename() == "replay.toml") continue;  // shows a folder that a user has to bring
    Program check(EIGENPOSED,
                  {"--check-config", "--config", entry.path().string(), "--runtime-dir", run_.string(),
                   "--state-dir", state_.string()},
                  log_);
    EXPECT_EQ(check.wait(), 0) << log();
    EXPECT_FALSE(std::filesystem::exists(run_)) << entry.path();
    ++checked;
  }
  EXPECT_GE(checked, 3);
}

TEST_F(DaemonProcess, CommandsNeedTheControlSocket) {
  Program daemon(EIGENPOSED, arguments(), log_);
  status_once_ready();
  try {
    ApiClient(run_ / "results.sock").post("/v1/learn", nlohmann::json::object());
    FAIL() << "obeyed";
  } catch (const ApiError& error) {
    EXPECT_EQ(error.status(), 403);
    EXPECT_THAT(error.what(), HasSubstr("control.sock"));
  }
}

}  // namespace
}  // namespace eigenpose
