/// The program `eigenpose`: reads the line, runs one command, turns failures into one clear line on stderr.

#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <new>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <pthread.h>
#include <unistd.h>

#include "core/base/error.h"
#include "core/base/similar_word.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/console.h"
#include "daemon/cli/hardware_commands.h"
#include "daemon/cli/service_commands.h"
#include "daemon/manual/man_page.h"

namespace eigenpose::cli {
namespace {

/// The commands, in the order `--help` shows them.
const std::vector<AddCommand> commands = {
    add_acquire_command,  //
    add_results_command,  //
    add_status_command,   //
    add_objects_command,  //
#ifdef EIGENPOSE_SIM
    add_lab_command,  //
#endif
    add_import_command,     //
    add_learn_command,      //
    add_recognize_command,  //
    add_inspect_command,    //
    add_resample_command,   //
    add_evaluate_command,   //
    add_doctor_command,     //
    add_devices_command,    //
    add_jog_command,        //
    add_home_command,       //
    add_lamp_command,       //
};

constexpr const char* about =
    "Eigenpose learns objects from views taken all around them, and says which object stands before a camera "
    "and how it is turned.";

constexpr const char* first_steps = R"(
Start here:
  eigenpose import coil FOLDER --to SETS --angle index:5   turn photographs into image sets
  eigenpose learn SETS --to lab.model                      learn them
  eigenpose recognize photo.png --model lab.model          say what is in a picture
  eigenpose evaluate SETS --learn-every 2                  measure how well that works

'eigenpose COMMAND --help' explains one command, with examples.
Exit code: 0 done, 1 failed (one line on stderr says why), 2 usage error, 130 interrupted.)";

/// Waits for SIGINT, SIGTERM and SIGHUP on a thread of its own. The first asks for a stop, the second ends
/// the program; but as long as devices are in its hands, it only says what it waits for.
class SignalWatch {
 public:
  /// @param line outlives it; its `stop` is set.
  explicit SignalWatch(CommandLine& line) : line_(line) {
    line.stop = source_.get_token();
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    struct sigaction hangup {};
    // Under nohup the closed terminal is ignored, and stays so.
    if (sigaction(SIGHUP, nullptr, &hangup) == 0 && hangup.sa_handler != SIG_IGN)
      sigaddset(&signals_, SIGHUP);
    // Before any other thread exists, so that all of them inherit the mask.
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    watcher_ = std::thread([this] { watch(); });
  }
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;
  ~SignalWatch() {
    ending_ = true;
    pthread_kill(watcher_.native_handle(), SIGINT);
    watcher_.join();
  }

 private:
  void watch() {
    for (int count = 0;; ++count) {
      int signal = 0;
      while (sigwait(&signals_, &signal) != 0) continue;
      if (ending_) return;
      if (count == 0)
        source_.request_stop();
      else if (line_.devices_in_hand == 0)
        _exit(exit_interrupted);
      else if (count == 1)
        warn(
            "ends as soon as its devices have been told to stop; a motor that does not stop needs its "
            "emergency stop");
    }
  }

  CommandLine& line_;
  sigset_t signals_{};
  std::stop_source source_;
  std::atomic<bool> ending_{false};
  std::thread watcher_;
};

/// The one place where exceptions become one line on stderr.
int complain(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const Interrupted& interrupted) {
    warn(interrupted.what());
    return exit_interrupted;
  } catch (const UsageError& error) {
    warn(std::string("usage error: ") + error.what());
    return exit_usage;
  } catch (const std::bad_alloc&) {
    warn("out of memory; fewer views, a smaller --size or --grey need less");
  } catch (const std::filesystem::filesystem_error& error) {
    warn(error.path1().string() + ": " + error.code().message());
  } catch (const std::exception& error) {
    warn(error.what());
  }
  return exit_failed;
}

/// The exit code of `work`; also of its output, which is complete only when all of it was written.
int finished(const std::function<int()>& work) {
  try {
    const int code = work();
    flush_output();
    return code;
  } catch (...) {
    return complain(std::current_exception());
  }
}

/// What a line that CLI11 refuses should say: the word that is not known and the one that was meant, or
/// CLI11's own text.
std::string usage_text(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App* command = &app;
  std::string name = app.get_name();
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().front();
    name += " " + command->get_name();
  }
  const std::vector<std::string> unknown = app.remaining(true);
  const std::string help = "; '" + name + " --help' explains";
  if (unknown.empty()) return error.what() + help;
  const std::string word = unknown.front().substr(0, unknown.front().find('='));
  const bool is_option = word.starts_with('-');
  std::vector<std::string> known;
  if (is_option)
    for (const CLI::Option* option : command->get_options())
      for (const std::string& long_name : option->get_lnames()) known.push_back("--" + long_name);
  else
    for (const CLI::App* each : command->get_subcommands({})) known.push_back(each->get_name());
  if (known.empty()) return "\"" + word + "\" is one argument too many" + help;
  std::string text = std::string("there is no ") + (is_option ? "option" : "command") + " \"" + word + "\"";
  if (const auto meant = similar_word(word, known)) text += ", did you mean \"" + *meant + "\"?";
  return text + help;
}

int run(int argc, char** argv) {
  prepare_output();
  CommandLine line;
  const SignalWatch signals(line);

  CLI::App app(about, "eigenpose");
  app.set_version_flag("--version", std::string("eigenpose ") + EIGENPOSE_VERSION);
  add_man_flag(app, 1, "eigenposed(8)");
  app.require_subcommand(1);
  for (const AddCommand add : commands) add(app, line);
  app.footer(first_steps);  // last: a command takes over the footer of its parent

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return finished([&] { return app.exit(error); });  // --help, --version
    warn("usage error: " + usage_text(app, error));
    return exit_usage;
  }
  return finished(line.action);
}

}  // namespace
}  // namespace eigenpose::cli

int main(int argc, char** argv) {
  return eigenpose::cli::run(argc, argv);
}
