/// eigenposed as a program: starts, answers, refuses a second one, and stops cleanly.

#include <csignal>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <spawn.h>
#include <sys/wait.h>

#include "core/base/clock.h"
#include "daemon/api/client/api_client.h"
#include "sim/lab/lab_client.h"
#include "sim/lab/sim_lab.h"
#include "sim/modbus/modbus_server.h"
#include "tests/support/temporary_folder.h"

extern char** environ;

namespace eigenpose {
namespace {

using testing::HasSubstr;

/// A program under way, its stderr in a file. Killed if the test gives up.
class Program {
 public:
  Program(std::vector<std::string> arguments, const std::filesystem::path& log,
          const std::string& program = EIGENPOSED) {
    arguments.insert(arguments.begin(), program);
    std::vector<char*> pointers;
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 2, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    EXPECT_EQ(posix_spawn(&process_, program.c_str(), &actions, nullptr, pointers.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program() {
    if (process_ > 0) ::kill(process_, SIGKILL);
    if (process_ > 0) wait();
  }
  void signal(int number) const { ::kill(process_, number); }
  int wait() {
    int status = 0;
    ::waitpid(process_, &status, 0);
    process_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

 private:
  pid_t process_ = -1;
};

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
  Program daemon(arguments(), log_);
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
    EXPECT_EQ(entry.path().string().find(".part"), std::string::npos) << entry.path() << " is half-written";
  EXPECT_THAT(log(), HasSubstr("event=job_cancelled"));
  EXPECT_THAT(log(), HasSubstr("event=stopped"));
}

TEST_F(DaemonProcess, ASecondOneIsRefusedAndTheFirstGoesOn) {
  Program first(arguments(), log_);
  status_once_ready();
  const std::filesystem::path second_log = folder_.path() / "second";
  Program second(arguments(), second_log);
  EXPECT_EQ(second.wait(), 1);
  EXPECT_THAT(text_of(second_log), HasSubstr("another eigenposed answers on this socket: stop it first"));
  EXPECT_NO_THROW(status_once_ready());
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
    Program program(std::move(command), words, EIGENPOSE);
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
  Program daemon({"--config", rig_.string()}, log_);
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

TEST_F(DaemonProcess, ReplacesTheSocketsOfOneThatWasKilled) {
  {
    Program killed(arguments(), log_);
    status_once_ready();
    killed.signal(SIGKILL);
    killed.wait();
  }
  ASSERT_TRUE(std::filesystem::exists(run_ / "control.sock"));
  Program next(arguments(), log_);
  EXPECT_EQ(status_once_ready().at("program"), "eigenposed");
}

TEST_F(DaemonProcess, AnUnknownKeyStopsItBeforeAnythingIsOpened) {
  const std::filesystem::path file = folder_.path() / "rig.toml";
  std::ofstream(file) << "[daemon]\nruntme_dir = \"x\"\n";
  Program daemon({"--config", file.string(), "--runtime-dir", run_.string()}, log_);
  EXPECT_EQ(daemon.wait(), 1);
  EXPECT_THAT(log(),
              HasSubstr("rig.toml:2: unknown key \"runtme_dir\" in [daemon], did you mean \"runtime_dir\"?"));
  EXPECT_FALSE(std::filesystem::exists(run_));
}

TEST_F(DaemonProcess, CommandsNeedTheControlSocket) {
  Program daemon(arguments(), log_);
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
