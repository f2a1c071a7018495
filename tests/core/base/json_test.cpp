// JSON as RFC 8259 has it, and what we refuse beyond it.

#include "core/base/json.h"

#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace eigenpose {
namespace {

using nlohmann::json;

/// The message of the refusal; empty when the text is accepted.
std::string refusal(std::string_view text, const JsonLimits& limits = {}) {
  try {
    parse_json(text, limits);
  } catch (const JsonError& error) {
    return error.what();
  }
  return {};
}

template <typename Convert>
std::string message_of(Convert convert) {
  try {
    convert();
  } catch (const JsonError& error) {
    return error.what();
  }
  return {};
}

TEST(ParseJson, ReadsEveryKindOfValue) {
  const json value = parse_json(
      "\t{\"a\": [1, -2, 2.5e-1, true, false, null], \"b\": {\"c\": \"\\u00e9\\n\\\"\\ud83d\\ude00\"}}\r\n");
  EXPECT_EQ(value["a"], (json{1, -2, 0.25, true, false, nullptr}));
  EXPECT_EQ(value["b"]["c"], "é\n\"😀");
  EXPECT_EQ(parse_json("7"), 7);
  EXPECT_EQ(parse_json("[]"), json::array());
  EXPECT_EQ(parse_json("{}"), json::object());
  EXPECT_EQ(parse_json("[[], {}, [[]]]").dump(), "[[],{},[[]]]");
}

TEST(ParseJson, RefusesWhatTheGrammarDoesNotHave) {
  for (const char* text : {"",
                           " ",
                           "{",
                           "[1",
                           "[1,]",
                           "{\"a\":1,}",
                           "{a:1}",
                           "{'a':1}",
                           "[1 2]",
                           "01",
                           "+1",
                           ".5",
                           "1.",
                           "1e",
                           "0x10",
                           "NaN",
                           "[nan]",
                           "Infinity",
                           "[-Infinity]",
                           "True",
                           "nul",
                           "\"a",
                           "\"\t\"",
                           "\"\\x41\"",
                           "\"\\u12\"",
                           "// comment\n1",
                           "1 /* two */",
                           "{} {}",
                           "[1]]",
                           "\"\\ud800\"",
                           "\"\\udc00\\ud800\""})
    EXPECT_NE(refusal(text), "") << text;
}

TEST(ParseJson, RefusesBytesThatAreNotUtf8) {
  for (const char* text :
       {"\"\xff\"", "\"\xc3\"", "\"\xc0\xaf\"", "\"\xed\xa0\x80\"", "\"\xf5\x80\x80\x80\"", "{\"\x80\": 1}"})
    EXPECT_NE(refusal(text), "") << text;
  EXPECT_EQ(parse_json("\"\xc3\xa9\""), "é");
}

TEST(ParseJson, SaysLineAndColumnOfAnError) {
  EXPECT_EQ(refusal("{\n  \"a\": x\n}"), "line 2, column 8: this is not JSON");
  EXPECT_EQ(refusal("{\n  \"a\": 1"), "line 2, column 9: the text ends too early");
}

TEST(ParseJson, RefusesNumbersThatNoDoubleHolds) {
  EXPECT_EQ(refusal("[1e999]"), "line 1, column 2: the number 1e999 does not fit a double");
  EXPECT_EQ(refusal("-1e400"), "line 1, column 1: the number -1e400 does not fit a double");
  EXPECT_EQ(parse_json("1.7976931348623157e308").get<double>(), std::numeric_limits<double>::max());
  EXPECT_EQ(parse_json("1e-999").get<double>(), 0.0);
}

TEST(ParseJson, RefusesAKeyThatIsThereTwice) {
  EXPECT_EQ(refusal(R"({"a": 1, "b": 2, "a": 1})"), R"(the key "a" is there twice in one object)");
  EXPECT_NE(refusal(R"({"x": {"a": 1, "\u0061": 2}})"), "") << "written differently, the same key";
  EXPECT_EQ(refusal(R"({"a": {"a": {"a": 1}}, "b": {"a": 1}})"), "");
}

TEST(ParseJson, BoundsTheDepthBeforeTheStackEnds) {
  const auto nested = [](std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); };
  EXPECT_EQ(refusal(nested(32)), "");
  EXPECT_EQ(refusal(nested(33)), "its arrays and objects are nested deeper than 32");
  EXPECT_NE(refusal(nested(1'000'000)), "");
  EXPECT_NE(refusal(std::string(1'000'000, '[')), "");
  std::string objects = "1";
  for (int i = 0; i < 5; ++i) objects = "{\"a\":" + objects + "}";
  EXPECT_EQ(refusal(objects, {.depth = 5}), "");
  EXPECT_NE(refusal(objects, {.depth = 4}), "");
  EXPECT_EQ(refusal("[[],[],[],[[]]]", {.depth = 3}), "") << "side by side is not deep";
}

