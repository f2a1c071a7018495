/// Every route against every wrong request, without a socket.

#include "daemon/api/routes.h"

#include <algorithm>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/model/model_file.h"
#include "daemon/api/errors.h"
#include "daemon/api/event_publisher.h"
#include "daemon/api/frame_jpeg.h"
#include "daemon/api/target.h"
#include "tests/daemon/fakes.h"
#include "tests/support/learned_world.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

const std::string deep = std::string(40, '[') + std::string(40, ']');

/// Bodies of requests: wrong for every path, for an acquisition, and for learning.
const std::vector<std::string> wrong_anywhere = {"{",
                                                 "nonsense",
                                                 "[]",
                                                 "7",
                                                 "null",
                                                 "{\"a\":1,}",
                                                 deep,
                                                 "{} {}",
                                                 "\xff",
                                                 "{\"a\":NaN}",
                                                 "{\"object\":\"mug\",\"object\":\"mug\"}",
                                                 "{\"unknown\":1}"};
const std::vector<std::string> wrong_acquisitions = {
    "{}",
    R"({"object":1})",
    R"({"object":null})",
    R"({"object":""})",
    R"({"object":["mug"]})",
    R"({"object":"mug","plan":1})",
    R"({"object":"mug","plan":null})",
    R"({"object":"mug","plan":{}})",
    R"({"object":"mug","plan":{"axes":{}}})",
    R"({"object":"mug","plan":{"axes":[]}})",
    R"({"object":"mug","plan":{"axes":[7]}})",
    R"({"object":"mug","plan":{"axes":[{}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table"}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"other","at":[0]}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","at":[]}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","at":[0,0]}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","at":["0"]}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","at":[361]}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","at":[0],"count":1}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","from":0,"to":90,"count":2.9}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","from":0,"to":90,"count":true}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","from":0,"to":90,"count":0}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","from":0,"to":90,"count":4294967298}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","from":0,"to":90,"count":100001}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","from":"0","to":90,"count":2}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","from":0,"to":1e999,"count":2}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","from":0,"count":2}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","at":[0]},{"axis":"table","at":[1]}]}})",
    R"({"object":"mug","plan":{"axes":[{"axis":"table","at":[0]}],"name":"x"}})"};
const std::vector<std::string> wrong_learning = {
    R"({"components":true})",       R"({"components":4294967297})", R"({"components":20.7})",
    R"({"components":20.0})",       R"({"components":0})",          R"({"components":1025})",
    R"({"components":-1})",         R"({"components":"20"})",       R"({"components":null})",
    R"({"objects":"mug"})",         R"({"objects":[1]})",           R"({"objects":[]})",
    R"({"objects":["mug","mug"]})", R"({"objects":["../mug"]})",    R"({"objects":null})"};

class Routes : public ::testing::Test {
 protected:
  Routes() { start(std::chrono::seconds(10)); }
  void start(Duration stale_frame) {
    service_.reset();
    ServiceOptions options;
    options.stale_frame = stale_frame;
    options.image_sets = folder_.path() / "sets";
    options.model_file = folder_.path() / "lab.model";
    const Dof table{"table", "deg", 0.0, 360.0, true};
    options.plans = {make_plan({"default", {{"table", {0.0, 90.0}, {}}}}, std::vector<Dof>{table})};
    ServiceDevices devices;
    RigAxis axis;
    axis.options.dof = table;
    axis.open = [this, table] { return std::make_unique<FakeAxis>(table, table_, clock_); };
    devices.axes.push_back(axis);
    devices.camera = [this] { return std::make_unique<FakeCamera>(table_, Duration{}, clock_); };
    service_ =
        std::make_unique<Service>(std::move(options), std::move(devices), publisher_, heartbeat_, clock_);
    application_ = make_application({*service_, publisher_.results(), std::nullopt});
  }

