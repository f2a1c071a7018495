#include "daemon/service/jobs.h"

#include <condition_variable>
#include <future>
#include <mutex>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "daemon/api/errors.h"

namespace eigenpose {
namespace {

using testing::HasSubstr;

/// Blocks until the job is asked to stop.
void wait_for_stop(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait(lock, stop, [] { return false; });
}

/// Waits until the job has ended; the test's own timeout ends a job that never does.
JobStatus ended(const Jobs& jobs, const std::string& id) {
  for (;;) {
    const JobStatus job = jobs.find(id).value();
    if (job.state != JobState::running) return job;
    std::this_thread::yield();
  }
}

TEST(Jobs, RunsWorkAndKeepsItsResult) {
  Jobs jobs;
  const JobStatus first = jobs.start("learn", "", [](const Jobs::Context&) { return R"({"views":36})"; });
  EXPECT_EQ(first.state, JobState::running);
  const JobStatus job = ended(jobs, first.id);
  EXPECT_EQ(job.state, JobState::done);
  EXPECT_EQ(job.result, R"({"views":36})");
  EXPECT_TRUE(job.ended);
}

TEST(Jobs, ShowsProgressWhileItRuns) {
  Jobs jobs;
  std::promise<void> shown;
  const auto id = jobs.start("learn", "",
                             [&](const Jobs::Context& job) {
                               job.progress({"normalising", 3, 36});
                               shown.set_value();
                               wait_for_stop(job.stop);
                               return "{}";
                             })
                      .id;
  shown.get_future().wait();
  const JobStatus job = jobs.find(id).value();
  EXPECT_EQ(job.stage, "normalising");
  EXPECT_EQ(job.done, 3U);
  EXPECT_EQ(job.total, 36U);
}

TEST(Jobs, RefusesASecondOfItsKindButNotAnother) {
  Jobs jobs;
  const auto block = [](const Jobs::Context& job) {
    wait_for_stop(job.stop);
    return std::string("{}");
  };
  jobs.start("acquire", "mug", block);
  try {
    jobs.start("acquire", "duck", block);
    FAIL() << "accepted";
  } catch (const RequestError& error) {
    EXPECT_EQ(error.status(), 409);
    EXPECT_THAT(error.hint(), HasSubstr("DELETE /v1/jobs/1"));
  }
  EXPECT_NO_THROW(jobs.start("learn", "", block));
}

TEST(Jobs, CancelAsksTheWorkToStopAndItEndsAsCancelled) {
  Jobs jobs;
  const auto id = jobs.start("acquire", "mug",
                             [](const Jobs::Context& job) -> std::string {
                               wait_for_stop(job.stop);
                               throw Interrupted();
                             })
                      .id;
  ASSERT_TRUE(jobs.cancel(id));
  EXPECT_EQ(ended(jobs, id).state, JobState::cancelled);
}

TEST(Jobs, AFailureSaysWhatHappenedAndWhatToDo) {
  Jobs jobs;
  const auto id = jobs.start("acquire", "mug",
                             [](const Jobs::Context& job) -> std::string {
                               job.add_hint("2 of 36 views are kept");
                               throw DeviceLost("table", "move to 30 deg", "connection closed");
                             })
                      .id;
  const JobStatus job = ended(jobs, id);
  EXPECT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error, "table: move to 30 deg: connection closed");
  EXPECT_THAT(job.hint, HasSubstr("power"));
  EXPECT_THAT(job.hint, HasSubstr("2 of 36 views are kept"));
}

TEST(Jobs, EndsWhatRunsWhenItEndsItself) {
  std::atomic<bool> stopped{false};
  {
    Jobs jobs;
    jobs.start("acquire", "mug", [&](const Jobs::Context& job) {
      wait_for_stop(job.stop);
      stopped = true;
      return "{}";
    });
  }
  EXPECT_TRUE(stopped);
}

TEST(Jobs, RemembersTheLastHundred) {
  Jobs jobs;
  for (int i = 0; i < 150; ++i)
    ended(jobs, jobs.start("learn", "", [](const Jobs::Context&) { return "{}"; }).id);
  EXPECT_LE(jobs.list().size(), 100U);
  EXPECT_EQ(jobs.list().back().id, "150");
  EXPECT_FALSE(jobs.find("1"));
  EXPECT_FALSE(jobs.find("nonsense"));
}

}  // namespace
}  // namespace eigenpose
