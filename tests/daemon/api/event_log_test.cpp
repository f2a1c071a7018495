#include "daemon/api/event_log.h"

#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

std::uint64_t publish(EventLog& log) {
  return log.publish([](std::uint64_t sequence) { return std::to_string(sequence); });
}

TEST(EventLog, NumbersEventsFromOneAndTellsTheNumberToTheirMaker) {
  EventLog log(4);
  EXPECT_EQ(publish(log), 1U);
  EXPECT_EQ(publish(log), 2U);
  EXPECT_EQ(*log.latest()->data, "2");
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

TEST(EventLog, CallsEveryListenerAfterEachEvent) {
  EventLog log(3);
  std::vector<std::uint64_t> first, second;
  const auto one = log.subscribe([&] { first.push_back(log.last_sequence()); });
  const auto two = log.subscribe([&] { second.push_back(log.last_sequence()); });
  publish(log);
  publish(log);
  EXPECT_EQ(first, (std::vector<std::uint64_t>{1, 2}));
  EXPECT_EQ(second, first);
}

TEST(EventLog, AListenerIsNotCalledAfterItsSubscriptionHasEnded) {
  EventLog log(3);
  int calls = 0;
  EventLog::Subscription kept;
  {
    EventLog::Subscription moved = log.subscribe([&] { ++calls; });
    publish(log);
    kept = std::move(moved);
  }
  publish(log);
  EXPECT_EQ(calls, 2) << "a subscription that was moved goes on";
  kept = {};
  publish(log);
  EXPECT_EQ(calls, 2);
  {
    const auto brief = log.subscribe([&] { ++calls; });
  }
  publish(log);
  EXPECT_EQ(calls, 2);
}

}  // namespace
}  // namespace eigenpose
