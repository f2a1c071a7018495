/// The main job as its users see it: the real service on the simulated lab, commanded and read over its
/// sockets; objects are placed through the lab's socket, and its truth is what results are compared with.

#include <cmath>
#include <condition_variable>
#include <csignal>
#include <fstream>
#include <functional>
#include <memory>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/base/angle.h"
#include "core/base/clock.h"
#include "daemon/api/client/api_client.h"
#include "sim/lab/lab_client.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using nlohmann::json;

/// Small pictures and a fast table, so that the whole takes seconds. A scene counts as settled only after a
/// longer rest than the lab's hand makes over the table (300 ms), so that no settled result shows the hand
/// while it lets go.
constexpr const char* small_rig = R"(
[daemon]
runtime_dir = "run"
state_dir = "state"
[sim]
speed_factor = 50.0
[camera]
driver = "simulated"
width = 320
height = 240
frames_per_second = 50.0
[watch]
settle_ms = 500
[[axis]]
name = "table"
driver = "modbus"
endpoint = "simulated"
settle_ms = 10
[[plan]]
name = "default"
[[plan.axis]]
axis = "table"
from = 0.0
to = 360.0
count = 24
)";

/// A third of the 15 degrees between two learned views.
constexpr double pose_bound_deg = 5.0;

double monotonic_s() {
  return std::chrono::duration<double>(SteadyClock().now().time_since_epoch()).count();
}

/// Between two questions, so that the service and the lab have the machine.
void pause() {
  SteadyClock().sleep_for(std::chrono::milliseconds(3));
}

/// Keeps every result that the service streams from construction on.
class ResultReader {
 public:
  explicit ResultReader(const std::filesystem::path& socket)
      : thread_([this, socket](const std::stop_token& stop) {
          ApiClient(socket).follow(
              "/v1/results", [this](const ApiEvent& event) { return keep(event); }, stop);
        }) {}

  /// Waits for a settled result of a frame exposed after `since_s`. ctest's limit ends a wait for one that
  /// never comes.
  json settled_after(double since_s) {
    std::unique_lock lock(mutex_);
    const json* found = nullptr;
    arrived_.wait(lock, [&] {
      for (const json& result : results_)
        if (result.at("state") == "settled" && exposure_s(result) > since_s) found = &result;
      return found != nullptr;
    });
    return *found;
  }
  /// Every result of a frame exposed after `since_s`.
  std::vector<json> all_after(double since_s) {
    const std::lock_guard lock(mutex_);
    std::vector<json> found;
    for (const json& result : results_)
      if (exposure_s(result) > since_s) found.push_back(result);
    return found;
  }

 private:
  static double exposure_s(const json& result) { return result.at("exposure_monotonic_s").get<double>(); }
  bool keep(const ApiEvent& event) {
    if (event.name != "result") return true;
    {
      const std::lock_guard lock(mutex_);
      results_.push_back(json::parse(event.data));
    }
    arrived_.notify_all();
    return true;
  }

  std::mutex mutex_;
  std::condition_variable arrived_;
  std::vector<json> results_;  ///< guarded by mutex_
  std::jthread thread_;        ///< last: it uses the others
};

class EndToEnd : public testing::Test {
 protected:
  EndToEnd() {
    std::ofstream(rig_) << small_rig;
    daemon_ = std::make_unique<test::Program>(EIGENPOSED, std::vector<std::string>{"--config", rig_.string()},
                                              log_);
    for (;;) {
      try {
        (void)read_.get("/v1/status");
        break;
      } catch (const FileError&) {
        pause();  // it is starting
      }
    }
    lab_ = std::make_unique<sim::LabClient>(run_ / "lab.sock");
  }

  std::string log() const {
    std::ostringstream text;
    text << std::ifstream(log_).rdbuf();
    return text.str();
  }
  json run_job(const std::string& target, const json& body) {
    return control_.wait_for_job(control_.post(target, body).at("id").get<std::string>());
  }
  void acquire(const std::string& object) {
    lab_->clear();
    lab_->place(object);
    EXPECT_EQ(run_job("/v1/acquisitions", {{"object", object}}).at("total"), 24);
  }

  /// Waits while `condition` holds in the lab. @return when it was last seen to hold, seconds.
  double wait_while(const std::function<bool(const sim::Truth&)>& condition) {
    double last_s = monotonic_s();
    for (;;) {
      const double before_s = monotonic_s();
      if (!condition(lab_->truth())) return last_s;
      last_s = before_s;
      pause();
    }
  }
  /// A hand comes, puts the object down and leaves. @return since when the picture may be free of the hand.
  double place_by_hand(const std::string& object, double yaw_deg, double x_mm, double y_mm) {
    lab_->place(object, degrees(yaw_deg), x_mm, y_mm, true);
    return wait_while([](const sim::Truth& truth) { return truth.hand_in_view || truth.moving; });
  }