  Response ask(const std::string& method, const std::string& target, const std::string& body = "",
               Access access = Access::control) {
    Request request = request_of(method, target);
    request.body = body;
    request.access = access;
    return std::get<Response>(application_.answer(request));
  }
  static Request request_of(const std::string& method, const std::string& target) {
    Target parsed = std::get<Target>(parse_target(target, method));
    Request request;
    request.method = method;
    request.path = std::move(parsed.path);
    request.query = std::move(parsed.query);
    return request;
  }
  static std::string error_of(const Response& response) {
    return json::parse(response.body).at("error").get<std::string>();
  }
  void wait_for_a_frame() const {
    while (!service_->camera().latest()) std::this_thread::yield();
  }
  JobStatus ended(const std::string& id) {
    for (;;) {
      const JobStatus job = service_->jobs().find(id).value();
      if (job.state != JobState::running) return job;
      std::this_thread::yield();
    }
  }
  /// A running acquisition: the table moves until it is stopped.
  std::string running_job() {
    {
      const std::lock_guard lock(table_.mutex);
      table_.blocks = true;
    }
    const Response started = ask("POST", "/v1/acquisitions", R"({"object": "mug"})");
    EXPECT_EQ(started.status, 202) << started.body;
    return json::parse(started.body).at("id").get<std::string>();
  }
  void publish_result(TimePoint exposure) {
    SceneResult result;
    result.frame = {381, exposure};
    publisher_.publish(result);
  }

  SteadyClock clock_;
  test::TemporaryFolder folder_;
  FakeAxisRecord table_;
  Heartbeat heartbeat_{clock_};
  EventPublisher publisher_{8};
  std::unique_ptr<Service> service_;
  Application application_;
};

TEST_F(Routes, APathThatIsNotThereIs404) {
  for (const char* path : {"/", "/v1", "/v1/", "/v2/status", "/v1/status/", "/v1/Status", "//v1/status",
                           "/v1/jobs/", "/v1/jobs/1/2", "/v1%2Fstatus", "/v1/frame.png", "/v1/learn/1"})
    for (const char* method : {"GET", "POST", "DELETE", "OPTIONS"}) {
      const Response response = ask(method, path);
      EXPECT_EQ(response.status, 404) << method << " " << path;
      EXPECT_FALSE(error_of(response).empty());
    }
}

TEST_F(Routes, AMethodThatIsNotForThePathIs405AndAllowSaysWhichAre) {
  const std::vector<std::pair<std::string, std::string>> all = {
      {"/v1/status", "GET, HEAD, OPTIONS"},
      {"/v1/objects", "GET, HEAD, OPTIONS"},
      {"/v1/results/latest", "GET, HEAD, OPTIONS"},
      {"/v1/results", "GET, HEAD, OPTIONS"},
      {"/v1/frame.jpg", "GET, HEAD, OPTIONS"},
      {"/v1/jobs", "GET, HEAD, OPTIONS"},
      {"/v1/jobs/7", "DELETE, GET, HEAD, OPTIONS"},
      {"/v1/acquisitions", "OPTIONS, POST"},
      {"/v1/acquisitions/7", "DELETE, GET, HEAD, OPTIONS"},
      {"/v1/learn", "OPTIONS, POST"}};
  for (const auto& [path, allowed] : all) {
    for (const std::string method : {"GET", "POST", "PUT", "PATCH", "DELETE", "TRACE"}) {
      if (allowed.find(method) != std::string::npos) continue;
      const Response refused = ask(method, path, "{}");
      EXPECT_EQ(refused.status, 405) << method << " " << path;
      EXPECT_EQ(refused.headers.at("Allow"), allowed) << method << " " << path;
    }
    const Response options = ask("OPTIONS", path);
    EXPECT_EQ(options.status, 204) << path;
    EXPECT_EQ(options.headers.at("Allow"), allowed) << path;
    EXPECT_EQ(options.body, "");
  }
  EXPECT_EQ(ask("OPTIONS", "*").headers.at("Allow"), "DELETE, GET, HEAD, OPTIONS, POST");
}

TEST_F(Routes, AKeyThatThePathDoesNotTakeIsRefused) {
  for (const char* path : {"/v1/status", "/v1/objects", "/v1/results/latest", "/v1/results", "/v1/frame.jpg",
                           "/v1/jobs", "/v1/jobs/1"}) {
    const Response response = ask("GET", std::string(path) + "?aftr=1");
    EXPECT_EQ(response.status, 400) << path;
    EXPECT_THAT(error_of(response), HasSubstr("\"aftr\"")) << path;
  }
  EXPECT_EQ(ask("GET", "/v1/jobs?after=1").status, 400) << "a key of another path";
}

