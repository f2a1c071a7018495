#include "core/base/printable.h"

#include <string>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

TEST(Printable, KeepsOrdinaryTextOfAnyLanguage) {
  for (const std::string text : {"", "duck", "C:\\a b", "Entchen für Jürgen", "鴨 🦆", "é́"})
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, WritesControlCharactersOut) {
  EXPECT_EQ(printable(std::string("a\nlevel=error\r\x1b[2J\0\t\x7f", 21)),
            "a\\nlevel=error\\r\\x1b[2J\\x00\\t\\x7f");
}

TEST(Printable, WritesBytesOutThatAreNotUtf8) {
  EXPECT_EQ(printable("k\xe4.png"), "k\\xe4.png");
  EXPECT_EQ(printable("\xc3"), "\\xc3") << "cut off";
  EXPECT_EQ(printable("\xe2\x82"), "\\xe2\\x82") << "cut off";
  EXPECT_EQ(printable("\xc3(\x80"), "\\xc3(\\x80");
  EXPECT_EQ(printable("\xc0\xaf\xe0\x80\xaf\xf0\x80\x80\xaf"),
            "\\xc0\\xaf\\xe0\\x80\\xaf\\xf0\\x80\\x80\\xaf")
      << "overlong";
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "above U+10FFFF";
}

TEST(Printable, WritesCharactersOutThatReorderOrBreakLines) {
  EXPECT_EQ(printable("a\u0085b"), "a\\xc2\\x85b");
  EXPECT_EQ(printable("a\u202egnp.exe"), "a\\xe2\\x80\\xaegnp.exe");
  EXPECT_EQ(printable("a\u2028b\u2066c"), "a\\xe2\\x80\\xa8b\\xe2\\x81\\xa6c");
  EXPECT_EQ(printable("\u2027\u202f\u2065\u206a\u00a0"), "\u2027\u202f\u2065\u206a\u00a0")
      << "the neighbours are kept";
}

}  // namespace
}  // namespace eigenpose