  test::TemporaryFolder folder_;
  std::filesystem::path run_ = folder_.path() / "run";
  std::filesystem::path rig_ = folder_.path() / "rig.toml";
  std::filesystem::path log_ = folder_.path() / "log";
  ApiClient read_{run_ / "results.sock"};
  ApiClient control_{run_ / "control.sock"};
  std::unique_ptr<test::Program> daemon_;
  std::unique_ptr<sim::LabClient> lab_;
};

/// One region, recognised as the one object that stands on the table, turned as the lab knows it.
void expect_the_truth(const json& result, const sim::Truth& truth) {
  ASSERT_EQ(truth.objects.size(), 1U);
  ASSERT_EQ(result.at("outcomes").size(), 1U) << result.dump();
  const json& outcome = result.at("outcomes")[0];
  EXPECT_EQ(outcome.at("verdict"), "recognized") << result.dump();
  EXPECT_EQ(outcome.at("object"), truth.objects[0].name) << result.dump();
  EXPECT_LT(std::abs(circular_difference(outcome.at("pose").at("table_deg").get<double>(),
                                         truth.objects[0].angle.degrees(), 360.0)),
            pose_bound_deg)
      << result.dump();
}

/// No region is recognised as anything but `object`; an empty name allows none.
void expect_no_other_than(const std::string& object, const std::vector<json>& results) {
  for (const json& result : results)
    for (const json& outcome : result.at("outcomes"))
      if (outcome.at("verdict") == "recognized") {
        EXPECT_EQ(outcome.at("object"), object) << result.dump();
      }
}

TEST_F(EndToEnd, AcquiresLearnsAndReportsWhatAHandPutsOnTheTable) {
  for (const char* object : {"duck", "car", "mug"}) ASSERT_NO_FATAL_FAILURE(acquire(object));
  lab_->clear();
  run_job("/v1/learn", json::object());
  EXPECT_EQ(read_.get("/v1/status").at("model").at("objects"), 3);

  ResultReader results(run_ / "results.sock");
  double since_s = monotonic_s();
  // Known objects, between two learned poses and off the table's centre.
  for (const auto& [object, yaw_deg] : {std::pair{"duck", 52.0}, {"car", 203.0}, {"mug", 338.0}}) {
    const double placed_s = monotonic_s();
    since_s = place_by_hand(object, yaw_deg, 6.0, -5.0);
    const json settled = results.settled_after(since_s);
    expect_the_truth(settled, lab_->truth());
    expect_no_other_than(object, results.all_after(placed_s));

    // A hand that stays over the object: not recognised, or rightly.
    const double reached_s = monotonic_s();
    lab_->hand(true);
    since_s = wait_while([](const sim::Truth& truth) { return truth.moving || !truth.hand_in_view; });
    (void)results.settled_after(since_s);
    lab_->hand(false);
    since_s = wait_while([](const sim::Truth& truth) { return truth.hand_in_view; });
    expect_the_truth(results.settled_after(since_s), lab_->truth());
    expect_no_other_than(object, results.all_after(reached_s));

    // The hand takes it away; the empty table is nothing.
    lab_->remove(lab_->truth().objects.at(0).id, true);
    since_s =
        wait_while([](const sim::Truth& truth) { return truth.hand_in_view || !truth.objects.empty(); });
    const json empty = results.settled_after(since_s);
    EXPECT_TRUE(empty.at("outcomes").empty()) << empty.dump();
  }
  // An object that was never learned.
  const double unknown_s = monotonic_s();
  since_s = place_by_hand("locomotive", 100.0, 0.0, 0.0);
  const json unknown = results.settled_after(since_s);
  ASSERT_EQ(unknown.at("outcomes").size(), 1U) << unknown.dump();
  EXPECT_EQ(unknown.at("outcomes")[0].at("verdict"), "unknown") << unknown.dump();
  expect_no_other_than("", results.all_after(unknown_s));

  // All the while the camera delivered, and nothing complained.
  const json camera = read_.get("/v1/status").at("camera");
  EXPECT_TRUE(camera.at("error").is_null()) << camera.dump();
  EXPECT_EQ(camera.at("times_lost"), 0);
  EXPECT_EQ(log().find("level=error"), std::string::npos) << log();
  EXPECT_EQ(log().find("level=warning"), std::string::npos) << log();
  daemon_->signal(SIGTERM);
  EXPECT_EQ(daemon_->wait(), 0) << log();
}

}  // namespace
}  // namespace eigenpose