TEST_F(Routes, CommandsNeedTheControlSocket) {
  for (const auto& [method, path] :
       std::vector<std::pair<std::string, std::string>>{{"POST", "/v1/acquisitions"},
                                                        {"POST", "/v1/learn"},
                                                        {"DELETE", "/v1/jobs/1"},
                                                        {"DELETE", "/v1/acquisitions/1"}}) {
    const Response response = ask(method, path, "{}", Access::read);
    EXPECT_EQ(response.status, 403) << method << " " << path;
    EXPECT_THAT(response.body, HasSubstr("control.sock"));
  }
  for (const char* path : {"/v1/status", "/v1/objects", "/v1/jobs"})
    EXPECT_EQ(ask("GET", path, "", Access::read).status, 200) << path;
  EXPECT_TRUE(service_->jobs().list().empty());
}

TEST_F(Routes, ABodyThatIsWrongIs400AndStartsNothing) {
  const auto refused = [this](const std::string& path, const std::vector<std::string>& bodies) {
    for (const std::string& body : bodies) {
      const Response response = ask("POST", path, body);
      EXPECT_EQ(response.status, 400) << path << " " << body << " " << response.body;
      EXPECT_THAT(response.body, HasSubstr("\"error\":")) << body;
    }
  };
  refused("/v1/acquisitions", wrong_anywhere);
  refused("/v1/acquisitions", wrong_acquisitions);
  refused("/v1/learn", wrong_anywhere);
  refused("/v1/learn", wrong_learning);
  EXPECT_TRUE(service_->jobs().list().empty()) << "no job was started";
}

TEST_F(Routes, AnImpossibleNameIsRefusedAtOnceAndPrintedEscaped) {
  for (const std::string name :
       {"..", ".", "a/b", "a b", "", "-mug", "m\nlevel=error event=x", "m\x1b[2J", "\xc3\xa4"}) {
    const Response response = ask("POST", "/v1/acquisitions", json{{"object", name}}.dump());
    EXPECT_EQ(response.status, 400) << name;
    EXPECT_THAT(error_of(response), AllOf(Not(HasSubstr("\n")), Not(HasSubstr("\x1b")))) << name;
  }
  EXPECT_EQ(ask("POST", "/v1/acquisitions", json{{"object", std::string(65, 'a')}}.dump()).status, 400);
  EXPECT_EQ(ask("POST", "/v1/acquisitions", R"({"object":"a\u0000b"})").status, 400);
  EXPECT_TRUE(service_->jobs().list().empty());
}

TEST_F(Routes, APlanInTheRequestIsFollowed) {
  const Response started =
      ask("POST", "/v1/acquisitions",
          R"({"object":"mug","plan":{"axes":[{"axis":"table","from":0,"to":360,"count":3}]}})");
  ASSERT_EQ(started.status, 202) << started.body;
  const json job = json::parse(started.body);
  EXPECT_EQ(started.headers.at("Location"), "/v1/jobs/" + job.at("id").get<std::string>());
  const JobStatus done = ended(job.at("id"));
  EXPECT_EQ(done.total, 3U);
  const std::lock_guard lock(table_.mutex);
  EXPECT_NE(std::find(table_.moves.begin(), table_.moves.end(), 120.0), table_.moves.end());
}

TEST_F(Routes, APlanThatIsNotThereIs404) {
  EXPECT_EQ(ask("POST", "/v1/acquisitions", R"({"object":"mug","plan":"nightly"})").status, 404);
}

TEST_F(Routes, ABodyOfAnotherTypeIs415) {
  const auto status = [this](const std::string& type) {
    Request request = request_of("POST", "/v1/learn");
    request.access = Access::control;
    request.body = R"({"components":0})";
    request.content_type = type;
    return std::get<Response>(application_.answer(request)).status;
  };
  for (const char* type :
       {"", "application/json", "Application/JSON; charset=\"UTF-8\"", "application/x-www-form-urlencoded"})
    EXPECT_EQ(status(type), 400) << type << ": read, and its number refused";
  for (const char* type : {"text/plain", "application/xml", "application/json; charset=latin1", "json",
                           "multipart/form-data; boundary=x"})
    EXPECT_EQ(status(type), 415) << type;
}

