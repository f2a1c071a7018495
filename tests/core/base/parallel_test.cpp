#include "core/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

namespace eigenpose {
namespace {

TEST(ParallelFor, DoesEveryItemOnce) {
  for (const unsigned threads : {0U, 1U, 2U, 7U}) {
    std::vector<std::atomic<int>> done(1000);
    parallel_for(done.size(), threads, [&](std::size_t i) { ++done[i]; });
    for (const auto& count : done) EXPECT_EQ(count, 1);
  }
  parallel_for(0, 0, [](std::size_t) { FAIL() << "there was nothing to do"; });
}

TEST(ParallelFor, HandsTheExceptionToTheCaller) {
  for (const unsigned threads : {1U, 4U})
    EXPECT_THROW(parallel_for(100, threads,
                              [](std::size_t i) {
                                if (i == 37) throw std::runtime_error("no");
                              }),
                 std::runtime_error);
}

TEST(ParallelFor, BeginsNothingAfterAnException) {
  std::atomic<std::size_t> begun{0};
  EXPECT_THROW(parallel_for(100000, 4,
                            [&](std::size_t) {
                              ++begun;
                              throw std::runtime_error("no");
                            }),
               std::runtime_error);
  EXPECT_LE(begun, 4U) << "one a thread at most";
}

TEST(ParallelFor, TheThreadsThatDidNotFailStopToo) {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 4);
  constexpr std::size_t count = 3000;  // seconds of work, of which the failure leaves next to nothing
  std::atomic<std::size_t> done{0};
  EXPECT_THROW(parallel_for(count, 4,
                            [&](std::size_t i) {
                              if (i == 0) throw std::runtime_error("no");
                              std::this_thread::sleep_for(std::chrono::milliseconds(1));
                              ++done;
                            }),
               std::runtime_error);
  EXPECT_LT(done, count - 1);
}

TEST(ParallelFor, NeverUsesMoreThreadsThanItMay) {
  // More threads than this machine may have cores, so that the limit of the call is what counts.
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  for (const unsigned threads : {1U, 2U, 3U}) {
    std::mutex mutex;
    std::set<std::thread::id> seen;  // guarded by mutex
    std::atomic<unsigned> active{0};
    std::atomic<bool> too_many{false};
    parallel_for(2000, threads, [&](std::size_t) {
      if (++active > threads) too_many = true;
      {
        const std::lock_guard lock(mutex);
        seen.insert(std::this_thread::get_id());
      }
      --active;
    });
    EXPECT_FALSE(too_many);
    EXPECT_LE(seen.size(), std::max(threads, 1U));
    if (threads == 1) {
      EXPECT_EQ(*seen.begin(), std::this_thread::get_id());
    }
  }
}

TEST(ParallelFor, MayBeNested) {
  std::vector<std::atomic<int>> done(400);
  parallel_for(20, 3,
               [&](std::size_t i) { parallel_for(20, 2, [&](std::size_t j) { ++done[20 * i + j]; }); });
  for (const auto& count : done) EXPECT_EQ(count, 1);
}

TEST(ParallelFor, ShowsTheCallerWhatTheThreadsWrote) {
  for (int round = 0; round < 200; ++round) {
    std::vector<std::size_t> written(16, 0);
    parallel_for(written.size(), 4, [&](std::size_t i) { written[i] = i + 1; });
    for (std::size_t i = 0; i < written.size(); ++i) ASSERT_EQ(written[i], i + 1);
  }
}

TEST(ParallelFor, TakesZeroForAllCores) {
  EXPECT_GE(resolved_threads(0), 1U);
  EXPECT_EQ(resolved_threads(5), 5U);
}

}  // namespace
}  // namespace eigenpose
