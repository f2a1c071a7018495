#include "daemon/api/server.h"

#include <cstring>
#include <future>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/base/clock.h"
#include "daemon/api/client/api_client.h"
#include "daemon/api/event_log.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

/// A client that speaks raw bytes, well or badly.
class RawClient {
 public:
  explicit RawClient(const std::filesystem::path& path)
      : fd_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.native().copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;
  ~RawClient() { close(); }

  void send(const std::string& bytes) { (void)!::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  /// Everything until the server closes.
  std::string read_all() {
    std::string all;
    while (read_more(all)) {
    }
    return all;
  }
  /// Until `text` has come or the server closes.
  std::string read_until(const std::string& text) {
    std::string all;
    while (all.find(text) == std::string::npos && read_more(all)) {
    }
    return all;
  }
  void close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

 private:
  bool read_more(std::string& all) {
    char bytes[65536];
    const ssize_t count = ::recv(fd_, bytes, sizeof bytes, 0);
    if (count > 0) all.append(bytes, static_cast<std::size_t>(count));
    return count > 0;
  }
  int fd_;
};

constexpr const char* get_hello = "GET /hello HTTP/1.1\r\nHost: x\r\n\r\n";
constexpr const char* get_last = "GET /hello HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";

class ServerTest : public testing::Test {
 protected:
  void start(ServerOptions options = {}) {
    server_ = std::make_unique<Server>(
        options,
        [this](const Request& request) -> Answer {
          if (request.path == "/events") return EventStream{log_, "result", 0};
          if (request.path == "/hang") {
            entered_.set_value();
            let_go_.get_future().wait();
          }
          return Response{200, "text/plain", "hello from " + request.path + " " + request.body, {}};
        },
        heartbeat_);
    wake_ = log_->subscribe([this] { server_->notify(); });
    server_->listen(socket_, Access::read);
    server_->start();
  }
  void publish(const std::string& text = "{}") {
    log_->publish([&](std::uint64_t) { return text; });
  }
  /// The server learns on its own thread that a client has left: until then it says 503.
  std::string answer_once_there_is_room() {
    for (;;) {
      RawClient client(socket_.path());
      client.send(get_last);
      std::string answer = client.read_all();
      if (answer.find("503") == std::string::npos) return answer;
    }
  }
  /// The server still answers a well-behaved client.
  void expect_alive() {
    RawClient client(socket_.path());
    client.send(get_last);
    EXPECT_THAT(client.read_all(), HasSubstr("hello from /hello"));
  }

