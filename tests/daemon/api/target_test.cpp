#include "daemon/api/target.h"

#include <string>
#include <string_view>
#include <variant>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

Target accepted_target(std::string_view text, std::string_view method = "GET") {
  const auto result = parse_target(text, method);
  if (const auto* target = std::get_if<Target>(&result)) return *target;
  ADD_FAILURE() << text << " is refused: " << std::get<Refusal>(result).error;
  return {};
}

int refused_target(std::string_view text, std::string_view method = "GET") {
  const auto result = parse_target(text, method);
  if (const auto* refusal = std::get_if<Refusal>(&result)) return refusal->status;
  ADD_FAILURE() << text << " is accepted";
  return 0;
}

TEST(Target, SplitsPathAndQueryAndDecodesBoth) {
  const Target target = accepted_target("/v1/jobs/a%20b?after=7&name=x+y%2B&flag");
  EXPECT_EQ(target.path, "/v1/jobs/a b");
  EXPECT_EQ(target.query.at("after"), "7");
  EXPECT_EQ(target.query.at("name"), "x y+");
  EXPECT_EQ(target.query.at("flag"), "");
}

TEST(Target, ReadsTheAbsoluteForm) {
  EXPECT_EQ(accepted_target("http://localhost/v1/status").path, "/v1/status");
  EXPECT_EQ(accepted_target("HTTP://[::1]:80/v1/status?a=1").query.at("a"), "1");
  EXPECT_EQ(accepted_target("http://localhost").path, "/");
  EXPECT_EQ(accepted_target("http://localhost?a=1").query.at("a"), "1");
  EXPECT_EQ(refused_target("http://"), 400);
  EXPECT_EQ(refused_target("http:///v1/status"), 400);
  EXPECT_EQ(refused_target("http://a@b/v1"), 400) << "user information is no part of a request";
  EXPECT_EQ(refused_target("ftp://localhost/v1"), 400);
}

TEST(Target, ReadsTheAsteriskOfOptionsOnly) {
  EXPECT_EQ(accepted_target("*", "OPTIONS").path, "*");
  EXPECT_EQ(refused_target("*", "GET"), 400);
  EXPECT_EQ(refused_target("**", "OPTIONS"), 400);
}

TEST(Target, ResolvesDotSegmentsAlsoWhenTheyAreEncoded) {
  EXPECT_EQ(accepted_target("/v1/./status").path, "/v1/status");
  EXPECT_EQ(accepted_target("/v1/x/../status").path, "/v1/status");
  EXPECT_EQ(accepted_target("/v1/x/%2e%2E/status").path, "/v1/status");
  EXPECT_EQ(accepted_target("/../../v1/status").path, "/v1/status") << "never above the root";
  EXPECT_EQ(accepted_target("/v1/status/.").path, "/v1/status/");
  EXPECT_EQ(accepted_target("/v1/..").path, "/");
  EXPECT_EQ(accepted_target("/v1/..status").path, "/v1/..status");
}

TEST(Target, ReadsNothingBehindItsEnd) {
  // The parser hands out a piece of what has been received: behind it stands something else.
  const std::string received = "/v1/%41%42?a=%43&%44=1";
  for (std::size_t size = 0; size <= received.size(); ++size) {
    const auto piece = parse_target(std::string_view(received).substr(0, size), "GET");
    const auto alone = parse_target(received.substr(0, size), "GET");
    ASSERT_EQ(piece.index(), alone.index()) << received.substr(0, size);
    if (const auto* target = std::get_if<Target>(&piece)) {
      EXPECT_EQ(target->path, std::get<Target>(alone).path);
      EXPECT_EQ(target->query, std::get<Target>(alone).query);
    }
  }
  EXPECT_EQ(refused_target(std::string_view("/%41").substr(0, 3)), 400);
  EXPECT_EQ(refused_target(std::string_view("/?a=%41").substr(0, 6)), 400);
}

TEST(Target, KeepsEmptySegmentsAndEncodedSlashes) {
  EXPECT_EQ(accepted_target("//v1/status").path, "//v1/status");
  EXPECT_EQ(accepted_target("/v1/status/").path, "/v1/status/");
  EXPECT_EQ(accepted_target("/v1%2fstatus").path, "/v1%2Fstatus") << "no separator";
}

TEST(Target, RefusesWhatIsNoPathOrBadlyEncoded) {
  for (const char* target : {"", "v1/status", "/%", "/%4", "/%zz", "/%00", "/?a=%", "/?%00=1", "/v1#part",
                             "/v1/\"", "/v1/\xc3\xa4", "/v1/{id}", "/v1\\status"})
    EXPECT_EQ(refused_target(target), 400) << target;
  EXPECT_EQ(accepted_target("/v1/%C3%A4").path, "/v1/\xc3\xa4");
}

TEST(Target, RefusesAKeyThatStandsTwiceInTheQuery) {
  EXPECT_EQ(refused_target("/v1/results?after=1&after=2"), 400);
  EXPECT_EQ(refused_target("/v1/results?after=1&%61fter=1"), 400);
  EXPECT_TRUE(accepted_target("/v1/results?&").query.empty());
}

TEST(Target, RefusesMoreThanTwoThousandBytesAsTooLong) {
  EXPECT_EQ(accepted_target("/" + std::string(1999, 'a')).path.size(), 2000U);
  EXPECT_EQ(refused_target("/" + std::string(2000, 'a')), 414);
}

TEST(Target, TellsAHostFromWhatIsNone) {
  for (const char* host : {"", "localhost", "localhost:80", "[::1]", "[::1]:8080", "a.b-c_d", "10.0.0.1:"})
    EXPECT_TRUE(is_authority(host)) << host;
  for (const char* host : {"a b", "a/b", "a@b", "a:b", "a:80:80", "a?b", "a#b", "[::1", "[]", "::1", "a\\b"})
    EXPECT_FALSE(is_authority(host)) << host;
}

}  // namespace
}  // namespace eigenpose
