/// The service eigenposed. `run` is its whole life, top to bottom.

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pthread.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <systemd/sd-daemon.h>

#include "config/config.h"
#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/printable.h"
#include "daemon/api/descriptor_budget.h"
#include "daemon/api/event_publisher.h"
#include "daemon/api/routes.h"
#include "daemon/api/server.h"
#include "daemon/api/unix_socket.h"
#include "daemon/composition.h"
#include "daemon/config_check.h"
#include "daemon/devices.h"
#include "daemon/manual/man_page.h"
#include "daemon/rig/heartbeat.h"
#include "daemon/service/service.h"
#include "daemon/service/state_lock.h"

namespace eigenpose {
namespace {

struct Options {
  std::filesystem::path config = "/etc/eigenpose/eigenposed.toml";
  std::filesystem::path runtime_dir;  ///< empty: the configuration's
  std::filesystem::path state_dir;
  bool check_only = false;
};

/// SIGTERM and SIGINT end the service, and only where it waits for them.
class Signals {
 public:
  Signals() {
    sigemptyset(&ending_);
    sigaddset(&ending_, SIGTERM);
    sigaddset(&ending_, SIGINT);
    // Before any other thread exists, so that all of them inherit it.
    pthread_sigmask(SIG_BLOCK, &ending_, nullptr);
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error of the write
    std::signal(SIGHUP, SIG_IGN);
  }
  /// Waits until the service should end. Meanwhile feeds systemd's watchdog, but only while every worker
  /// turns.
  [[nodiscard]] int wait(const Heartbeat& heartbeat) const {
    std::uint64_t watchdog_us = 0;
    const bool watched = ::sd_watchdog_enabled(0, &watchdog_us) > 0;
    const std::uint64_t period_us = watched ? watchdog_us / 3 : 60'000'000;
    std::vector<std::string> reported;
    for (;;) {
      const timespec period{static_cast<time_t>(period_us / 1'000'000),
                            static_cast<long>(period_us % 1'000'000 * 1000)};
      const int signal = ::sigtimedwait(&ending_, nullptr, &period);
      if (signal > 0) return signal;
      std::vector<std::string> overdue = heartbeat.overdue();
      if (watched && overdue.empty()) ::sd_notify(0, "WATCHDOG=1");
      if (!overdue.empty() && overdue != reported)
        spdlog::error("event=worker_hangs workers=\"{}\"", fmt::format("{}", fmt::join(overdue, ", ")));
      reported = std::move(overdue);
    }
  }

 private:
  sigset_t ending_{};
};

/// Ends the process if the rest of the way out takes too long: the motors stand still by then, and every file
/// is whole at any moment.
class ExitDeadline {
 public:
  explicit ExitDeadline(const Clock& clock)
      : thread_([&clock](const std::stop_token& left) {
          if (!clock.sleep_for(longest_way_out, left)) return;
          spdlog::critical("event=stop_timed_out seconds={}", longest_way_out.count());
          std::_Exit(1);
        }) {}

 private:
  static constexpr std::chrono::seconds longest_way_out{15};  ///< systemd kills after 20 s
  std::jthread thread_;
};

/// The text of a log line (%*), made printable: names and messages from outside make no line of their own.
class PrintableText : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm& /*time*/,
              spdlog::memory_buf_t& line) override {
    const std::string text = printable({message.payload.data(), message.payload.size()});
    line.append(text.data(), text.data() + text.size());
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<PrintableText>();
  }
};

void start_log(const std::string& level) {
  auto log = spdlog::stderr_logger_mt("eigenposed");
  // journald stamps the time itself; a terminal and a file do not.
  const bool journal = std::getenv("JOURNAL_STREAM") != nullptr;
  auto line = std::make_unique<spdlog::pattern_formatter>();
  line->add_flag<PrintableText>('*').set_pattern(journal ? "level=%l %*"
                                                         : "time=%Y-%m-%dT%H:%M:%S.%e level=%l %*");
  log->set_formatter(std::move(line));
  log->set_level(spdlog::level::from_str(level));
  log->flush_on(spdlog::level::info);
  spdlog::set_default_logger(std::move(log));
}

