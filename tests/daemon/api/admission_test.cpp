#include "daemon/api/admission.h"

#include <vector>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

constexpr uid_t anna = 1001;
constexpr uid_t ben = 1002;
using Use = Place::Use;

std::vector<Place> places(uid_t user, Use use, std::size_t count, std::uint64_t first = 1) {
  std::vector<Place> result;
  for (std::size_t i = 0; i < count; ++i) result.push_back({user, use, first + i});
  return result;
}

TEST(Admission, EverybodyIsAdmittedWhileThereIsRoom) {
  const auto taken = places(anna, Use::streaming, 3);
  const Admission admission = admit(taken, 4, anna);
  EXPECT_TRUE(admission.admitted);
  EXPECT_FALSE(admission.evicted);
}

TEST(Admission, AUserWithAllPlacesGivesOneToAnotherUser) {
  const auto taken = places(anna, Use::streaming, 4);
  const Admission admission = admit(taken, 4, ben);
  ASSERT_TRUE(admission.admitted);
  EXPECT_EQ(admission.evicted, 0U) << "the stream that was quiet longest";
}

TEST(Admission, AnIdleConnectionGivesWayBeforeAStream) {
  auto taken = places(anna, Use::streaming, 3);
  taken.push_back({anna, Use::idle, 9});
  taken.push_back({anna, Use::idle, 8});
  EXPECT_EQ(admit(taken, 5, ben).evicted, 4U) << "the longest idle, though streams were quiet longer";
}

TEST(Admission, ABusyConnectionIsNeverDropped) {
  const auto taken = places(anna, Use::busy, 4);
  EXPECT_FALSE(admit(taken, 4, ben).admitted);
  EXPECT_FALSE(admit(taken, 4, anna).admitted);
}

TEST(Admission, EqualSharesAreNotTakenFromEachOther) {
  auto taken = places(anna, Use::streaming, 2);
  const auto others = places(ben, Use::streaming, 2);
  taken.insert(taken.end(), others.begin(), others.end());
  EXPECT_FALSE(admit(taken, 4, anna).admitted);
  EXPECT_FALSE(admit(taken, 4, ben).admitted);
}

TEST(Admission, OneMoreThanAnotherIsAFairShareAndTwoMoreAreNot) {
  auto taken = places(anna, Use::streaming, 3);
  taken.push_back({ben, Use::streaming, 9});
  taken.push_back({ben, Use::streaming, 10});
  EXPECT_FALSE(admit(taken, 5, ben).admitted);
  taken.pop_back();
  EXPECT_EQ(admit(taken, 4, ben).evicted, 0U);
}

TEST(Admission, AFullUserGivesUpItsOwnIdleConnectionButNoStream) {
  auto taken = places(anna, Use::streaming, 3);
  EXPECT_FALSE(admit(taken, 3, anna).admitted);
  taken.push_back({anna, Use::idle, 9});
  EXPECT_EQ(admit(taken, 4, anna).evicted, 3U);
}

TEST(Admission, AnIdleConnectionOfAnotherUserIsKeptWhenItsShareIsSmaller) {
  auto taken = places(anna, Use::streaming, 3);
  taken.push_back({ben, Use::idle, 0});
  EXPECT_FALSE(admit(taken, 4, anna).admitted);
}

}  // namespace
}  // namespace eigenpose