TEST_F(Routes, AJobThatHasEndedCannotBeCancelled) {
  const std::string id = running_job();
  EXPECT_EQ(ask("DELETE", "/v1/jobs/" + id).status, 202);
  EXPECT_EQ(ended(id).state, JobState::cancelled);
  const Response again = ask("DELETE", "/v1/jobs/" + id);
  EXPECT_EQ(again.status, 409);
  EXPECT_THAT(error_of(again), HasSubstr("ended already: it is cancelled"));
  EXPECT_EQ(ask("DELETE", "/v1/acquisitions/" + id).status, 409);
}

TEST_F(Routes, AJobOfAnotherKindIsNoAcquisition) {
  std::promise<void> leave;
  const JobStatus learning =
      service_->jobs().start(JobKind::learn, "", [&](const Jobs::Context&) -> JobResult {
        leave.get_future().wait();
        return {};
      });
  const std::string acquisition = running_job();
  for (const char* method : {"GET", "DELETE"}) {
    const Response refused = ask(method, "/v1/acquisitions/" + learning.id);
    EXPECT_EQ(refused.status, 404) << method;
    EXPECT_THAT(error_of(refused), HasSubstr("no acquisition")) << method;
    EXPECT_EQ(ask(method, "/v1/acquisitions/99").status, 404) << method;
  }
  EXPECT_EQ(json::parse(ask("GET", "/v1/jobs/" + learning.id).body).at("kind"), "learn");
  EXPECT_EQ(json::parse(ask("GET", "/v1/acquisitions/" + acquisition).body).at("id"), acquisition);
  leave.set_value();
  EXPECT_EQ(ended(learning.id).state, JobState::done) << "it was not cancelled";
  EXPECT_EQ(ask("DELETE", "/v1/acquisitions/" + acquisition).status, 202);
}

TEST_F(Routes, AJobThatIsNotThereIs404) {
  for (const char* id : {"1", "0", "-1", "abc", "1x", "99999999999999999999999"}) {
    EXPECT_EQ(ask("GET", std::string("/v1/jobs/") + id).status, 404) << id;
    EXPECT_EQ(ask("DELETE", std::string("/v1/jobs/") + id).status, 404) << id;
  }
}

TEST_F(Routes, ASecondJobOfAKindIs409) {
  const std::string id = running_job();
  EXPECT_EQ(ask("POST", "/v1/acquisitions", R"({"object": "duck"})").status, 409);
  EXPECT_EQ(json::parse(ask("GET", "/v1/jobs/" + id).body).at("state"), "running");
  EXPECT_EQ(json::parse(ask("GET", "/v1/jobs").body).at("jobs").size(), 1U);
}

