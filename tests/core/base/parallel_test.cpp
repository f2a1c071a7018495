#include "core/base/parallel.h"

#include <atomic>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace eigenpose
