#include "daemon/service/jobs.h"

#include <condition_variable>
#include <future>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "tests/daemon/event_keeper.h"

namespace eigenpose::jobs_test {
namespace {

using ::testing::HasSubstr;

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
    JobStatus job = jobs.find(id).value();
    if (job.state != JobState::running) return job;
    std::this_thread::yield();
  }
}

class JobsTest : public ::testing::Test {
 protected:
  EventKeeper events_;
  ManualClock clock_;
  Heartbeat heartbeat_{clock_};
  Jobs jobs_{events_, heartbeat_};
};

TEST_F(JobsTest, RunsWorkAndKeepsItsResult) {
  const JobStatus first = jobs_.start(JobKind::learn, "", [](const Jobs::Context&) {
    return AcquisitionResult{"/sets/mug", 36, 4, 0, {}};
  });
  EXPECT_EQ(first.state, JobState::running);
  const JobStatus job = ended(jobs_, first.id);
  EXPECT_EQ(job.state, JobState::done);
  const auto& result = std::get<AcquisitionResult>(job.result);
  EXPECT_EQ(result.folder, "/sets/mug");
  EXPECT_EQ(result.views, 36U);
  EXPECT_EQ(result.kept, 4U);
  EXPECT_FALSE(job.failure);
  EXPECT_TRUE(job.ended);
}

TEST_F(JobsTest, ShowsProgressWhileItRuns) {
  std::promise<void> shown;
  const auto id = jobs_
                      .start(JobKind::learn, "",
                             [&](const Jobs::Context& job) {
                               job.progress({"normalising", 3, 36});
                               shown.set_value();
                               wait_for_stop(job.stop);
                               return JobResult();
                             })
                      .id;
  shown.get_future().wait();
  const JobStatus job = jobs_.find(id).value();
  EXPECT_EQ(job.stage, "normalising");
  EXPECT_EQ(job.done, 3U);
  EXPECT_EQ(job.total, 36U);
}

TEST_F(JobsTest, RefusesASecondOfItsKindButNotAnother) {
  const auto block = [](const Jobs::Context& job) {
    wait_for_stop(job.stop);
    return JobResult();
  };
  jobs_.start(JobKind::acquire, "mug", block);
  try {
    jobs_.start(JobKind::acquire, "duck", block);
    FAIL() << "accepted";
  } catch (const ServiceError& error) {
    EXPECT_EQ(error.fault(), Fault::busy);
    EXPECT_THAT(error.hint(), HasSubstr("cancel job 1"));
  }
  EXPECT_NO_THROW(jobs_.start(JobKind::learn, "", block));
}

TEST_F(JobsTest, CancelAsksTheWorkToStopAndItEndsAsCancelled) {
  const auto id = jobs_
                      .start(JobKind::acquire, "mug",
                             [](const Jobs::Context& job) -> JobResult {
                               wait_for_stop(job.stop);
                               throw Interrupted();
                             })
                      .id;
  ASSERT_TRUE(jobs_.cancel(id));
  EXPECT_EQ(ended(jobs_, id).state, JobState::cancelled);
}

TEST_F(JobsTest, AFailureSaysWhatHappenedAndWhatToDo) {
  const auto id = jobs_
                      .start(JobKind::acquire, "mug",
                             [](const Jobs::Context& job) -> JobResult {
                               job.add_hint("2 of 36 views are kept");
                               throw DeviceLost("table", "move to 30 deg", "connection closed");
                             })
                      .id;
  const JobStatus job = ended(jobs_, id);
  EXPECT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.failure->fault, Fault::device);
  EXPECT_EQ(job.failure->what, "table: move to 30 deg: connection closed");
  EXPECT_THAT(job.failure->hint, HasSubstr("power"));
  EXPECT_THAT(job.failure->hint, HasSubstr("2 of 36 views are kept"));
}

TEST_F(JobsTest, EndsWhatRunsWhenItEndsItself) {
  std::atomic<bool> stopped{false};
  {
    Jobs jobs(events_, heartbeat_);
    jobs.start(JobKind::acquire, "mug", [&](const Jobs::Context& job) {
      wait_for_stop(job.stop);
      stopped = true;
      return JobResult();
    });
  }
  EXPECT_TRUE(stopped);
}

TEST_F(JobsTest, PublishesTheStartAndTheEndOfEachJobInThisOrder) {
  const auto id = jobs_.start(JobKind::learn, "", [](const Jobs::Context&) { return JobResult(); }).id;
  const std::vector<JobChanged> seen = events_.first<JobChanged>(2);
  EXPECT_EQ(seen[0].job.id, id);
  EXPECT_EQ(seen[0].job.state, JobState::running);
  EXPECT_EQ(seen[1].job.state, JobState::done);
  EXPECT_TRUE(seen[1].job.ended);
}

