// Answers on a serial line, with and without an adapter that echoes, byte by byte.

#include "drivers/modbus/rtu_answer.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eigenpose::rtu {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes frame(Bytes bytes) {
  return with_checksum(bytes);
}

const Bytes read_two = frame({1, 0x03, 0x00, 0xCC, 0x00, 0x02});
const Bytes two_registers = frame({1, 0x03, 4, 0x12, 0x34, 0x56, 0x78});
const Bytes write_one = frame({1, 0x06, 0x00, 0x7D, 0x00, 0x20});
const Bytes write_many = frame({1, 0x10, 0x00, 0x58, 0x00, 0x02, 4, 0, 1, 0, 2});
const Bytes many_written = frame({1, 0x10, 0x00, 0x58, 0x00, 0x02});
const Bytes refusal = frame({1, 0x83, 0x02});

/// Gives the answer what it asks for, and never more, out of `line`. @return what is left of the line.
std::size_t feed_all(Answer& answer, const Bytes& line) {
  std::size_t at = 0;
  while (answer.missing() > 0 && at < line.size()) {
    const std::size_t count = std::min(answer.missing(), line.size() - at);
    answer.feed(std::span(line).subspan(at, count));
    at += count;
  }
  return line.size() - at;
}

Bytes joined(Bytes first, const Bytes& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

TEST(RtuChecksum, IsTheOneOfTheSpecification) {
  // Modbus over Serial Line V1.02, appendix B: 02 07 gives 0x1241, sent 41 12.
  EXPECT_EQ(checksum(Bytes{0x02, 0x07}), 0x1241);
  EXPECT_THAT(frame({0x02, 0x07}), testing::ElementsAre(0x02, 0x07, 0x41, 0x12));
  EXPECT_TRUE(is_sound(read_two));
  Bytes damaged = read_two;
  damaged[3] ^= 1;
  EXPECT_FALSE(is_sound(damaged));
}

TEST(RtuAnswer, EachKindIsReadToItsEndAndNoFurther) {
  for (const auto& [request, answer_bytes] : {std::pair{read_two, two_registers},
                                              {read_two, refusal},
                                              {write_many, many_written},
                                              {write_many, frame({1, 0x90, 0x03})}}) {
    for (const Echo echo : {Echo::none, Echo::unknown}) {
      Answer answer(request, echo);
      EXPECT_EQ(feed_all(answer, joined(answer_bytes, {0xFF, 0xFF})), 2U);
      EXPECT_EQ(answer.missing(), 0U);
      EXPECT_EQ(answer.echo(), Echo::none);
      EXPECT_EQ(Bytes(answer.bytes().begin(), answer.bytes().end()), answer_bytes);
    }
  }
  Answer confirmation(write_one, Echo::none);
  EXPECT_EQ(feed_all(confirmation, write_one), 0U);
  EXPECT_EQ(confirmation.missing(), 0U);
}

TEST(RtuAnswer, AnEchoIsLeftOutWhetherItIsKnownOrNot) {
  for (const auto& [request, answer_bytes] :
       {std::pair{read_two, two_registers}, {read_two, refusal}, {write_many, many_written}}) {
    for (const Echo echo : {Echo::whole, Echo::unknown}) {
      Answer answer(request, echo);
      EXPECT_EQ(feed_all(answer, joined(joined(request, answer_bytes), {0xFF})), 1U);
      EXPECT_EQ(answer.missing(), 0U);
      EXPECT_EQ(answer.echo(), Echo::whole);
      EXPECT_EQ(Bytes(answer.bytes().begin(), answer.bytes().end()), answer_bytes);
    }
  }
  Answer confirmation(write_one, Echo::whole);
  EXPECT_EQ(feed_all(confirmation, write_one), 0U);
  EXPECT_GT(confirmation.missing(), 0U) << "the echo of a write is not its confirmation";
  EXPECT_EQ(feed_all(confirmation, write_one), 0U);
  EXPECT_EQ(confirmation.missing(), 0U);
}

TEST(RtuAnswer, AnAnswerThatBeginsLikeItsRequestIsNoEcho) {
  // The count of bytes equals the high byte of the address: 2.
  const Bytes request = frame({1, 0x03, 0x02, 0x00, 0x00, 0x01});
  const Bytes bytes = frame({1, 0x03, 2, 0x00, 0x00});
  Answer answer(request, Echo::unknown);
  EXPECT_EQ(feed_all(answer, bytes), 0U);
  EXPECT_EQ(answer.missing(), 0U);
  EXPECT_EQ(answer.echo(), Echo::none);
}

TEST(RtuAnswer, BytesComeOneByOneOrAllAtOnce) {
  Answer answer(read_two, Echo::unknown);
  const Bytes line = joined(read_two, two_registers);
  for (const std::uint8_t byte : line) {
    ASSERT_GT(answer.missing(), 0U);
    answer.feed(std::span(&byte, 1));
  }
  EXPECT_EQ(answer.missing(), 0U);
  EXPECT_EQ(answer.bytes().size(), two_registers.size());
}

TEST(RtuAnswer, AKnownEchoThatComesBackOtherwiseIsDamage) {
  Bytes echo = read_two;
  echo[4] ^= 0x10;
  Answer answer(read_two, Echo::whole);
  feed_all(answer, joined(echo, two_registers));
  EXPECT_TRUE(answer.echo_is_damaged());
  EXPECT_EQ(answer.missing(), 0U);
}

}  // namespace
}  // namespace eigenpose::rtu