/// Makes a folder that only the service and its group enter, unless it is there.
void make_folder(const std::filesystem::path& folder, const std::string& key) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder))
    throw FileError(folder,
                    "the folder cannot be made: " + error.message() + ": change " + key + " in [daemon]");
}

void run(const Options& options) {
  Config config = read_config(options.config);
  if (!options.runtime_dir.empty())
    config.daemon.runtime_dir = std::filesystem::absolute(options.runtime_dir);
  if (!options.state_dir.empty()) config.daemon.state_dir = std::filesystem::absolute(options.state_dir);
  const ServiceOptions work = service_options(config);
  check_config(config);
  if (options.check_only) {
    std::printf("%s: good\n", options.config.c_str());
    return;
  }
  const Signals signals;
  start_log(config.daemon.log_level);
  spdlog::info("event=starting version={} config={}", EIGENPOSE_VERSION, config.file.string());
  const DescriptorBudget budget = share_descriptors(raise_descriptor_limit(), config.api.max_connections);
  spdlog::info("event=descriptors limit={} commanders={} readers={}", budget.limit, budget.commanders,
               budget.readers);
  make_folder(config.daemon.runtime_dir, "runtime_dir");
  make_folder(config.daemon.state_dir, "state_dir");
  // A second daemon is refused here, before any device is opened.
  const UnixSocket results(config.results_socket(), config.api.results_mode, config.api.results_group);
  const UnixSocket control(config.control_socket(), config.api.control_mode, config.api.control_group);
  const StateLock state(config.daemon.state_dir);
  const SteadyClock clock;
  std::optional<ExitDeadline> deadline;  // outlives all that may be slow to end
  Heartbeat heartbeat(clock);
  EventPublisher publisher(static_cast<std::size_t>(config.api.event_buffer));
  Devices devices = make_devices(config, clock);
  Service service(work, {devices.camera, devices.axes, devices.lamps}, publisher, heartbeat, clock);
  Heartbeat::Pulse pulse = heartbeat.join("server", std::chrono::seconds(15));
  Server server(server_options(config.api),
                make_application({service, publisher.results(), devices.simulation}),
                [&pulse] { pulse.beat(); });
  const EventLog::Subscription wake_streams = publisher.results()->subscribe([&server] { server.notify(); });
  server.listen(results, Access::read, budget.readers);
  server.listen(control, Access::control, budget.commanders);
  server.start();
  spdlog::info("event=ready results={} control={}", results.path().string(), control.path().string());
  ::sd_notify(0, "READY=1");

  const int signal = signals.wait(heartbeat);
  // First the motors, waiting for nobody; then the rest, within its deadline.
  deadline.emplace(clock);
  service.stop_motion();
  ::sd_notify(0, "STOPPING=1");
  spdlog::info("event=stopping signal={}", signal);
  // Leaving the scope ends the rest in reverse: clients, jobs, devices, sockets.
}

int main_with_words(int argc, char** argv) {
  Options options;
  CLI::App app(
      "Eigenpose's service: acquires and learns objects, watches the table, and answers on local sockets.",
      "eigenposed");
  app.set_version_flag("--version", std::string("eigenposed ") + EIGENPOSE_VERSION);
  app.add_option("--config", options.config, "Configuration file")->capture_default_str()->type_name("FILE");
  app.add_option("--runtime-dir", options.runtime_dir,
                 "Folder of the sockets, in the place of the configured one")
      ->type_name("DIR");
  app.add_option("--state-dir", options.state_dir,
                 "Folder of image sets and model, in the place of the configured one")
      ->type_name("DIR");
  app.add_flag("--check-config", options.check_only,
               "Only say whether the configuration is good; open nothing");
  app.footer(
      "Exit code: 0 stopped on SIGTERM or SIGINT, 1 could not start (one line on stderr says why), 2 usage "
      "error.");
  add_man_flag(app, 8, "eigenpose(1)");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::fprintf(stderr, "eigenposed: %s; 'eigenposed --help' explains\n", error.what());
    return 2;
  }
  try {
    run(options);
    if (!options.check_only) spdlog::info("event=stopped");
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "eigenposed: %s\n", printable(error.what()).c_str());
    return 1;
  }
}

}  // namespace
}  // namespace eigenpose

int main(int argc, char** argv) {
  return eigenpose::main_with_words(argc, argv);
}
