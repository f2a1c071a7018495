#include "daemon/api/server.h"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/api/client/api_client.h"
#include "tests/daemon/api/raw_client.h"

namespace eigenpose {
namespace {

using std::chrono::milliseconds;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

class ServerTest : public ServerFixture {
 protected:
  /// The server learns on its own thread that a client has left: until then it says 503.
  std::string answer_once_there_is_room() const {
    for (;;) {
      std::string answer = exchange(get_last);
      if (answer.find("503") == std::string::npos) return answer;
    }
  }
  /// A client that follows the events and has got the header.
  [[nodiscard]] RawClient streaming_client() const {
    RawClient client(socket_.path());
    client.send(get_events);
    client.read_until("\r\n\r\n");
    return client;
  }
};

TEST_F(ServerTest, AnswersSeveralRequestsOnOneConnection) {
  start();
  RawClient client(socket_.path());
  client.send(get_hello);
  EXPECT_THAT(client.read_until("/hello"), StartsWith("HTTP/1.1 200 OK"));
  client.send(get_last);
  EXPECT_THAT(client.read_all(), HasSubstr("Connection: close"));
}

/// Its application throws, which it must not.
class ThrowingServerTest : public ServerTest {
 protected:
  Application application() override {
    Application result = ServerTest::application();
    result.answer = [echo = result.answer](const Request& request) -> Answer {
      if (request.path == "/throw") throw std::runtime_error("an oversight");
      if (request.path == "/throw-anything") throw 7;
      return echo(request);
    };
    result.lane = [](const Request& request) {
      if (request.path == "/no-lane") throw std::runtime_error("an oversight");
      return Lane::read;
    };
    return result;
  }
  [[nodiscard]] std::string answer_to(const std::string& path) const {
    return exchange("GET " + path + " HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  }
};

TEST_F(ThrowingServerTest, AnExceptionEndsItsOwnRequestAndNothingElse) {
  start({}, 2);
  for (int i = 0; i < 4; ++i) {
    EXPECT_THAT(answer_to("/throw"), StartsWith("HTTP/1.1 500 "));
    EXPECT_THAT(answer_to("/throw-anything"), StartsWith("HTTP/1.1 500 "));
    EXPECT_EQ(answer_to("/no-lane"), "") << "its connection is closed";
    expect_alive();
  }
}

TEST_F(ServerTest, AnExceptionWhileAClientIsAdmittedLosesThatClientAlone) {
  int admissions = 0;  // on the server's thread
  ServerOptions options;
  options.admit = [&](std::span<const Place> places, std::size_t most, uid_t user) {
    if (++admissions <= 2) throw std::bad_alloc();
    return admit(places, most, user);
  };
  start(options);
  EXPECT_EQ(exchange(get_last), "");
  EXPECT_EQ(exchange(get_last), "");
  expect_alive();
}

TEST_F(ServerTest, AnExceptionInAConnectionClosesItAndNoOther) {
  std::atomic<bool> fails = false;
  ServerOptions options;
  options.admit = [&](std::span<const Place> places, std::size_t most, uid_t user) {
    if (fails) throw std::runtime_error("an oversight");
    return admit(places, most, user);
  };
  start(options, 2);
  for (int i = 0; i < 4; ++i) {
    RawClient client(socket_.path());
    client.send(get_hello);
    client.read_until("/hello");
    fails = true;  // a place for an event stream
    client.send(get_events);
    EXPECT_EQ(client.read_all(), "");
    fails = false;
    expect_alive();
  }
}

TEST(Server, ABeatThatThrowsIsFollowedByOthers) {
  std::atomic<int> beats = 0;
  ServerOptions options;
  options.beat_period = milliseconds(1);
  Server server(options, {}, [&] {
    if (++beats < 3) throw std::runtime_error("an oversight");
  });
  server.start();
  while (beats < 5) std::this_thread::yield();
}

/// Answers to /wait come only once the test lets them.
class BlockingServerTest : public ServerTest {
 protected:
  Application application() override {
    Application result = ServerTest::application();
    result.answer = [this, echo = result.answer](const Request& request) {
      if (request.path == "/wait") {
        std::unique_lock lock(mutex_);
        ++waiting_;
        changed_.notify_all();
        changed_.wait(lock, [this] { return open_; });
      }
      return echo(request);
    };
    result.lane = [](const Request& request) {
      if (request.method == "DELETE") return Lane::stop;
      return request.method == "POST" ? Lane::command : Lane::read;
    };
    return result;
  }
  /// A request that is being answered.
  RawClient waiting_client(const std::string& method = "GET") {
    RawClient client(socket_.path());
    client.send(method + " /wait HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
    std::unique_lock lock(mutex_);
    const int before = seen_;
    changed_.wait(lock, [&] { return waiting_ > before; });
    seen_ = waiting_;
    return client;
  }
  void let_go() {
    const std::lock_guard lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }
  void TearDown() override {
    let_go();
    ServerTest::TearDown();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int waiting_ = 0;  ///< requests that have come to /wait
  int seen_ = 0;
  bool open_ = false;
};

TEST_F(BlockingServerTest, OneClientTooManyIsRefusedAndAdmittedOnceAnotherLeft) {
  start({}, 2);
  const RawClient first = waiting_client();
  const RawClient second = waiting_client();
  EXPECT_THAT(exchange(get_last), AllOf(StartsWith("HTTP/1.1 503 "), HasSubstr("too many clients: 2")));
  let_go();
  EXPECT_THAT(first.read_all(), HasSubstr("hello from /wait")) << "who is busy is not disturbed";
  EXPECT_THAT(answer_once_there_is_room(), HasSubstr("hello from /hello"));
}

TEST_F(BlockingServerTest, AStopWaitsForNoCommandAndACommandForNoReader) {
  start({}, 64, Access::control);
  const RawClient reader = waiting_client();
  EXPECT_THAT(exchange("POST /a HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"),
              HasSubstr("hello from /a"));
  const RawClient command = waiting_client("POST");
  EXPECT_THAT(exchange("DELETE /b HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"),
              HasSubstr("hello from /b"));
}

TEST_F(BlockingServerTest, ReadersOfOneSocketDoNotDelayThoseOfTheOther) {
  start();
  UnixSocket control(folder_.path() / "c.sock", 0600, "");
  Server both({}, application());
  UnixSocket results(folder_.path() / "r.sock", 0600, "");
  both.listen(results, Access::read, 64);
  both.listen(control, Access::control, 64);
  both.start();
  std::vector<RawClient> readers;
  for (int i = 0; i < 8; ++i) {
    readers.emplace_back(results.path());
    readers.back().send("GET /wait HTTP/1.1\r\nHost: x\r\n\r\n");
  }
  RawClient operator_client(control.path());
  operator_client.send(get_last);
  EXPECT_THAT(operator_client.read_all(), HasSubstr("hello from /hello"));
  let_go();
}

TEST_F(ServerTest, AnIdleConnectionGivesWayToANewOne) {
  start({}, 2);
  const RawClient first(socket_.path());
  first.send(get_hello);
  first.read_until("from /hello ");
  const RawClient second(socket_.path());
  second.send(get_hello);
  second.read_until("from /hello ");
  EXPECT_THAT(exchange(get_last), HasSubstr("hello from /hello"));
  EXPECT_EQ(first.read_all(), "") << "the one that was idle longest is closed";
  second.send(get_last);
  EXPECT_THAT(second.read_all(), HasSubstr("hello from /hello"));
}

TEST_F(ServerTest, SilentReadersOfTheStreamLeaveRoomForQuestions) {
  start({}, 8);
  std::vector<RawClient> readers;
  for (int i = 0; i < 6; ++i) readers.push_back(streaming_client());
  const RawClient one_more(socket_.path());
  one_more.send("GET /events HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(one_more.read_all(),
              AllOf(StartsWith("HTTP/1.1 503 "), HasSubstr("too many event streams: 6")));
  expect_alive();
  publish();
  EXPECT_THAT(readers.front().read_until("event: result"), HasSubstr("event: result")) << "none was dropped";
}

TEST_F(ServerTest, ClientsTurnedAwayHoldNoDescriptor) {
  start({}, 1);
  const RawClient stream = streaming_client();
  const auto descriptors = [] {
    const std::filesystem::directory_iterator all("/proc/self/fd");
    return std::distance(begin(all), end(all));
  };
  const auto before = descriptors();
  std::vector<RawClient> turned_away;
  constexpr int many = 200;
  for (int i = 0; i < many; ++i) {
    turned_away.emplace_back(socket_.path());
    EXPECT_THAT(turned_away.back().read_all(), StartsWith("HTTP/1.1 503 "));
  }
  // The test's own ends remain; of the server's at most the one that is being closed now.
  EXPECT_LE(descriptors(), before + many + 1);
}

TEST_F(ServerTest, StreamsEventsAsTheyAreAndAsTheyCome) {
  start();
  publish(R"({"n":1})");
  RawClient client(socket_.path());
  client.send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
  const std::string head = client.read_until(R"({"n":1})");
  EXPECT_THAT(head, HasSubstr("Content-Type: text/event-stream"));
  EXPECT_THAT(head, HasSubstr("id: " + log_->run() + "-1\nevent: result\ndata: {\"n\":1}\n\n"));
  publish(R"({"n":2})");
  EXPECT_THAT(client.read_until(R"({"n":2})"), HasSubstr("-2\nevent: result\n"));
}

TEST_F(ServerTest, ASlowClientIsToldWhatItLostAndDelaysNobody) {
  start();
  const RawClient slow = streaming_client();
  // More than socket buffers hold: the server's write to the slow client waits. Publishing and others do not.
  const std::string large = "\"" + std::string(100'000, 'x') + "\"";
  constexpr int events = 200;
  for (int i = 0; i < events; ++i) {
    publish(large);
    if (i % 50 == 0) expect_alive();
  }
  const std::string all = slow.read_until("-" + std::to_string(events) + "\nevent: ");
  EXPECT_THAT(all, HasSubstr("event: lost\ndata: {\"lost\":"));
  std::size_t got = 0;
  for (std::size_t at = all.find("id: "); at != std::string::npos; at = all.find("id: ", at + 1)) ++got;
  std::size_t lost = 0;
  const std::string mark = "{\"lost\":";
  for (std::size_t at = all.find(mark); at != std::string::npos; at = all.find(mark, at + 1))
    lost += std::stoul(all.substr(at + mark.size()));
  EXPECT_EQ(got + lost, static_cast<std::size_t>(events)) << "every event came or was counted as lost";
}

TEST_F(ServerTest, AStreamsPlaceIsFreeOnceItsClientHasLeft) {
  start({}, 1);
  { const RawClient client = streaming_client(); }
  EXPECT_THAT(answer_once_there_is_room(), HasSubstr("hello"));
}

TEST_F(ServerTest, ASilentStreamIsKeptAlive) {
  ServerOptions options;
  options.keep_alive = milliseconds(10);
  start(options);
  EXPECT_THAT(streaming_client().read_until("still here"), HasSubstr(": still here\n\n"));
}

// The comments come every 10 ms: after ten of them the time in which a client has to take something is over
// twice.
TEST_F(ServerTest, AStreamResumedWithABacklogGoesOnBeyondItsTimeout) {
  ServerOptions options;
  options.keep_alive = milliseconds(10);
  options.stream_timeout = milliseconds(50);
  options.request_timeout = milliseconds(50);
  start(options);
  for (int i = 0; i < 4; ++i) publish();
  after_ = 1;
  const RawClient client(socket_.path());
  client.send(get_events);
  client.read_until("-4\nevent");
  EXPECT_THAT(client.read_until("still here", 10), HasSubstr("still here"));
  publish();
  EXPECT_THAT(client.read_until("-5\nevent"), HasSubstr("-5\nevent")) << "it has not been cut";
}

TEST_F(ServerTest, AStreamWhoseClientTakesNothingIsClosed) {
  ServerOptions options;
  options.stream_timeout = milliseconds(50);
  start(options, 1);
  const RawClient dead = streaming_client();
  for (int i = 0; i < 50; ++i) publish("\"" + std::string(100'000, 'x') + "\"");
  EXPECT_THAT(answer_once_there_is_room(), HasSubstr("hello")) << "its place is free";
}

TEST_F(ServerTest, StopsWithClientsConnected) {
  start();
  const RawClient stream = streaming_client();
  const RawClient half(socket_.path());
  half.send(get_hello);
  half.read_until("/hello ");  // it has been admitted
  half.send("GET / HT");
  subscription_ = {};
  server_.reset();
  EXPECT_EQ(half.read_all(), "");
}

TEST_F(BlockingServerTest, TheServersThreadBeatsAlsoWhileALaneIsHeldUp) {
  ServerOptions options;
  options.beat_period = milliseconds(5);
  std::atomic<int> beats{0};
  UnixSocket socket(folder_.path() / "b.sock", 0600, "");
  Server server(options, application(), [&beats] { ++beats; });
  server.listen(socket, Access::read, 4);
  server.start();
  const RawClient held(socket.path());
  held.send("GET /wait HTTP/1.1\r\nHost: x\r\n\r\n");
  const int before = beats;
  while (beats < before + 3) std::this_thread::yield();
  let_go();
  EXPECT_THAT(held.read_until("from /wait"), HasSubstr("from /wait"));
}

TEST_F(ServerTest, NothingWakesAServerThatIsGone) {
  start();
  server_->stop();
  subscription_ = {};
  server_.reset();
  publish();
  EXPECT_EQ(log_->last_sequence(), 1U);
}

TEST_F(ServerTest, TheClientReadsTheStreamAndStopsWhenItLikes) {
  start();
  for (int i = 1; i <= 3; ++i) publish("{\"n\":" + std::to_string(i) + "}");
  std::vector<std::string> seen;
  ApiClient(socket_.path()).follow("/events", [&](const ApiEvent& event) {
    EXPECT_EQ(event.name, "result");
    EXPECT_EQ(event.id, seen.size() + 1);
    seen.push_back(event.data);
    return seen.size() < 3;
  });
  EXPECT_EQ(seen.back(), R"({"n":3})");
}

TEST_F(ServerTest, TheClientStopsFollowingOnRequest) {
  start();
  publish();
  publish();
  std::stop_source source;
  int seen = 0;
  ApiClient(socket_.path())
      .follow(
          "/events",
          [&](const ApiEvent&) {
            ++seen;
            source.request_stop();
            return true;
          },
          source.get_token());
  EXPECT_LE(seen, 2) << "at most what had come already";
  EXPECT_GE(seen, 1);
}

}  // namespace
}  // namespace eigenpose
