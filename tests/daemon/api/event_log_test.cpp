#include "daemon/api/event_log.h"

#include <string>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

std::uint64_t publish(EventLog& log) {
  return log.publish("result", [](std::uint64_t sequence) { return std::to_string(sequence); });
}

TEST(EventLog, NumbersEventsFromOneAndTellsTheNumberToTheirMaker) {
  EventLog log(4);
  EXPECT_EQ(publish(log), 1U);
  EXPECT_EQ(publish(log), 2U);
  EXPECT_EQ(*log.latest("result")->data, "2");
}

TEST(EventLog, AReaderThatKeepsUpGetsEveryEventOnce) {
  EventLog log(4);
  std::uint64_t cursor = 0;
  for (int i = 1; i <= 20; ++i) {
    publish(log);
    const auto event = log.after(cursor);
    ASSERT_TRUE(event);
    EXPECT_EQ(*event->data, std::to_string(i));
    EXPECT_EQ(event->lost, 0U);
    cursor = event->sequence;
    EXPECT_FALSE(log.after(cursor));
  }
}

TEST(EventLog, ASlowReaderLosesTheOldestAndIsToldHowMany) {
  EventLog log(3);
  for (int i = 0; i < 10; ++i) publish(log);
  const auto event = log.after(2);
  ASSERT_TRUE(event);
  EXPECT_EQ(event->sequence, 8U);  // 8, 9 and 10 are kept
  EXPECT_EQ(event->lost, 5U);      // 3, 4, 5, 6 and 7 are not
  EXPECT_EQ(log.after(8)->lost, 0U);
}

TEST(EventLog, ANumberFromAFormerRunBeginsAnew) {
  EventLog log(3);
  publish(log);
  ASSERT_TRUE(log.after(1000));
  EXPECT_EQ(log.after(1000)->sequence, 1U);
}

TEST(EventLog, CallsEachListenerAfterEachEventWhileItIsSubscribed) {
  EventLog log(3);
  int first = 0;
  int second = 0;
  auto kept = log.subscribe([&] { first += log.last_sequence() > 0 ? 1 : 0; });
  {
    const auto passing = log.subscribe([&] { ++second; });
    publish(log);
  }
  publish(log);
  EXPECT_EQ(first, 2);
  EXPECT_EQ(second, 1);
  auto moved = std::move(kept);
  publish(log);
  EXPECT_EQ(first, 3) << "moving a subscription keeps it";
  moved = {};
  publish(log);
  EXPECT_EQ(first, 3);
}

TEST(EventLog, KeepsTheLatestOfEachNameAlsoWhenManyOthersFollow) {
  EventLog log(2);
  publish(log);
  for (int i = 0; i < 5; ++i) log.publish("other", [](std::uint64_t) { return "x"; });
  ASSERT_TRUE(log.latest("result"));
  EXPECT_EQ(log.latest("result")->sequence, 1U);
  EXPECT_EQ(log.latest("result")->name, "result");
  EXPECT_EQ(log.latest("other")->sequence, 6U);
  EXPECT_FALSE(log.latest("third"));
  EXPECT_EQ(log.after(5)->name, "other");
}

TEST(EventLog, EachRunHasANameOfItsOwn) {
  const EventLog one(1);
  const EventLog other(1);
  EXPECT_EQ(one.run().size(), 8U);
  EXPECT_NE(one.run(), other.run());
}

}  // namespace
}  // namespace eigenpose
