#include "daemon/api/client/api_client.h"

#include <atomic>
#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/daemon/api/raw_client.h"

namespace eigenpose {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

/// A service with one job, which runs until somebody wants to cancel it.
class JobServerTest : public ServerFixture {
 protected:
  Application application() override {
    Application result;
    result.lane = [](const Request&) { return Lane::read; };
    result.answer = [this](const Request& request) -> Answer {
      if (request.method != "DELETE")
        return Response{200, "application/json", json{{"id", "1"}, {"state", state_.load()}}.dump(), {}};
      ++cancelled_;
      if (ends_as_ == nullptr) return Response{202, "application/json", "{}", {}};
      state_ = ends_as_;
      return error_response(refusal_, "job 1 has ended already", "");
    };
    return result;
  }
  json wait_interrupted() {
    start();
    std::stop_source stop;
    stop.request_stop();
    return ApiClient(socket_.path()).wait_for_job("1", {}, stop.get_token());
  }

  std::atomic<const char*> state_ = "running";
  const char* ends_as_ = nullptr;  ///< just before it can be cancelled; null: it is cancelled
  int refusal_ = 409;
  std::atomic<int> cancelled_ = 0;
};

TEST_F(JobServerTest, AnInterruptedWaitCancelsTheJob) {
  EXPECT_THROW(wait_interrupted(), Interrupted);
  EXPECT_EQ(cancelled_, 1);
}

TEST_F(JobServerTest, AJobThatEndsBeforeItCanBeCancelledGivesItsResult) {
  ends_as_ = "done";
  EXPECT_EQ(wait_interrupted().at("state"), "done");
  EXPECT_EQ(cancelled_, 1);
}

TEST_F(JobServerTest, AJobThatFailsBeforeItCanBeCancelledHasFailed) {
  ends_as_ = "failed";
  EXPECT_THROW(wait_interrupted(), ApiError);
}

TEST_F(JobServerTest, AnotherRefusalToCancelIsAnError) {
  ends_as_ = "running";
  refusal_ = 403;
  try {
    wait_interrupted();
    FAIL() << "waited on";
  } catch (const ApiError& error) {
    EXPECT_EQ(error.status(), 403);
    EXPECT_THAT(error.what(), HasSubstr("ended already"));
  }
}

}  // namespace
}  // namespace eigenpose
