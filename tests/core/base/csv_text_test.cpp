#include "core/base/csv_text.h"

#include <limits>

#include <gmock/gmock.h>

namespace eigenpose {
namespace {

TEST(CsvText, QuotesOnlyFieldsThatNeedIt) {
  EXPECT_EQ(csv_field("obj1"), "obj1");
  EXPECT_EQ(csv_field(""), "");
  EXPECT_EQ(csv_field("a,b"), "\"a,b\"");
  EXPECT_EQ(csv_field("a\"b"), "\"a\"\"b\"");
  EXPECT_EQ(csv_field("a\nb"), "\"a\nb\"");
  EXPECT_EQ(csv_field("a\rb"), "\"a\rb\"");
}

TEST(CsvText, WritesNumbersInTheDigitsThatTheyNeed) {
  const auto written = [](double value, int digits = 9) {
    std::string text;
    append_number(text, value, digits);
    return text;
  };
  EXPECT_EQ(written(0.0), "0");
  EXPECT_EQ(written(0.1), "0.1");
  EXPECT_EQ(written(-2.5), "-2.5");
  EXPECT_EQ(written(1.0 / 3.0), "0.333333333");
  EXPECT_EQ(written(1.0 / 3.0, 3), "0.333");
  EXPECT_EQ(written(std::numeric_limits<double>::infinity()), "inf");
}

}  // namespace
}  // namespace eigenpose
