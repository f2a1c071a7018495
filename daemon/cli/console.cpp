#include "daemon/cli/console.h"

#include <cstdio>

#include <unistd.h>

namespace eigenpose::cli {
namespace {

constexpr std::chrono::milliseconds terminal_period{100};
constexpr std::chrono::seconds plain_period{5};

}  // namespace

ConsoleProgress::ConsoleProgress(bool quiet) : quiet_(quiet), terminal_(::isatty(STDERR_FILENO) == 1) {}

ConsoleProgress::~ConsoleProgress() {
  clear();
}

void ConsoleProgress::update(const ProgressUpdate& update) {
  if (quiet_) return;
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
  if (!line_shown_) return;
  std::fputs("\r\033[K", stderr);
  std::fflush(stderr);
  line_shown_ = false;
}

}  // namespace eigenpose::cli
