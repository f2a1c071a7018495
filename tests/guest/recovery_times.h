#pragma once

/// How long a device that was away took to work again, cycle by cycle.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "core/base/clock.h"

namespace eigenpose::test {

/// One thread at a time.
class RecoveryTimes {
 public:
  void add(Duration time) { times_.push_back(time); }
  /// The longest; zero before the first.
  [[nodiscard]] Duration worst() const {
    return times_.empty() ? Duration{} : *std::max_element(times_.begin(), times_.end());
  }
  /// Median and worst, for the reader of the test's output.
  void print() const {
    if (times_.empty()) return;
    std::vector<Duration> sorted = times_;
    std::sort(sorted.begin(), sorted.end());
    const auto ms = [](Duration time) { return std::chrono::duration<double, std::milli>(time).count(); };
    std::printf("recovered %zu times: median %.0f ms, worst %.0f ms\n", sorted.size(),
                ms(sorted[sorted.size() / 2]), ms(sorted.back()));
  }

 private:
  std::vector<Duration> times_;
};

}  // namespace eigenpose::test
