/// Server-sent events as the client reads them.

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "daemon/api/client/api_client.h"

namespace eigenpose {
namespace {

std::vector<ApiEvent> events_of(const std::string& stream, std::size_t piece) {
  EventParser parser;
  std::vector<ApiEvent> events;
  for (std::size_t at = 0; at < stream.size(); at += piece)
    parser.feed(std::string_view(stream).substr(at, piece), [&](const ApiEvent& event) {
      events.push_back(event);
      return true;
    });
  return events;
}

TEST(EventParser, ReadsEventsHoweverTheStreamIsSplit) {
  const std::string stream =
      ": still here\n\nid: 3f29ab01-7\nevent: result\ndata: {\"n\":1}\n\nevent: lost\ndata: {\"lost\":3}\n\n"
      "id: 8\r\nevent: result\r\ndata: one\r\ndata: two\r\n\r\n";
  for (const std::size_t piece : {1UL, 2UL, 7UL, 1000UL}) {
    const auto events = events_of(stream, piece);
    ASSERT_EQ(events.size(), 3U) << piece;
    EXPECT_EQ(events[0].name, "result");
    EXPECT_EQ(events[0].id, 7U);
    EXPECT_EQ(events[0].run, "3f29ab01");
    EXPECT_EQ(events[0].data, "{\"n\":1}");
    EXPECT_EQ(events[1].name, "lost");
    EXPECT_EQ(events[1].id, 7U) << "of the event before";
    EXPECT_EQ(events[2].id, 8U);
    EXPECT_EQ(events[2].run, "") << "a number alone";
    EXPECT_EQ(events[2].data, "one\ntwo");
  }
}

TEST(EventParser, GivesNoEventThatIsNotCompleteOrHasNoData) {
  EXPECT_TRUE(events_of("id: 1\nevent: result\ndata: x\n", 5).empty());
  EXPECT_TRUE(events_of("id: 1\nevent: result\n\n", 5).empty());
}

TEST(EventParser, AnEventHasNothingOfTheOneBeforeButItsId) {
  const auto events =
      events_of("id: 3f29ab01-7\nevent: result\ndata: one\n\ndata: two\n\nevent: lost\n\ndata:\n\n", 9);
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[1].name, "");
  EXPECT_EQ(events[1].data, "two");
  EXPECT_EQ(events[1].id, 7U);
  EXPECT_EQ(events[2].name, "") << "of an event without data, which is none";
  EXPECT_EQ(events[2].data, "");
}

TEST(EventParser, StopsWhenItsReaderHasEnough) {
  EventParser parser;
  int seen = 0;
  EXPECT_FALSE(parser.feed("data: 1\n\ndata: 2\n\n", [&](const ApiEvent&) { return ++seen < 1; }));
  EXPECT_EQ(seen, 1);
}

}  // namespace
}  // namespace eigenpose
