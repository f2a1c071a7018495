/// RFC 9110 and 9112 against a running server over its socket: what it takes a connection to see. The rules
/// of a single request are in request_reader_test.cpp.

#include <atomic>
#include <chrono>
#include <regex>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/api/raw_client.h"

namespace eigenpose {
namespace {

using std::chrono::milliseconds;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class HttpConformance : public ServerFixture {
 protected:
  static std::string header_of(const std::string& answer) {
    return answer.substr(0, answer.find("\r\n\r\n"));
  }
  static std::string body_of(const std::string& answer) {
    const std::size_t end = answer.find("\r\n\r\n");
    return end == std::string::npos ? "" : answer.substr(end + 4);
  }
  /// The header without the fields that change from one answer to the next.
  static std::string stable_header(const std::string& answer) {
    return std::regex_replace(header_of(answer), std::regex("\r\nDate: [^\r]*"), "");
  }
};

TEST_F(HttpConformance, AnAnswerHasDateTypeAndLength) {
  start();
  const std::string answer = exchange(get_last);
  const std::string header = header_of(answer);
  EXPECT_THAT(header, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_TRUE(std::regex_search(
      header,
      std::regex("\r\nDate: (Mon|Tue|Wed|Thu|Fri|Sat|Sun), [0-9]{2} (Jan|Feb|Mar|Apr|May|Jun|Jul|Aug|Sep|Oct|"
                 "Nov|Dec) [0-9]{4} [0-9]{2}:[0-9]{2}:[0-9]{2} GMT(\r\n|$)")))
      << header;
  EXPECT_THAT(header, HasSubstr("\r\nContent-Type: text/plain"));
  EXPECT_THAT(header, HasSubstr("\r\nContent-Length: 18"));
  EXPECT_THAT(header, HasSubstr("\r\nConnection: close"));
  EXPECT_EQ(body_of(answer), "hello from /hello ");
}

TEST_F(HttpConformance, HeadSaysWhatGetWouldAndSendsNoBody) {
  start();
  const std::string get = exchange("GET /hello HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  const std::string head = exchange("HEAD /hello HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(stable_header(head), stable_header(get));
  EXPECT_EQ(body_of(head), "");
}

TEST_F(HttpConformance, HeadOfAStreamSendsNoEventAndTheConnectionGoesOn) {
  start();
  publish();
  const RawClient client(socket_.path());
  client.send("HEAD /events HTTP/1.1\r\nHost: x\r\n\r\n" + std::string(get_last));
  const std::string all = client.read_all();
  EXPECT_THAT(header_of(all), HasSubstr("Content-Type: text/event-stream"));
  EXPECT_THAT(all, Not(HasSubstr("event: result")));
  EXPECT_THAT(body_of(all), StartsWith("HTTP/1.1 200 OK\r\n")) << "the next answer follows at once";
}

TEST_F(HttpConformance, AnswersPipelinedRequestsInTheirOrder) {
  start();
  std::string requests;
  for (const char* path : {"/one", "/two", "/three"})
    requests += "POST " + std::string(path) + " HTTP/1.1\r\nHost: x\r\nContent-Length: 2\r\n\r\n{}";
  const std::string all = exchange(requests + get_last);
  const std::size_t one = all.find("from /one");
  const std::size_t two = all.find("from /two");
  const std::size_t three = all.find("from /three");
  const std::size_t last = all.find("from /hello");
  EXPECT_TRUE(one < two && two < three && three < last && last != std::string::npos) << all;
}

TEST_F(HttpConformance, ClosesAfterConnectionCloseAndIgnoresWhatFollows) {
  start();
  const std::string all = exchange(std::string(get_last) + "GET /second HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(all, Not(HasSubstr("/second")));
}

TEST_F(HttpConformance, Http10ClosesUnlessItAsksForMore) {
  start();
  EXPECT_THAT(
      exchange("GET /hello HTTP/1.0\r\n\r\n"),
      AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("Connection: close"), EndsWith("hello from /hello ")));
  const std::string kept =
      exchange("GET /hello HTTP/1.0\r\nConnection: keep-alive\r\n\r\nGET /second HTTP/1.0\r\n\r\n");
  EXPECT_THAT(kept, AllOf(HasSubstr("Connection: keep-alive"), EndsWith("hello from /second ")));
}

TEST_F(HttpConformance, Http10GetsAStreamWithoutChunks) {
  start();
  publish(R"({"n":1})");
  const RawClient client(socket_.path());
  client.send("GET /events HTTP/1.0\r\n\r\n");
  const std::string all = client.read_until("\"n\":1}\n\n");
  EXPECT_THAT(header_of(all), AllOf(Not(HasSubstr("chunked")), HasSubstr("Connection: close")));
  EXPECT_THAT(body_of(all), StartsWith("id: "));
}

TEST_F(HttpConformance, ChunksOfAStreamAreWellFormed) {
  start();
  publish(R"({"n":1})");
  const RawClient client(socket_.path());
  client.send(get_events);
  const std::string all = client.read_until("\n\n\r\n");
  EXPECT_THAT(header_of(all), HasSubstr("Transfer-Encoding: chunked"));
  const std::string body = body_of(all);
  const std::size_t size = std::stoul(body, nullptr, 16);
  EXPECT_EQ(body.size(), body.find("\r\n") + 2 + size + 2) << body;
}

TEST_F(HttpConformance, SendsContinueAtOnceToAClientThatWaitsForIt) {
  start();
  const RawClient client(socket_.path());
  client.send("POST /hello HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\nExpect: 100-continue\r\n\r\n");
  EXPECT_EQ(client.read_until("\r\n\r\n"), "HTTP/1.1 100 Continue\r\n\r\n");
  client.send("body");
  EXPECT_THAT(client.read_until("body"), StartsWith("HTTP/1.1 200 OK"));
  client.send(get_last);
  EXPECT_THAT(client.read_all(), Not(HasSubstr("100 Continue")));
}

TEST_F(HttpConformance, RefusesABodyThatIsTooLargeWithoutContinue) {
  ServerOptions options;
  options.limits.max_body = 3;
  start(options);
  EXPECT_THAT(exchange("POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\nExpect: 100-continue\r\n\r\n"),
              StartsWith("HTTP/1.1 413 "));
}

TEST_F(HttpConformance, ARefusedRequestClosesItsConnectionAndDisturbsNobody) {
  start();
  for (const std::string& request :
       {std::string("GARBAGE\r\n\r\n"), std::string("GET / HTTP/1.1\r\n\r\n"), std::string("GET /\n"),
        std::string("POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n"),
        std::string("GET / HTTP/1.1\r\nHost: x\r\nA: ") + '\0' + "\r\n\r\n"}) {
    const std::string answer = exchange(request + get_hello);
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 400 Bad Request\r\n")) << request;
    EXPECT_THAT(answer, HasSubstr("Connection: close")) << request;
    EXPECT_THAT(answer, HasSubstr("\"error\":")) << request;
    EXPECT_THAT(answer, Not(HasSubstr("hello from"))) << "what follows is not understood: " << request;
  }
  expect_alive();
}

TEST_F(HttpConformance, EachRefusalHasItsStatus) {
  start();
  const std::string host = " HTTP/1.1\r\nHost: x\r\n";
  EXPECT_THAT(exchange("BREW /" + host + "\r\n"), StartsWith("HTTP/1.1 501 Not Implemented"));
  EXPECT_THAT(exchange("GET / HTTP/3.0\r\n\r\n"), StartsWith("HTTP/1.1 505 HTTP Version Not Supported"));
  EXPECT_THAT(exchange("GET /" + std::string(3000, 'a') + host + "\r\n"), StartsWith("HTTP/1.1 414 "));
  EXPECT_THAT(exchange("GET /" + host + "A: " + std::string(20'000, 'a') + "\r\n\r\n"),
              StartsWith("HTTP/1.1 431 "));
  EXPECT_THAT(exchange("POST /" + host + "Content-Length: 70000\r\n\r\n"), StartsWith("HTTP/1.1 413 "));
  EXPECT_THAT(exchange("POST /" + host + "Content-Length: 1\r\nExpect: x\r\n\r\n"),
              StartsWith("HTTP/1.1 417 "));
}

TEST_F(HttpConformance, ABodyThatIsTooLargeIsRefusedWhileItIsStillBeingSent) {
  start();
  const RawClient client(socket_.path());
  client.send("POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 70000\r\n\r\n" + std::string(70'000, 'x'));
  EXPECT_THAT(client.read_all(), StartsWith("HTTP/1.1 413 ")) << "the answer is not cut off by a reset";
}

TEST_F(HttpConformance, ARequestThatDoesNotArriveInTimeGets408) {
  ServerOptions options;
  options.request_timeout = milliseconds(50);
  start(options);
  for (const char* part :
       {"GET / HTTP/1.1\r\nHost:", "POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\n\r\nabc"}) {
    const std::string answer = exchange(part);  // returns because the server closes
    EXPECT_THAT(answer, AllOf(StartsWith("HTTP/1.1 408 Request Timeout"), HasSubstr("within 50 ms"))) << part;
  }
  expect_alive();
}

TEST_F(HttpConformance, TheTimeForARequestIsForAllOfIt) {
  ServerOptions options;
  options.request_timeout = milliseconds(50);
  start(options);
  const RawClient client(socket_.path());
  // A byte every few milliseconds would keep a deadline for each read from ever passing.
  std::atomic<bool> answered{false};
  std::thread trickle([&] {
    client.send("GET / HTTP/1.1\r\nA: ");
    while (!answered) {
      client.send("a");
      std::this_thread::sleep_for(milliseconds(5));
    }
  });
  const std::string answer = client.read_until("\r\n");
  answered = true;
  trickle.join();
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 408 "));
}

TEST_F(HttpConformance, TheTimeForARequestBeginsWithItsFirstByte) {
  ServerOptions options;
  options.request_timeout = milliseconds(400);
  start(options);
  std::string answer;
  std::chrono::steady_clock::time_point first_byte;
  // On a machine that is held up for so long that the idle connection is closed: another one.
  for (int tries = 0; answer.empty() && tries < 50; ++tries) {
    const RawClient client(socket_.path());
    std::this_thread::sleep_for(options.request_timeout / 2);
    first_byte = std::chrono::steady_clock::now();
    client.send("GET / HTTP/1.1\r\n");
    answer = client.read_all();
  }
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 408 "));
  // The server cannot have begun before the byte was sent; how much later it was, no test says.
  EXPECT_GE(std::chrono::steady_clock::now() - first_byte, options.request_timeout);
}

TEST_F(HttpConformance, AConnectionOnWhichNothingComesIsClosedWithoutAWord) {
  ServerOptions options;
  options.request_timeout = milliseconds(50);
  start(options);
  EXPECT_EQ(exchange(""), "");
  const std::string after_one = exchange(get_hello);
  EXPECT_THAT(after_one, AllOf(StartsWith("HTTP/1.1 200 "), EndsWith("hello from /hello ")));
}

TEST_F(HttpConformance, AnswersAClientThatHasFinishedSending) {
  start();
  const RawClient whole(socket_.path());
  whole.send(get_hello);
  whole.finish_sending();
  EXPECT_THAT(whole.read_all(), HasSubstr("hello from /hello"));
  const RawClient half(socket_.path());
  half.send("POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\n\r\nabc");
  half.finish_sending();
  EXPECT_THAT(half.read_all(), AllOf(StartsWith("HTTP/1.1 400 "), HasSubstr("ended before it was complete")));
}

TEST_F(HttpConformance, FramesAnEventAsServerSentEventsAreFramed) {
  start();
  publish(R"({"n":1})");
  publish(R"({"n":2})");
  const RawClient client(socket_.path());
  client.send("GET /events HTTP/1.0\r\n\r\n");
  const std::string body = body_of(client.read_until("\"n\":2}\n\n"));
  const std::string run = log_->run();
  EXPECT_EQ(body, "id: " + run + "-1\nevent: result\ndata: {\"n\":1}\n\nid: " + run +
                      "-2\nevent: result\ndata: {\"n\":2}\n\n");
}

}  // namespace
}  // namespace eigenpose
