#include "daemon/api/target.h"

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(Target, SplitsPathAndQueryAndDecodesBoth) {
  std::string path;
  std::map<std::string, std::string> query;
  ASSERT_TRUE(split_target("/v1/jobs/a%20b?after=7&name=x+y%2B&flag", path, query));
  EXPECT_EQ(path, "/v1/jobs/a b");
  EXPECT_EQ(query.at("after"), "7");
  EXPECT_EQ(query.at("name"), "x y+");
  EXPECT_EQ(query.at("flag"), "");
}

TEST(Target, RefusesWhatIsNoPathOrBadlyEncoded) {
  std::string path;
  std::map<std::string, std::string> query;
  for (const char* target : {"", "*", "http://x/v1", "/%", "/%4", "/%zz", "/%00"})
    EXPECT_FALSE(split_target(target, path, query)) << target;
  EXPECT_FALSE(split_target("/" + std::string(3000, 'a'), path, query));
}

}  // namespace
}  // namespace eigenpose
