// TOML 1.0 (https://toml.io/en/v1.0.0) as it is read here.

#include "config/toml_table.h"

#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;
using testing::StartsWith;

TomlTable parsed(std::string_view text) {
  return TomlTable::parse(text, "rig.toml");
}

/// The message of the refusal by the parser, or by `read`.
template <typename Read>
std::string complaint(std::string_view text, Read read) {
  try {
    read(parsed(text));
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

std::string complaint(std::string_view text) {
  return complaint(text, [](const TomlTable&) {});
}

/// The message of the refusal of a file.
std::string refusal_of(const std::filesystem::path& file) {
  try {
    (void)TomlTable::read_file(file);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

const auto as_text = [](const TomlTable& table) { (void)table.text("k"); };
const auto as_flag = [](const TomlTable& table) { (void)table.flag("k"); };
const auto as_number = [](const TomlTable& table) { (void)table.number("k", {}, -10, 10); };
const auto as_integer = [](const TomlTable& table) { (void)table.integer("k", {}, -10, 10); };
const auto as_numbers = [](const TomlTable& table) { (void)table.numbers("k"); };
const auto as_texts = [](const TomlTable& table) { (void)table.texts("k"); };
const auto as_integers = [](const TomlTable& table) { (void)table.integers("k"); };
const auto as_text_pairs = [](const TomlTable& table) { (void)table.text_pairs("k"); };
const auto as_table = [](const TomlTable& table) { (void)table.table("k"); };
const auto as_tables = [](const TomlTable& table) { (void)table.tables("k"); };

TEST(TomlTable, EveryKindOfStringIsRead) {
  EXPECT_EQ(parsed(R"(k = "a\tb\n\"\\\u00e9\U0001F600")").text("k"), "a\tb\n\"\\é😀");
  EXPECT_EQ(parsed(R"(k = 'C:\no "escape"')").text("k"), R"(C:\no "escape")");
  EXPECT_EQ(parsed("k = \"\"\"\none \\\n   two\nthree\"\"\"").text("k"), "one two\nthree");
  EXPECT_EQ(parsed("k = '''\none \\\ntwo'''").text("k"), "one \\\ntwo");
  EXPECT_EQ(parsed("k = \"ключ\"").text("k"), "ключ");
}

TEST(TomlTable, EveryWayToWriteANumberIsRead) {
  for (const auto& [text, value] : std::vector<std::pair<std::string, std::int64_t>>{{"+7", 7},
                                                                                     {"-7", -7},
                                                                                     {"1_0", 10},
                                                                                     {"0x0a", 10},
                                                                                     {"0o12", 10},
                                                                                     {"0b1010", 10},
                                                                                     {"0", 0},
                                                                                     {"-0", 0}})
    EXPECT_EQ(parsed("k = " + text).integer("k", {}, -10, 10), value) << text;
  for (const auto& [text, value] : std::vector<std::pair<std::string, double>>{
           {"1.5", 1.5}, {"-0.25e1", -2.5}, {"1e0_1", 10.0}, {"+0.5E-1", 0.05}, {"7", 7.0}, {"0x0a", 10.0}})
    EXPECT_EQ(parsed("k = " + text).number("k", {}, -10, 10), value) << text;
  EXPECT_EQ(parsed("k = 9223372036854775807").integer("k", {}, 0, std::numeric_limits<std::int64_t>::max()),
            std::numeric_limits<std::int64_t>::max());
}

TEST(TomlTable, KeysMayBeDottedQuotedAndInline) {
  for (const char* text :
       {"a.b = 1", "a . b = 1", "\"a\".'b' = 1", "[a]\nb = 1", "a = { b = 1 }", "[ a ]\n\"\\u0062\" = 1"})
    EXPECT_EQ(parsed(text).table("a")->integer("b", {}, 0, 9), 1) << text;
}

TEST(TomlTable, LineEndsAndAByteOrderMarkMakeNoDifference) {
  EXPECT_EQ(parsed("\xef\xbb\xbf# rig\r\n[a]\r\nb = 1\r\n").table("a")->integer("b", {}, 0, 9), 1);
  EXPECT_THAT(complaint("\xef\xbb\xbf\r\n[a]\r\nb = \r\n"), StartsWith("rig.toml:3: not valid TOML"));
}

TEST(TomlTable, WhatIsNotTomlIsRefusedWithItsLine) {
  for (const char* text : {"k",
                           "k =",
                           "k = 1 2",
                           "= 1",
                           "k = 01",
                           "k = 1.",
                           "k = .5",
                           "k = 0xg",
                           "k = +0x1",
                           "k = 1__0",
                           "k = tru",
                           "k = \"a",
                           "k = \"\\x41\"",
                           "k = \"a\nb\"",
                           "k = [1",
                           "[k",
                           "[[k]",
                           "[]",
                           "a.b. = 1",
                           "k = { a = 1, }",
                           "k = { a = 1\n }",
                           "k = 1\rj = 2",
                           "k = 9223372036854775808",
                           "k = \"\\ud800\"",
                           "k = \"\xff\"",
                           "k = \"\x01\"",
                           "# \x01",
                           "k = 2026-13-01",
                           "k = NaN"})
    EXPECT_THAT(complaint("\n" + std::string(text)),
                AllOf(StartsWith("rig.toml:"), HasSubstr("not valid TOML")))
        << text;
}

TEST(TomlTable, AKeyOrTableThatIsThereTwiceIsRefused) {
  for (const char* text : {"k = 1\nk = 2", "k = 1\n\"k\" = 2", "[a]\n[a]", "a.b = 1\na.b = 2", "a = 1\n[a]",
                           "a = { b = 1 }\na.c = 2", "a = [1]\n[[a]]", "[[a]]\n[a]", "[a.b]\n[a]\nb = 1",
                           "k = { a = 1, a = 2 }"})
    EXPECT_THAT(complaint(text), HasSubstr("not valid TOML")) << text;
  EXPECT_THAT(complaint("k = 1\nj = 1\nk = 2"), StartsWith("rig.toml:3: "));
}

TEST(TomlTable, NoValueIsTakenForOneOfAnotherKind) {
  // A value of each kind, and the readers that take it.
  struct Value {
    const char* text;
    std::string readers;
  };
  for (const Value& value : {Value{"\"7\"", "text"},
                             Value{"7", "number integer"},
                             Value{"7.0", "number"},
                             Value{"true", "flag"},
                             Value{"2026-01-01", ""},
                             Value{"07:30:00", ""},
                             Value{"2026-01-01T07:30:00Z", ""},
                             Value{"inf", ""},
                             Value{"nan", ""},
                             Value{"-inf", ""},
                             Value{"[7]", "numbers"},
                             Value{"[7, 7.5]", "numbers"},
                             Value{"[\"7\"]", "texts"},
                             Value{"[7, \"7\"]", ""},
                             Value{"[true]", ""},
                             Value{"[[7]]", ""},
                             Value{"[nan]", ""},
                             Value{"[2026-01-01]", ""},
                             Value{"{ a = 7 }", "integers table"},
                             Value{"{ a = \"7\" }", "text_pairs table"},
                             Value{"{ a = 7.0 }", "table"},
                             Value{"{ a = true }", "table"},
                             Value{"{ a = 7, b = \"7\" }", "table"},
                             Value{"[{ a = 7 }]", "tables"},
                             Value{"[{ a = 7 }, 7]", ""},
                             Value{"{}", "integers text_pairs table"},
                             Value{"[]", "numbers texts tables"}}) {
    const auto expect = [&](const char* reader, const std::string& said) {
      const bool takes =
          (" " + value.readers + " ").find(" " + std::string(reader) + " ") != std::string::npos;
      if (takes)
        EXPECT_EQ(said, "accepted") << value.text << " as " << reader;
      else
        EXPECT_THAT(said, StartsWith("rig.toml:2: ")) << value.text << " as " << reader;
    };
    const std::string text = "\nk = " + std::string(value.text);
    expect("text", complaint(text, as_text));
    expect("flag", complaint(text, as_flag));
    expect("number", complaint(text, as_number));
    expect("integer", complaint(text, as_integer));
    expect("numbers", complaint(text, as_numbers));
    expect("texts", complaint(text, as_texts));
    expect("integers", complaint(text, as_integers));
    expect("text_pairs", complaint(text, as_text_pairs));
    expect("table", complaint(text, as_table));
    expect("tables", complaint(text, as_tables));
  }
}

TEST(TomlTable, BothBoundsOfANumberHold) {
  for (const char* inside : {"-10", "10", "0"}) {
    EXPECT_EQ(complaint(std::string("k = ") + inside, as_integer), "accepted");
    EXPECT_EQ(complaint(std::string("k = ") + inside + ".0", as_number), "accepted");
  }
  for (const char* outside : {"-11", "11", "4294967297", "9223372036854775807", "-9223372036854775808"}) {
    EXPECT_THAT(complaint(std::string("k = ") + outside, as_integer), HasSubstr("-10 to 10")) << outside;
    EXPECT_THAT(complaint(std::string("k = ") + outside, as_number), HasSubstr("-10 to 10")) << outside;
  }
  for (const char* outside : {"10.0000001", "-10.0000001", "1e300"})
    EXPECT_THAT(complaint(std::string("k = ") + outside, as_number), HasSubstr("-10 to 10")) << outside;
}

TEST(TomlTable, AnAbsentKeyGivesItsFallbackOrIsRefused) {
  const TomlTable table = parsed("other = 1");
  EXPECT_EQ(table.text("k", "x"), "x");
  EXPECT_TRUE(table.flag("k", true));
  EXPECT_EQ(table.number("k", 2.5, 0, 10), 2.5);
  EXPECT_EQ(table.integer("k", 3, 0, 10), 3);
  EXPECT_TRUE(table.numbers("k").empty());
  EXPECT_FALSE(table.table("k"));
  EXPECT_FALSE(table.has("k"));
  for (const auto& read :
       {std::function<void(const TomlTable&)>(as_text), std::function<void(const TomlTable&)>(as_flag),
        std::function<void(const TomlTable&)>(as_number), std::function<void(const TomlTable&)>(as_integer)})
    EXPECT_THAT(complaint("[t]\nother = 1", [&](const TomlTable& root) { read(*root.table("t")); }),
                AllOf(StartsWith("rig.toml:1: "), HasSubstr("k is missing in [t]")));
}

TEST(TomlTable, EveryKeyNobodyAskedForIsRefused) {
  const auto finish = [](const TomlTable& table) {
    (void)table.has("known");
    table.finish();
  };
  EXPECT_EQ(complaint("known = 1", finish), "accepted");
  EXPECT_THAT(complaint("known = 1\n\"\" = 2", finish),
              AllOf(StartsWith("rig.toml:2: "), HasSubstr("unknown key")));
  EXPECT_THAT(complaint("known = 1\n\nKnown = 2", finish),
              AllOf(StartsWith("rig.toml:3: "), HasSubstr("did you mean \"known\"?")));
  EXPECT_THAT(complaint("known = 1\n[other]", finish), StartsWith("rig.toml:2: "));
}

TEST(TomlTable, ListsKeepTheirOrderAndTablesTheirNames) {
  EXPECT_THAT(parsed("k = [ 3, 1.5, # why\n 2, ]").numbers("k"), ElementsAre(3.0, 1.5, 2.0));
  EXPECT_THAT(parsed("k = ['b', \"a\"]").texts("k"), ElementsAre("b", "a"));
  EXPECT_THAT(parsed("[k]\nb = 2\na = 1").integers("k"),
              testing::UnorderedElementsAre(Pair("a", 1), Pair("b", 2)));
  const auto tables = parsed("[[k]]\nn = 1\n[[k]]\nn = 2\n[[k]]\n").tables("k");
  ASSERT_EQ(tables.size(), 3U);
  EXPECT_EQ(tables[1].integer("n", {}, 0, 9), 2);
}

TEST(TomlTable, NestingIsBoundedBeforeTheStackEnds) {
  const std::string arrays = "k = " + std::string(100'000, '[') + std::string(100'000, ']');
  EXPECT_THAT(complaint(arrays), StartsWith("rig.toml:1: not valid TOML"));
  std::string tables = "k = 1";
  for (int i = 0; i < 5000; ++i) tables = "k = { " + tables + " }";
  EXPECT_THAT(complaint(tables), StartsWith("rig.toml:1: not valid TOML"));
  std::string dotted = "a";
  for (int i = 0; i < 32; ++i) dotted += ".a";
  EXPECT_EQ(complaint("\n" + dotted + " = 1"), "accepted");
  EXPECT_EQ(complaint("[" + dotted + "]"), "accepted");
  for (const std::string& text :
       {dotted + ".a = 1", "[" + dotted + ".a]", "[[" + dotted + ".a]]", "k = { " + dotted + ".a = 1 }"})
    EXPECT_THAT(complaint("\n" + text),
                AllOf(StartsWith("rig.toml:2: "), HasSubstr("joins more than 33 names")))
        << text;
}

TEST(TomlTable, DotsInStringsCommentsAndListsAreNoNesting) {
  const std::string dots(100, '.');
  EXPECT_EQ(complaint("k = \"" + dots + "\\\"" + dots + "\" # " + dots), "accepted");
  EXPECT_EQ(complaint("k = '" + dots + "'\nj = \"\"\"\n\"" + dots + "\n\"\"\"\ni = '''\n" + dots + "'''"),
            "accepted");
  std::string list = "k = [";
  for (int i = 0; i < 100; ++i) list += "1.5, ";
  EXPECT_EQ(complaint(list + "]"), "accepted");
}

TEST(TomlTable, NestingIsBoundedBehindEveryKindOfString) {
  std::string deep = "a";
  for (int i = 0; i < 33; ++i) deep += ".a";
  for (const std::string text : {"'x\\'", "'\\'", "\"x\\\\\"", "\"\\\"\"", "\"it's\"", "'say \"'", "''",
                                 "\"\"", "'''x\\'''", "\"\"\"x\\\\\"\"\"", "'''it's'''", "\"\"\"\"x\"\"\""}) {
    EXPECT_EQ(complaint("k = " + text + "\n"), "accepted") << text;
    EXPECT_THAT(complaint("k = " + text + "\n" + deep + " = 1\n"),
                AllOf(StartsWith("rig.toml:2: "), HasSubstr("joins more than 33 names")))
        << text;
  }
}

TEST(TomlTable, AFileOfMoreThanAMebibyteIsRefused) {
  EXPECT_EQ(complaint(std::string(1U << 20U, '\n')), "accepted");
  EXPECT_THAT(complaint(std::string((1U << 20U) + 1, '\n')), HasSubstr("rig.toml: more than 1048576 bytes"));
  const test::TemporaryFolder folder;
  const std::filesystem::path large = folder.path() / "large.toml";
  std::ofstream(large) << std::string((1U << 20U) + 1, '\n');
  EXPECT_THAT(refusal_of(large), HasSubstr("large.toml: more than 1048576 bytes"));
}

TEST(TomlTable, OnlyAPlainFileIsOpened) {
  const test::TemporaryFolder folder;
  const std::filesystem::path pipe = folder.path() / "pipe.toml";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const std::filesystem::path& file : {pipe, std::filesystem::path("/dev/zero"), folder.path()})
    EXPECT_THAT(refusal_of(file), HasSubstr(file.string() + ": is not a file that can be read"));
}

}  // namespace
}  // namespace eigenpose
