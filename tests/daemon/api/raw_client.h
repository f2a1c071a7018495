#pragma once

/// A client that sends raw bytes, well-formed or not, and a server on a socket of the test's own.

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "daemon/api/event_log.h"
#include "daemon/api/server.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {

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
  RawClient(RawClient&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  RawClient& operator=(RawClient&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~RawClient() { close(); }

  void send(const std::string& bytes) const { (void)!::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
  /// Everything until the server closes.
  std::string read_all() const {
    std::string all;
    while (read_more(all)) {
    }
    return all;
  }
  /// Until `text` has come or the server closes.
  std::string read_until(const std::string& text) const {
    std::string all;
    while (all.find(text) == std::string::npos && read_more(all)) {
    }
    return all;
  }
  /// Until `text` has come so many times or the server closes.
  std::string read_until(const std::string& text, int times) const {
    std::string all;
    for (int i = 0; i < times; ++i) {
      const std::string more = read_until(text);
      all += more;
      if (more.find(text) == std::string::npos) break;
    }
    return all;
  }
  /// Says that nothing more will be sent.
  void finish_sending() const { ::shutdown(fd_, SHUT_WR); }
  void close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

 private:
  bool read_more(std::string& all) const {
    char bytes[65536];
    const ssize_t count = ::recv(fd_, bytes, sizeof bytes, 0);
    if (count > 0) all.append(bytes, static_cast<std::size_t>(count));
    return count > 0;
  }
  int fd_;
};

/// A server whose application says what it was asked: "hello from PATH BODY", and streams `log` at /events.
class ServerFixture : public testing::Test {
 protected:
  static constexpr const char* get_hello = "GET /hello HTTP/1.1\r\nHost: x\r\n\r\n";
  static constexpr const char* get_last = "GET /hello HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
  static constexpr const char* get_events = "GET /events HTTP/1.1\r\nHost: x\r\n\r\n";

  void start(const ServerOptions& options = {}, int most = 64, Access access = Access::read) {
    server_ = std::make_unique<Server>(options, application());
    subscription_ = log_->subscribe([this] { server_->notify(); });
    server_->listen(socket_, access, most);
    server_->start();
  }
  virtual Application application() {
    Application echo;
    echo.answer = [this](const Request& request) -> Answer {
      if (request.path == "/events") return EventStream{log_, after_};
      return Response{200, "text/plain", "hello from " + request.path + " " + request.body, {}};
    };
    echo.lane = [](const Request&) { return Lane::read; };
    return echo;
  }
  void publish(const std::string& text = "{}") {
    log_->publish("result", [&](std::uint64_t) { return text; });
  }
  /// Sends one request on a connection of its own. @return everything until the server closes.
  std::string exchange(const std::string& bytes) const {
    const RawClient client(socket_.path());
    client.send(bytes);
    return client.read_all();
  }
  /// The server still answers a well-behaved client.
  void expect_alive() const {
    EXPECT_NE(exchange(get_last).find("hello from /hello"), std::string::npos) << "the server is alive";
  }
  void TearDown() override {
    subscription_ = {};
    server_.reset();
  }

  test::TemporaryFolder folder_;
  UnixSocket socket_{folder_.path() / "s.sock", 0600, ""};
  std::shared_ptr<EventLog> log_ = std::make_shared<EventLog>(8);
  std::uint64_t after_ = 0;  ///< streams begin behind this event
  std::unique_ptr<Server> server_;
  EventLog::Subscription subscription_;
};

}  // namespace eigenpose
