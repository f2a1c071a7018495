#include "daemon/api/descriptor_budget.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

TEST(DescriptorBudget, GivesEachSocketWhatIsWantedWhereThereIsEnough) {
  const DescriptorBudget budget = share_descriptors(1024, 64);
  EXPECT_EQ(budget.commanders, 64);
  EXPECT_EQ(budget.readers, 64);
}

TEST(DescriptorBudget, NeverHandsOutWhatDevicesAndFilesNeed) {
  for (int limit = 48; limit < 300; ++limit)
    for (const int wanted : {1, 4, 64, 1000}) {
      const DescriptorBudget budget = share_descriptors(limit, wanted);
      EXPECT_LE(budget.commanders + budget.readers, limit - 40) << limit << " " << wanted;
      EXPECT_GE(budget.commanders, std::min(wanted, 4)) << limit << " " << wanted;
      EXPECT_GE(budget.readers, std::min(wanted, 4)) << limit << " " << wanted;
    }
}

TEST(DescriptorBudget, RefusesALimitThatLeavesNothingForClients) {
  EXPECT_NO_THROW(share_descriptors(48, 64));
  try {
    share_descriptors(47, 64);
    FAIL() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("may open 47 files, and needs 48"),
                                             testing::HasSubstr("LimitNOFILE")));
  }
}

TEST(DescriptorBudget, RaisesTheSoftLimitUpToTheHardOne) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit low = before;
  low.rlim_cur = 100;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &low), 0);
  const auto expected = std::min<rlim_t>(before.rlim_max, 4096);
  EXPECT_EQ(raise_descriptor_limit(), static_cast<int>(expected));
  rlimit now{};
  ::getrlimit(RLIMIT_NOFILE, &now);
  EXPECT_EQ(now.rlim_cur, expected);
  ::setrlimit(RLIMIT_NOFILE, &before);
}

}  // namespace
}  // namespace eigenpose
