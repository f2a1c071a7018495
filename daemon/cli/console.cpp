#include "daemon/cli/console.h"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <iostream>

#include <fcntl.h>
#include <unistd.h>

#include "core/base/error.h"
#include "core/base/printable.h"

namespace eigenpose::cli {
namespace {

constexpr std::chrono::milliseconds terminal_period{100};
constexpr std::chrono::seconds plain_period{5};

}  // namespace

void prepare_output() {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  // Opened the wrong way round: reading or writing it is an error. open() takes the lowest number that is
  // free.
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(stream, F_GETFD) < 0 && errno == EBADF)
      (void)::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}

void flush_output() {
  errno = 0;
  const bool streamed = static_cast<bool>(std::cout.flush());
  const bool printed = std::fflush(stdout) == 0;
  const int error = errno;
  if (streamed && printed && std::ferror(stdout) == 0) return;
  throw Error(std::string("the output cannot be written") +
              (error != 0 ? std::string(": ") + std::strerror(error) : "") +
              "; what was printed is not complete");
}

void warn(const std::string& text) {
  (void)std::fflush(stdout);
  std::fprintf(stderr, "eigenpose: %s\n", printable(text).c_str());
}

ConsoleProgress::ConsoleProgress(bool quiet) : quiet_(quiet), terminal_(::isatty(STDERR_FILENO) == 1) {}

ConsoleProgress::~ConsoleProgress() {
  clear_line();
}

void ConsoleProgress::update(const ProgressUpdate& update) {
  if (quiet_) return;
  const std::scoped_lock lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (update.stage != stage_) {
    stage_ = update.stage;
    stage_began_ = now;
    // On a terminal a stage shows at once; in a log only when it takes long enough to wonder.
    last_shown_ = terminal_ ? std::chrono::steady_clock::time_point{} : now;
  }
  if (now - last_shown_ < (terminal_ ? std::chrono::steady_clock::duration(terminal_period) : plain_period))
    return;
  last_shown_ = now;
  const double seconds = std::chrono::duration<double>(now - stage_began_).count();
  if (terminal_) {
    std::fprintf(stderr, "\r\033[K%s %zu/%zu (%.0f s)", stage_.c_str(), update.done, update.total, seconds);
    std::fflush(stderr);
    line_shown_ = true;
  } else {
    std::fprintf(stderr, "%s %zu/%zu (%.0f s)\n", stage_.c_str(), update.done, update.total, seconds);
  }
}

Progress ConsoleProgress::callback() {
  return [this](const ProgressUpdate& step) { update(step); };
}

void ConsoleProgress::clear() {
  const std::scoped_lock lock(mutex_);
  clear_line();
}

void ConsoleProgress::clear_line() {
  if (!line_shown_) return;
  std::fputs("\r\033[K", stderr);
  std::fflush(stderr);
  line_shown_ = false;
}

}  // namespace eigenpose::cli
