#pragma once

/// A listener that checks what every listener may rely on.

#include <atomic>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "core/base/progress.h"

namespace eigenpose::test {

/// Takes no lock: it fails where two calls overlap, where a stage counts backwards or beyond its total, and
/// (in `expect_complete`) where a stage does not come to its end.
class SerialProgress {
 public:
  [[nodiscard]] Progress listener() {
    return [this](const ProgressUpdate& update) {
      EXPECT_FALSE(inside_.exchange(true)) << "two calls at the same time in " << update.stage;
      Stage& stage = stages_[std::string(update.stage)];
      EXPECT_GT(update.done, stage.done) << update.stage;
      EXPECT_LE(update.done, update.total) << update.stage;
      stage = {update.done, update.total};
      for (int i = 0; i < 200; ++i) busy_ = busy_ + 1;  // long enough for another call to come in
      inside_ = false;
    };
  }
  void expect_complete() const {
    EXPECT_FALSE(stages_.empty());
    for (const auto& [name, stage] : stages_) EXPECT_EQ(stage.done, stage.total) << name;
  }

 private:
  struct Stage {
    std::size_t done = 0;
    std::size_t total = 0;
  };
  std::atomic<bool> inside_{false};
  volatile int busy_ = 0;
  std::map<std::string, Stage> stages_;
};

}  // namespace eigenpose::test
