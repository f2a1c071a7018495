/// eigenposed as a program: starts, answers, refuses a second one, and stops cleanly.

#include <csignal>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <spawn.h>
#include <sys/wait.h>

#include "daemon/client/api_client.h"
#include "sim/lab/lab_client.h"
#include "tests/support/temporary_folder.h"

extern char** environ;

namespace eigenpose {
namespace {

using testing::HasSubstr;

/// A program under way, its stderr in a file. Killed if the test gives up.
class Program {
 public:
  Program(std::vector<std::string> arguments, const std::filesystem::path& log) {
    arguments.insert(arguments.begin(), EIGENPOSED);
    std::vector<char*> pointers;
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 2, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    EXPECT_EQ(posix_spawn(&process_, EIGENPOSED, &actions, nullptr, pointers.data(), environ), 0);
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
  std::string log() const {
    std::ifstream stream(log_);
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
  std::ifstream stream(second_log);
  std::ostringstream text;
  text << stream.rdbuf();
  EXPECT_THAT(text.str(), HasSubstr("another eigenposed answers on this socket: stop it first"));
  EXPECT_NO_THROW(status_once_ready());
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