TEST_F(Routes, TheFrameComesWithItsNumberAndAge) {
  wait_for_a_frame();
  const Response frame = ask("GET", "/v1/frame.jpg");
  ASSERT_EQ(frame.status, 200);
  EXPECT_EQ(frame.content_type, "image/jpeg");
  EXPECT_THAT(frame.body, StartsWith("\xff\xd8\xff"));
  EXPECT_GE(std::stoul(frame.headers.at("X-Frame-Sequence")), 1U);
  EXPECT_GE(std::stol(frame.headers.at("X-Frame-Age-Ms")), 0);
  EXPECT_LE(std::stol(frame.headers.at("X-Frame-Age-Ms")), 10'000);
}

TEST_F(Routes, AFrameAndAResultThatAreTooOldAre503) {
  wait_for_a_frame();
  publish_result(clock_.now());
  EXPECT_EQ(ask("GET", "/v1/results/latest").status, 200);
  start(Duration(-1));  // no frame is so young
  wait_for_a_frame();
  for (const char* path : {"/v1/frame.jpg", "/v1/results/latest"}) {
    const Response response = ask("GET", path);
    EXPECT_EQ(response.status, 503) << path;
    EXPECT_THAT(error_of(response), HasSubstr("old")) << path;
  }
}

TEST_F(Routes, TheLatestResultSaysItsAgeAndRun) {
  wait_for_a_frame();
  EXPECT_EQ(ask("GET", "/v1/results/latest").status, 404) << "before the first";
  const std::uint64_t before = publisher_.results()->last_sequence();
  publish_result(clock_.now() - std::chrono::seconds(7));
  publisher_.publish(CameraFound{});
  const json result = json::parse(ask("GET", "/v1/results/latest").body);
  EXPECT_EQ(result.at("frame_sequence"), 381);
  EXPECT_EQ(result.at("sequence"), before + 1) << "another event is no result";
  EXPECT_EQ(result.at("run"), publisher_.results()->run());
  EXPECT_GE(result.at("age_s").get<double>(), 7.0);
  EXPECT_LT(result.at("age_s").get<double>(), 8.0 + 60.0);
}

/// The watcher looks at the grey picture of a table at rest, with a model of grey views: nothing stands
/// there.
class WatchedRoutes : public Routes {
 protected:
  WatchedRoutes() {
    testing::SceneKnobs grey;
    grey.color = false;
    testing::write_turn(folder_.path() / "learned", "one", 1, 12, grey);
    LearningOptions options = testing::small_learning();
    options.normalization.color = false;
    const auto sets = open_image_sets(folder_.path() / "learned");
    save_model(learn(all_views(sets), options), folder_.path() / "lab.model");
    start(std::chrono::seconds(3600));
  }
  json latest() {
    const Response response = ask("GET", "/v1/results/latest");
    return response.status == 200 ? json::parse(response.body) : json{{"current", response.status}};
  }
  void wait_for_current(bool current) {
    while (latest().at("current") != current) std::this_thread::yield();
  }
};

TEST_F(WatchedRoutes, TheLatestResultIsCurrentWhileTheWatcherSeesWhatItSays) {
  wait_for_current(true);
  const json settled = latest();
  EXPECT_EQ(settled.at("state"), "settled");
  publish_result(clock_.now());
  EXPECT_EQ(latest().at("current"), false) << "the watcher has not published this one";
}

TEST_F(WatchedRoutes, TheLatestResultIsNotCurrentDuringAnAcquisition) {
  wait_for_current(true);
  const std::string id = running_job();
  wait_for_current(false);
  EXPECT_EQ(latest().at("state"), "settled") << "of the past";
  ask("DELETE", "/v1/jobs/" + id);
  EXPECT_EQ(ended(id).state, JobState::cancelled);
  wait_for_current(true);
}

TEST_F(WatchedRoutes, AnAcquisitionThatTakesPicturesRarelyIsNoSilentCamera) {
  start(Duration(-1));  // no frame is so young
  while (publisher_.results()->latest("result") == std::nullopt) std::this_thread::yield();
  EXPECT_EQ(ask("GET", "/v1/results/latest").status, 503);
  const std::string id = running_job();
  while (!service_->watcher().status().paused) std::this_thread::yield();
  const Response response = ask("GET", "/v1/results/latest");
  EXPECT_EQ(response.status, 200) << response.body;
  EXPECT_EQ(json::parse(response.body).at("current"), false);
  EXPECT_THAT(ask("GET", "/v1/frame.jpg").body, HasSubstr("an acquisition takes pictures only"));
}

TEST_F(Routes, ThePictureThatCannotBeEncodedIsAnErrorAndNoEmptyBody) {
  FrameJpeg frames;
  Frame frame;
  frame.sequence = 1;
  frame.image = cv::Mat(4, 4, CV_8UC1, cv::Scalar(7));
  EXPECT_FALSE(frames.of(frame)->empty());
  frame.sequence = 2;
  frame.image = cv::Mat(1, 70'000, CV_8UC1, cv::Scalar(7));  // JPEG counts to 65535
  EXPECT_THROW((void)frames.of(frame), Error);
  EXPECT_THROW((void)frames.of(frame), Error) << "nothing of it is kept";
}

TEST_F(Routes, AStreamContinuesBehindTheEventThatWasSeen) {
  for (int i = 0; i < 5; ++i) publish_result(clock_.now());
  const std::string run = publisher_.results()->run();
  const auto begins = [&](const std::string& target, const std::string& last_event_id) {
    Request request = request_of("GET", target);
    request.last_event_id = last_event_id;
    const Answer answer = application_.answer(request);
    if (const auto* refused = std::get_if<Response>(&answer)) return -refused->status;
    return static_cast<int>(std::get<EventStream>(answer).after);
  };
  EXPECT_EQ(begins("/v1/results", ""), 5) << "what comes from now on";
  EXPECT_EQ(begins("/v1/results", run + "-3"), 3);
  EXPECT_EQ(begins("/v1/results", "3"), 3);
  EXPECT_EQ(begins("/v1/results?after=" + run + "-2", run + "-3"), 2) << "the query goes before the header";
  EXPECT_EQ(begins("/v1/results?after=0", ""), 0);
  EXPECT_EQ(begins("/v1/results", "0000beef-3"), 0) << "of another run all is new";
  for (const char* bad : {"x", "-1", "1x", "1.5", "run-", "-", "99999999999999999999999"})
    EXPECT_EQ(begins("/v1/results", bad), -400) << bad;
  EXPECT_EQ(begins("/v1/results?after=", ""), -400);
}

TEST_F(Routes, LosingTheCameraIsAnEventOfTheStream) {
  publisher_.publish(CameraLost{"camera: unplugged"});
  const auto lost = publisher_.results()->after(0);
  ASSERT_TRUE(lost);
  EXPECT_EQ(lost->name, "camera_lost");
  EXPECT_EQ(json::parse(*lost->data).at("error"), "camera: unplugged");
  publisher_.publish(CameraFound{});
  EXPECT_EQ(publisher_.results()->after(1)->name, "camera_found");
}

TEST_F(Routes, CommandsAndStopsHaveLanesOfTheirOwn) {
  const auto lane = [this](const std::string& method, const std::string& path) {
    return application_.lane(request_of(method, path));
  };
  EXPECT_EQ(lane("GET", "/v1/objects"), Lane::read);
  EXPECT_EQ(lane("POST", "/v1/learn"), Lane::command);
  EXPECT_EQ(lane("POST", "/v1/acquisitions"), Lane::command);
  EXPECT_EQ(lane("DELETE", "/v1/jobs/1"), Lane::stop);
  EXPECT_EQ(lane("DELETE", "/v1/acquisitions/1"), Lane::stop);
  EXPECT_EQ(lane("DELETE", "/nowhere"), Lane::read);
}

TEST_F(Routes, EachKindOfFaultHasItsStatus) {
  const auto answer_to = [](const auto& error) { return error_response(std::make_exception_ptr(error)); };
  for (const auto& [fault, status] :
       {std::pair(Fault::invalid_request, 400), std::pair(Fault::not_found, 404),
        std::pair(Fault::conflict, 409), std::pair(Fault::busy, 409), std::pair(Fault::interrupted, 409),
        std::pair(Fault::unavailable, 503), std::pair(Fault::device, 503), std::pair(Fault::file, 500),
        std::pair(Fault::internal, 500)}) {
    EXPECT_EQ(http_status(fault), status) << static_cast<int>(fault);
    EXPECT_EQ(answer_to(ServiceError(fault, "what", "hint")).status, status) << static_cast<int>(fault);
  }
  EXPECT_EQ(answer_to(DeviceTimeout("table", "move", "late")).status, 503);
  EXPECT_EQ(answer_to(DeviceError("table", "move", "alarm")).status, 503);
  EXPECT_EQ(answer_to(Interrupted()).status, 409);
  EXPECT_EQ(answer_to(ConfigError("no such axis")).status, 400);
  EXPECT_EQ(answer_to(UnsupportedMediaType("what", "hint")).status, 415);
  const Response full = answer_to(FileError("/s/model.h5", "cannot be written: the disk is full"));
  EXPECT_EQ(full.status, 500);
  EXPECT_THAT(error_of(full), HasSubstr("the disk is full")) << "the operator can do something about it";
}

TEST_F(Routes, AnInternalFaultBlamesNobodyAndKeepsItsDetailInTheLog) {
  const auto answer_to = [](const auto& error) { return error_response(std::make_exception_ptr(error)); };
  for (const Response& response :
       {answer_to(std::invalid_argument("the matrix is 3 x 4")), answer_to(std::out_of_range("vector::at")),
        answer_to(std::logic_error("index")), answer_to(Error("secret detail")),
        error_response(std::make_exception_ptr(7))}) {
    EXPECT_EQ(response.status, 500);
    EXPECT_EQ(error_of(response), "eigenposed failed to answer");
    EXPECT_THAT(response.body, HasSubstr("log"));
  }
  json broken;
  try {
    broken = json::parse("{");
  } catch (...) {
    EXPECT_EQ(error_response(std::current_exception()).status, 500)
        << "a broken file is no fault of the client";
  }
  EXPECT_EQ(answer_to(ServiceError(Fault::conflict, "what", "hint")).status, 409);
  EXPECT_EQ(answer_to(DeviceLost("table", "move", "gone")).status, 503);
}

}  // namespace
}  // namespace eigenpose
