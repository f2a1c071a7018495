#pragma once

/// Times of one stage, and how they are distributed.

#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <time.h>

namespace eigenpose::bench {

/// Processor time of this thread, µs.
inline double thread_us() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) / 1e3;
}

/// Durations of one stage, µs.
class Series {
 public:
  explicit Series(std::string name) : name_(std::move(name)) {}
  void add(double us) { us_.push_back(us); }
  void print() { std::printf("  %-28s p50 %8.1f µs   p99 %8.1f µs\n", name_.c_str(), at(0.5), at(0.99)); }
  [[nodiscard]] double median() { return at(0.5); }

 private:
  double at(double share) {
    std::sort(us_.begin(), us_.end());
    return us_[static_cast<std::size_t>(share * static_cast<double>(us_.size()))];
  }

  std::string name_;
  std::vector<double> us_;
};

}  // namespace eigenpose::bench
