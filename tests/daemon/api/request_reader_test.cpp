/// The rules of RFC 9112 for reading requests, without a socket.

#include "daemon/api/request_reader.h"

#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eigenpose {
namespace {

using testing::HasSubstr;
using State = RequestReader::State;

/// The status that `bytes` are refused with; 0 when they are not.
int refused(const std::string& bytes, const RequestLimits& limits = {}) {
  RequestReader reader(limits);
  return reader.feed(bytes) == State::refused ? reader.refusal().status : 0;
}

RequestReader::Taken taken(const std::string& bytes) {
  RequestReader reader({});
  EXPECT_EQ(reader.feed(bytes), State::complete) << bytes;
  return reader.state() == State::complete ? reader.take() : RequestReader::Taken{};
}

std::string get(const std::string& fields, const std::string& line = "GET /v1/status HTTP/1.1") {
  return line + "\r\n" + fields + "\r\n";
}

std::string post(const std::string& fields, const std::string& body) {
  return "POST /v1/learn HTTP/1.1\r\nHost: x\r\n" + fields + "\r\n" + body;
}

TEST(RequestReader, ReadsARequestOfOneByteAtATime) {
  const std::string bytes =
      "POST /v1/learn?a=1 HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nLast-Event-ID: 7\r\n"
      "Content-Length: 2\r\n\r\n{}";
  RequestReader reader({});
  for (std::size_t i = 0; i + 1 < bytes.size(); ++i)
    ASSERT_EQ(reader.feed(bytes.substr(i, 1)), State::needs_more) << i;
  ASSERT_EQ(reader.feed("}"), State::complete);
  const auto [request, framing] = reader.take();
  EXPECT_EQ(request.method, "POST");
  EXPECT_EQ(request.path, "/v1/learn");
  EXPECT_EQ(request.query.at("a"), "1");
  EXPECT_EQ(request.content_type, "application/json");
  EXPECT_EQ(request.last_event_id, "7");
  EXPECT_EQ(request.body, "{}");
  EXPECT_TRUE(framing.keep_alive);
  EXPECT_FALSE(framing.http_1_0);
  EXPECT_FALSE(framing.head_only);
  EXPECT_FALSE(reader.has_begun());
}

TEST(RequestReader, GivesPipelinedRequestsOneAfterTheOther) {
  RequestReader reader({});
  reader.feed(post("Content-Length: 3\r\n", "abc") + "\r\n" + get("Host: x\r\n", "GET /two HTTP/1.1") +
              "GET /three HTTP");
  ASSERT_EQ(reader.state(), State::complete);
  EXPECT_EQ(reader.take().request.body, "abc");
  ASSERT_EQ(reader.state(), State::complete);
  EXPECT_EQ(reader.take().request.path, "/two") << "an empty line before a request is skipped";
  EXPECT_EQ(reader.state(), State::needs_more);
  EXPECT_TRUE(reader.has_begun());
}

TEST(RequestReader, HeadIsGetWithoutABody) {
  const auto [request, framing] = taken(get("Host: x\r\n", "HEAD /v1/status HTTP/1.1"));
  EXPECT_EQ(request.method, "GET");
  EXPECT_TRUE(framing.head_only);
}

TEST(RequestReader, KnowsWhenAConnectionIsKept) {
  EXPECT_FALSE(taken(get("Host: x\r\nConnection: close\r\n")).framing.keep_alive);
  EXPECT_FALSE(taken(get("Host: x\r\nConnection: Upgrade, Close\r\n")).framing.keep_alive);
  EXPECT_TRUE(taken(get("Host: x\r\nConnection: Upgrade\r\n")).framing.keep_alive);
  const auto old = taken(get("", "GET / HTTP/1.0"));
  EXPECT_FALSE(old.framing.keep_alive);
  EXPECT_TRUE(old.framing.http_1_0);
  EXPECT_TRUE(taken(get("Connection: keep-alive\r\n", "GET / HTTP/1.0")).framing.keep_alive);
}

TEST(RequestReader, ServesALaterMinorVersionAs11AndRefusesAnotherMajorOne) {
  EXPECT_FALSE(taken(get("Host: x\r\n", "GET / HTTP/1.7")).framing.http_1_0);
  EXPECT_EQ(refused(get("Host: x\r\n", "GET / HTTP/2.0")), 505);
  EXPECT_EQ(refused(get("Host: x\r\n", "GET / HTTP/0.9")), 505);
}

TEST(RequestReader, RefusesARequestLineThatIsNone) {
  for (const char* line :
       {"GARBAGE", "GET", "GET /", "GET  / HTTP/1.1", "GET / HTTP/1.1 ", " GET / HTTP/1.1", "GET / HTTP/1",
        "GET / http/1.1", "GET / HTTP/11.1", "GET / HTTP/1.1.", "GET\t/\tHTTP/1.1", "G\x01T / HTTP/1.1",
        "G(T / HTTP/1.1", "GET /a b HTTP/1.1", "GET / HTCPCP/1.0", "\x16\x03\x01\x02"})
    EXPECT_EQ(refused(get("Host: x\r\n", line)), 400) << line;
}

TEST(RequestReader, RefusesAMethodThatIsNotKnownWith501) {
  for (const char* method : {"get", "Get", "BREW", "CONNECT", "M-SEARCH"})
    EXPECT_EQ(refused(get("Host: x\r\n", std::string(method) + " /v1/status HTTP/1.1")), 501) << method;
  for (const char* method : {"GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "TRACE", "PATCH"})
    EXPECT_EQ(refused(get("Host: x\r\n", std::string(method) + " /v1/status HTTP/1.1")), 0) << method;
}

TEST(RequestReader, WantsOneGoodHost) {
  EXPECT_EQ(refused(get("")), 400);
  EXPECT_EQ(refused(get("Host: x\r\nHost: x\r\n")), 400);
  EXPECT_EQ(refused(get("Host: x/y\r\n")), 400);
  EXPECT_EQ(refused(get("Host: x y\r\n")), 400);
  EXPECT_EQ(refused(get("Host: a, b\r\n")), 400);
  EXPECT_EQ(refused(get("Host:\r\n")), 0) << "an empty one stands for no authority";
  EXPECT_EQ(refused(get("host: [::1]:80\r\n")), 0);
  EXPECT_EQ(refused(get("", "GET / HTTP/1.0")), 0) << "HTTP/1.0 knows none";
  EXPECT_EQ(refused(get("Host: x\r\nHost: y\r\n", "GET / HTTP/1.0")), 400);
}

TEST(RequestReader, RefusesLinesThatDoNotEndInCrLf) {
  EXPECT_EQ(refused("GET / HTTP/1.1\nHost: x\n\n"), 400);
  EXPECT_EQ(refused("GET / HTTP/1.1\r\nHost: x\n"), 400) << "at once, not when the time is over";
  EXPECT_EQ(refused("GET / HTTP/1.1\r\nHost: x\r\rA: b\r\n\r\n"), 400);
  EXPECT_EQ(refused("GET / HTTP/1.1\r\nHost: x\ry\r\n\r\n"), 400);
  EXPECT_EQ(refused("\n"), 400);
}

TEST(RequestReader, RefusesFoldedLines) {
  EXPECT_EQ(refused(get("Host: x\r\nA: b\r\n c\r\n")), 400);
  EXPECT_EQ(refused(get("Host: x\r\nA: b\r\n\tc\r\n")), 400);
  EXPECT_EQ(refused(get(" Host: x\r\n")), 400) << "before the first field";
}

TEST(RequestReader, RefusesFieldsThatAreNone) {
  for (const char* field : {"A b: c", "A : b", "A\t: b", ": b", "Ab", "A(: b", "\xc3\xa4: b"})
    EXPECT_EQ(refused(get("Host: x\r\n" + std::string(field) + "\r\n")), 400) << field;
  EXPECT_EQ(refused(get(std::string("Host: x\r\nA: b") + '\0' + "c\r\n")), 400) << "NUL";
  EXPECT_EQ(refused(get("Host: x\r\nA: b\x01\r\n")), 400);
  EXPECT_EQ(refused(get("Host: x\r\nA: b\x7f\r\n")), 400);
  EXPECT_EQ(refused(get("Host: x\r\nA:\tb\tc \r\nB:\r\nC: \xc3\xa4\r\n")), 0) << "tabs, nothing, and UTF-8";
}

TEST(RequestReader, WantsTheLengthOnceAsANumber) {
  for (const char* length : {"minus", "-1", "+1", "0x1", "1 1", "1,1", "", "1.0", "1e1"})
    EXPECT_EQ(refused(post("Content-Length: " + std::string(length) + "\r\n", "x")), 400) << length;
  EXPECT_EQ(refused(post("Content-Length: 1\r\nContent-Length: 1\r\n", "x")), 400);
  EXPECT_EQ(refused(post("Content-Length: 1\r\nContent-Length: 2\r\n", "xy")), 400);
  EXPECT_EQ(refused(post("Content-Length: 9999999999999999999\r\n", "x")), 413);
  EXPECT_EQ(refused(post("Content-Length: 99999999999999999999999999\r\n", "x")), 400)
      << "no number of 64 bits";
  EXPECT_EQ(taken(post("Content-Length: 0\r\n", "")).request.body, "");
}

TEST(RequestReader, RefusesALengthBesideATransferCoding) {
  const std::string chunk = "1\r\nx\r\n0\r\n\r\n";
  EXPECT_EQ(refused(post("Content-Length: 1\r\nTransfer-Encoding: chunked\r\n", chunk)), 400);
  EXPECT_EQ(refused(post("Transfer-Encoding: chunked\r\nContent-Length: 1\r\n", chunk)), 400);
  EXPECT_EQ(refused("POST / HTTP/1.0\r\nTransfer-Encoding: chunked\r\n\r\n" + chunk), 400);
}

TEST(RequestReader, KnowsNoOtherTransferCodingThanChunked) {
  const std::string chunk = "1\r\nx\r\n0\r\n\r\n";
  EXPECT_EQ(taken(post("Transfer-Encoding: CHUNKED\r\n", chunk)).request.body, "x");
  EXPECT_EQ(refused(post("Transfer-Encoding: gzip, chunked\r\n", chunk)), 501);
  EXPECT_EQ(refused(post("Transfer-Encoding: gzip\r\nTransfer-Encoding: chunked\r\n", chunk)), 501);
  for (const char* coding : {"gzip", "chunked, gzip", "chunked, chunked", "", "xchunked"})
    EXPECT_EQ(refused(post("Transfer-Encoding: " + std::string(coding) + "\r\n", chunk)), 400) << coding;
}

TEST(RequestReader, ReadsChunksWithExtensionsAndTrailers) {
  const std::string body =
      "4;name=\"a;b\"\r\nabcd\r\n00a\r\n0123456789\r\n0\r\nHost: y\r\nLast-Event-ID: 9\r\n\r\n";
  const auto [request, framing] = taken(post("Transfer-Encoding: chunked\r\n", body));
  EXPECT_EQ(request.body, "abcd0123456789");
  EXPECT_EQ(request.last_event_id, "") << "a trailer is no header";
  EXPECT_TRUE(framing.keep_alive);
}

TEST(RequestReader, RefusesChunksThatAreNone) {
  for (const char* chunk : {"zz\r\n", "-1\r\n", "1\r\nxy\r\n0\r\n\r\n", "1\nx\n0\n\n", "\r\nx",
                            "ffffffffffffffffff\r\n", "0x1\r\nx\r\n"})
    EXPECT_EQ(refused(post("Transfer-Encoding: chunked\r\n", chunk)), 400) << chunk;
}

TEST(RequestReader, HoldsItsLimits) {
  const RequestLimits limits{1000, 100};
  EXPECT_EQ(refused(post("Content-Length: 101\r\n", ""), limits), 413) << "before a byte of it has come";
  EXPECT_EQ(refused(post("Content-Length: 100\r\n", std::string(100, 'x')), limits), 0);
  EXPECT_EQ(
      refused(post("Transfer-Encoding: chunked\r\n", "64\r\n" + std::string(100, 'x') + "\r\n"), limits), 0);
  EXPECT_EQ(
      refused(post("Transfer-Encoding: chunked\r\n", "65\r\n" + std::string(101, 'x') + "\r\n"), limits),
      413);
  EXPECT_EQ(refused(get("Host: x\r\nA: " + std::string(2000, 'a') + "\r\n"), limits), 431);
  EXPECT_EQ(refused("GET / HTTP/1.1\r\nHost: x\r\nA: " + std::string(2000, 'a'), limits), 431)
      << "unfinished";
  EXPECT_EQ(refused(std::string(2000, 'a'), limits), 431);
  EXPECT_EQ(refused("GET /" + std::string(2000, 'a'), limits), 414);
  EXPECT_EQ(refused(get("Host: x\r\n", "GET /" + std::string(3000, 'a') + " HTTP/1.1")), 414);
  const std::string fitting = get("Host: x\r\nA: " + std::string(1000 - 41, 'a') + "\r\n");
  ASSERT_EQ(fitting.size(), 1000U);
  EXPECT_EQ(refused(fitting, limits), 0);
  EXPECT_EQ(refused(fitting.substr(0, 30) + "a" + fitting.substr(30), limits), 431);
}

TEST(RequestReader, ChunksWithoutDataComeToAnEnd) {
  const RequestLimits limits{1000, 100};
  EXPECT_EQ(refused(post("Transfer-Encoding: chunked\r\n", "1;" + std::string(2000, 'a')), limits), 400);
  std::string many;
  for (int i = 0; i < 90; ++i) many += "1;" + std::string(40, 'e') + "\r\nx\r\n";
  EXPECT_EQ(refused(post("Transfer-Encoding: chunked\r\n", many), limits), 413);
}

TEST(RequestReader, WaitsWithTheBodyOnlyWhereTheClientDoes) {
  RequestReader reader({});
  const std::string head = post("Content-Length: 2\r\nExpect: 100-Continue\r\n", "");
  EXPECT_EQ(reader.feed(head), State::needs_continue);
  EXPECT_EQ(reader.go_on(), State::needs_more);
  EXPECT_EQ(reader.feed("{}"), State::complete);
  EXPECT_EQ(taken(head + "{}").request.body, "{}") << "the client has not waited";
  EXPECT_EQ(taken(get("Host: x\r\nExpect: 100-continue\r\n")).request.method, "GET") << "there is no body";
  RequestReader old({});
  EXPECT_EQ(old.feed("POST / HTTP/1.0\r\nContent-Length: 2\r\nExpect: 100-continue\r\n\r\n"),
            State::needs_more);
}

TEST(RequestReader, RefusesExpectationsItDoesNotKnow) {
  EXPECT_EQ(refused(post("Content-Length: 2\r\nExpect: a-miracle\r\n", "{}")), 417);
  EXPECT_EQ(refused(post("Content-Length: 2\r\nExpect: 100-continue, more\r\n", "{}")), 417);
}

TEST(RequestReader, RefusesACodedBody) {
  EXPECT_EQ(refused(post("Content-Length: 2\r\nContent-Encoding: gzip\r\n", "{}")), 415);
  EXPECT_EQ(refused(post("Content-Length: 2\r\nContent-Encoding: identity\r\n", "{}")), 0);
}

TEST(RequestReader, SaysWhatIsWrong) {
  RequestReader reader({});
  reader.feed("GET / HTTP/1.1\r\n\r\n");
  EXPECT_THAT(reader.refusal().error, HasSubstr("Host"));
  EXPECT_FALSE(reader.refusal().hint.empty());
}

TEST(RequestReader, SurvivesRandomBytesAndDecidesTheSameHoweverTheyAreSplit) {
  const std::vector<std::string> seeds = {post("Transfer-Encoding: chunked\r\n", "4\r\nabcd\r\n0\r\n\r\n"),
                                          post("Content-Length: 5\r\n", "abcde"),
                                          get("Host: x\r\nConnection: close\r\n"),
                                          get("Host: x\r\nExpect: 100-continue\r\n")};
  std::mt19937 random(1);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  for (int round = 0; round < 3000; ++round) {
    std::string bytes = seeds[below(seeds.size())];
    for (std::size_t i = below(4); i > 0; --i) {
      const std::size_t at = below(bytes.size());
      const char letter = " \r\n\t:;0a\x7f\xff"[below(10)];
      switch (below(3)) {
        case 0:
          bytes[at] = letter;
          break;
        case 1:
          bytes.erase(at, 1);
          break;
        default:
          bytes.insert(at, 1, letter);
      }
    }
    const auto outcome = [&](bool split) {
      RequestReader reader({});
      if (!split) reader.feed(bytes);
      for (std::size_t i = 0; split && i < bytes.size(); ++i) {
        reader.feed(bytes.substr(i, 1));
        reader.go_on();
      }
      reader.go_on();
      const int status = reader.state() == State::refused ? reader.refusal().status : 0;
      return std::pair(reader.state(), status);
    };
    EXPECT_EQ(outcome(false), outcome(true)) << bytes;
  }
}

}  // namespace
}  // namespace eigenpose