TEST(ParseJson, BoundsTheNumberOfValues) {
  EXPECT_EQ(refusal("[1,2,3]", {.values = 4}), "");
  EXPECT_EQ(refusal("[1,2,3,4]", {.values = 4}), "it has more than 4 values");
  EXPECT_NE(refusal(R"({"a":[],"b":{},"c":1,"d":""})", {.values = 4}), "");
}

TEST(JsonInteger, ReturnsWholeNumbersWithinTheRange) {
  EXPECT_EQ(json_integer(parse_json("20"), "n", 1, 20), 20);
  EXPECT_EQ(json_integer(parse_json("-5"), "n", -5, 20), -5);
  EXPECT_EQ(json_integer(parse_json("9223372036854775807"), "n", 0, std::numeric_limits<std::int64_t>::max()),
            std::numeric_limits<std::int64_t>::max());
}

TEST(JsonInteger, RefusesOtherKindsAndWhatIsOutOfRange) {
  for (const char* text :
       {"true", "false", "null", "20.7", "20.0", "1e2", "\"20\"", "[20]", "{}", "4294967297", "0", "21", "-1",
        "9223372036854775808", "18446744073709551617", "-9223372036854775809"})
    EXPECT_NE(message_of([&] { json_integer(parse_json(text), "n", 1, 20); }), "") << text;
  EXPECT_EQ(message_of([] { json_integer(true, "components", 1, 1024); }),
            "\"components\" is true; allowed: a whole number from 1 to 1024");
  EXPECT_EQ(message_of([] { json_integer(20.5, "components", 1, 1024); }),
            "\"components\" is 20.5; allowed: a whole number from 1 to 1024");
}

TEST(JsonNumber, TakesIntegersAndFractionsWithinTheBounds) {
  EXPECT_EQ(json_number(parse_json("2"), "x", 0, 2), 2.0);
  EXPECT_EQ(json_number(parse_json("0"), "x", 0, 2), 0.0);
  EXPECT_EQ(json_number(parse_json("-1.5"), "x"), -1.5);
  for (const char* text : {"true", "null", "\"1\"", "[1]", "2.001", "-0.001"})
    EXPECT_NE(message_of([&] { json_number(parse_json(text), "x", 0, 2); }), "") << text;
  EXPECT_EQ(message_of([] { json_number(2.5, "x", 0, 2); }),
            "\"x\" is 2.5; allowed: a number from 0.0 to 2.0");
  EXPECT_NE(message_of([] { json_number(std::nan(""), "x"); }), "");
}

TEST(JsonConversions, RefuseEveryOtherKind) {
  EXPECT_TRUE(json_flag(true, "f"));
  EXPECT_FALSE(json_flag(false, "f"));
  for (const char* text : {"1", "0", "\"true\"", "null", "[]"})
    EXPECT_NE(message_of([&] { json_flag(parse_json(text), "f"); }), "") << text;
  EXPECT_EQ(json_text("duck", "t"), "duck");
  for (const char* text : {"1", "null", "[\"duck\"]", "true"})
    EXPECT_NE(message_of([&] { json_text(parse_json(text), "t"); }), "") << text;
  EXPECT_EQ(json_numbers(parse_json("[1, 2.5]"), "q"), (std::vector{1.0, 2.5}));
  EXPECT_TRUE(json_numbers(parse_json("[]"), "q").empty());
  for (const char* text : {"1", "[1, true]", "[\"1\"]", "[null]", "{}"})
    EXPECT_NE(message_of([&] { json_numbers(parse_json(text), "q"); }), "") << text;
}

TEST(JsonConversions, ShowLongValuesShortAndEscaped) {
  const std::string message = message_of([] { json_flag("\x1b[31m" + std::string(500, 'x'), "f"); });
  EXPECT_LT(message.size(), 120U);
  EXPECT_EQ(message.find('\x1b'), std::string::npos);
}

TEST(JsonMember, NamesWhatIsMissing) {
  EXPECT_EQ(json_member(parse_json(R"({"a": 5})"), "a"), 5);
  const json object = json::object();
  EXPECT_EQ(message_of([&] { json_member(object, "views"); }), "\"views\" is missing");
  const json list = json::array();
  EXPECT_EQ(message_of([&] { json_member(list, "views"); }), "it is an array; allowed: an object");
}

TEST(JsonOnlyKeys, RefusesAKeyNobodyReads) {
  const json body = parse_json(R"({"object": "duck", "plna": "turn"})");
  EXPECT_EQ(message_of([&] { json_only_keys(body, {"object", "plna"}); }), "");
  EXPECT_EQ(message_of([&] {
              json_only_keys(body, {"object", "plan"});
            }),
            "there is no key \"plna\"; allowed: object, plan");
  EXPECT_NE(message_of([] { json_only_keys(json(5), {}); }), "");
}

}  // namespace
}  // namespace eigenpose