TEST_F(JobsTest, AnErrorOfADeviceThatWasStoppedOnRequestEndsAsCancelled) {
  const auto id = jobs_
                      .start(JobKind::acquire, "mug",
                             [](const Jobs::Context& job) -> JobResult {
                               wait_for_stop(job.stop);
                               throw DeviceError("table", "move to 30 deg", "stopped on the way");
                             })
                      .id;
  jobs_.cancel(id);
  const JobStatus job = ended(jobs_, id);
  EXPECT_EQ(job.state, JobState::cancelled);
  EXPECT_THAT(job.failure->what, HasSubstr("stopped on the way"));
}

TEST_F(JobsTest, ADefectOfTheProgramIsNotBlamedOnTheCaller) {
  const auto id =
      jobs_
          .start(JobKind::learn, "",
                 [](const Jobs::Context&) -> JobResult { throw std::out_of_range("vector::_M_range_check"); })
          .id;
  EXPECT_EQ(ended(jobs_, id).failure->fault, Fault::internal);
}

TEST_F(JobsTest, AJobWhoseThreadCannotStartIsFailedAndBlocksNoOther) {
  bool full = true;
  Jobs jobs(events_, heartbeat_, [&](std::function<void(const std::stop_token&)> body) {
    if (full) throw std::system_error(EAGAIN, std::generic_category());
    return std::jthread(std::move(body));
  });
  const auto work = [](const Jobs::Context&) { return JobResult(); };
  const JobStatus job = jobs.start(JobKind::learn, "", work);
  EXPECT_EQ(job.state, JobState::failed);
  EXPECT_THAT(job.failure->what, HasSubstr("no thread"));
  EXPECT_TRUE(job.ended);
  EXPECT_EQ(jobs.find(job.id)->state, JobState::failed);
  EXPECT_FALSE(jobs.running(JobKind::learn));
  EXPECT_EQ(events_.first<JobChanged>(1)[0].job.state, JobState::failed);
  full = false;
  EXPECT_EQ(ended(jobs, jobs.start(JobKind::learn, "", work).id).state, JobState::done);
}

TEST_F(JobsTest, LearningWithoutProgressIsOverdueAndAnAcquisitionIsLeftToTheRig) {
  std::promise<void> begun, reported;
  std::promise<void> report;
  jobs_.start(JobKind::learn, "", [&](const Jobs::Context& job) {
    begun.set_value();
    report.get_future().wait();
    job.progress({"normalising", 1, 2});
    reported.set_value();
    wait_for_stop(job.stop);
    return JobResult();
  });
  jobs_.start(JobKind::acquire, "mug", [](const Jobs::Context& job) {
    wait_for_stop(job.stop);
    return JobResult();
  });
  begun.get_future().wait();
  clock_.advance(job_step_limit + std::chrono::seconds(1));
  EXPECT_THAT(heartbeat_.overdue(), ::testing::ElementsAre("job 1"));
  report.set_value();
  reported.get_future().wait();
  EXPECT_TRUE(heartbeat_.overdue().empty());
}

TEST_F(JobsTest, RemembersTheLastHundred) {
  for (int i = 0; i < 150; ++i)
    ended(jobs_, jobs_.start(JobKind::learn, "", [](const Jobs::Context&) { return JobResult(); }).id);
  EXPECT_LE(jobs_.list().size(), 100U);
  EXPECT_EQ(jobs_.list().back().id, "150");
  EXPECT_FALSE(jobs_.find("1"));
  EXPECT_FALSE(jobs_.find("nonsense"));
}

TEST_F(JobsTest, ForgetsHoweverAJobHasEndedAndNeverOneThatRuns) {
  const JobStatus running = jobs_.start(JobKind::acquire, "mug", [](const Jobs::Context& job) {
    wait_for_stop(job.stop);
    return JobResult();
  });
  for (int i = 0; i < 150; ++i) {
    const JobStatus job = jobs_.start(JobKind::learn, "", [i](const Jobs::Context&) {
      if (i % 3 == 1) throw Error("failed");
      if (i % 3 == 2) throw Interrupted();
      return JobResult();
    });
    ended(jobs_, job.id);
  }
  EXPECT_LE(jobs_.list().size(), 100U);
  ASSERT_TRUE(jobs_.find(running.id).has_value());
  EXPECT_EQ(jobs_.find(running.id)->state, JobState::running);
  for (int id = 2; id < 50; ++id) EXPECT_FALSE(jobs_.find(std::to_string(id))) << id;
}

}  // namespace
}  // namespace eigenpose::jobs_test