  test::TemporaryFolder folder_;
  UnixSocket socket_{folder_.path() / "s.sock", 0600, ""};
  std::shared_ptr<EventLog> log_ = std::make_shared<EventLog>(8);
  ManualClock clock_;  // of the heartbeat alone
  Heartbeat heartbeat_{clock_};
  std::promise<void> entered_, let_go_;
  std::unique_ptr<Server> server_;
  EventLog::Subscription wake_;
};

TEST_F(ServerTest, AnswersSeveralRequestsOnOneConnection) {
  start();
  RawClient client(socket_.path());
  client.send(get_hello);
  EXPECT_THAT(client.read_until("/hello"), StartsWith("HTTP/1.1 200 OK"));
  client.send(get_last);
  EXPECT_THAT(client.read_all(), HasSubstr("Connection: close"));
}

TEST_F(ServerTest, GarbageGets400AndDisturbsNobody) {
  start();
  for (const std::string& garbage :
       {std::string("GARBAGE\r\n\r\n"), std::string("GET / HTTP/9.9\r\n\r\n"),
        std::string("\x16\x03\x01\x02\r\n\r\n", 8),
        std::string("GET / HTTP/1.1\r\nContent-Length: minus\r\n\r\n"),
        std::string("GET no-slash HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"),
        std::string("POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n")}) {
    RawClient client(socket_.path());
    client.send(garbage);
    const std::string answer = client.read_all();
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 400 ")) << garbage;
    EXPECT_THAT(answer, HasSubstr("\"error\":")) << garbage;
  }
  expect_alive();
}

TEST_F(ServerTest, ABodyThatIsTooLargeGets413) {
  ServerOptions options;
  options.max_body = 1000;
  start(options);
  RawClient client(socket_.path());
  client.send("POST / HTTP/1.1\r\nContent-Length: 1001\r\n\r\n");
  EXPECT_THAT(client.read_all(), AllOf(StartsWith("HTTP/1.1 413 "), HasSubstr("1000 bytes")));
  expect_alive();
}

TEST_F(ServerTest, AHeaderThatIsTooLargeGets431) {
  start();
  RawClient client(socket_.path());
  client.send("GET / HTTP/1.1\r\nX: " + std::string(20'000, 'x') + "\r\n\r\n");
  EXPECT_THAT(client.read_all(), StartsWith("HTTP/1.1 431 "));
  expect_alive();
}

TEST_F(ServerTest, ARequestThatDoesNotArriveInTimeIsGivenUp) {
  ServerOptions options;
  options.request_timeout = std::chrono::milliseconds(50);
  start(options);
  RawClient client(socket_.path());
  client.send("GET / HTTP/1.1\r\nHost:");
  EXPECT_EQ(client.read_all(), "");  // returns because the server closes
  expect_alive();
}

TEST_F(ServerTest, OneClientTooManyIsToldAndLetInOnceAnotherLeft) {
  ServerOptions options;
  options.max_connections = 2;
  start(options);
  RawClient first(socket_.path());
  RawClient second(socket_.path());
  first.send(get_hello);
  second.send(get_hello);
  first.read_until("/hello");
  second.read_until("/hello");
  {
    RawClient third(socket_.path());
    EXPECT_THAT(third.read_all(), AllOf(StartsWith("HTTP/1.1 503 "), HasSubstr("too many clients: 2")));
  }
  first.close();
  EXPECT_THAT(answer_once_there_is_room(), HasSubstr("hello"));
}

TEST_F(ServerTest, StreamsEventsAsTheyAreAndAsTheyCome) {
  start();
  publish(R"({"n":1})");
  RawClient client(socket_.path());
  client.send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
  const std::string head = client.read_until(R"({"n":1})");
  EXPECT_THAT(head, HasSubstr("Content-Type: text/event-stream"));
  EXPECT_THAT(head, HasSubstr("id: 1\nevent: result\ndata: {\"n\":1}\n\n"));
  publish(R"({"n":2})");
  EXPECT_THAT(client.read_until(R"({"n":2})"), HasSubstr("id: 2\nevent: result\n"));
}

TEST_F(ServerTest, ASlowClientIsToldWhatItLostAndDelaysNobody) {
  start();
  RawClient slow(socket_.path());
  slow.send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
  slow.read_until("\r\n\r\n");
  // More than socket buffers hold: the server's write to the slow client waits. Publishing and others do not.
  const std::string large = "\"" + std::string(100'000, 'x') + "\"";
  constexpr int events = 200;
  for (int i = 0; i < events; ++i) {
    publish(large);
    if (i % 50 == 0) expect_alive();
  }
  const std::string all = slow.read_until("id: " + std::to_string(events) + "\n");
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
  ServerOptions options;
  options.max_connections = 1;
  start(options);
  {
    RawClient client(socket_.path());
    client.send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
    client.read_until("\r\n\r\n");
  }
  EXPECT_THAT(answer_once_there_is_room(), HasSubstr("hello"));
}

TEST_F(ServerTest, ASilentStreamIsKeptAlive) {
  ServerOptions options;
  options.keep_alive = std::chrono::milliseconds(10);
  start(options);
  RawClient client(socket_.path());
  client.send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(client.read_until("still here"), HasSubstr(": still here\n\n"));
}

TEST_F(ServerTest, StopsWithClientsConnected) {
  start();
  RawClient stream(socket_.path());
  stream.send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
  stream.read_until("\r\n\r\n");
  RawClient half(socket_.path());
  half.send(get_hello);
  half.read_until("/hello");  // it has been let in
  half.send("GET / HT");
  wake_ = {};
  server_.reset();
  EXPECT_EQ(half.read_all(), "");
}

TEST_F(ServerTest, IsOverdueWhileAHandlerHoldsItUpAndOnlyThen) {
  start();
  clock_.advance(std::chrono::seconds(16));
  while (!heartbeat_.overdue().empty()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  RawClient client(socket_.path());
  client.send("GET /hang HTTP/1.1\r\nHost: x\r\n\r\n");
  entered_.get_future().wait();
  clock_.advance(std::chrono::seconds(16));
  EXPECT_THAT(heartbeat_.overdue(), testing::ElementsAre("server"));
  let_go_.set_value();
  client.read_until("/hang");
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
  std::stop_source source;
  ApiClient(socket_.path())
      .follow(
          "/events",
          [&](const ApiEvent&) {
            source.request_stop();
            return true;
          },
          source.get_token());
  SUCCEED() << "follow has returned";
}

}  // namespace
}  // namespace eigenpose
