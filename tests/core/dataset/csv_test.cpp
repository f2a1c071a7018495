#include "core/dataset/csv.h"

#include <fstream>

#include <gmock/gmock.h>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Csv : public ::testing::Test {
 protected:
  [[nodiscard]] CsvTable read(const std::string& text) const {
    const auto file = folder_.path() / "table.csv";
    std::ofstream(file, std::ios::binary) << text;
    return read_csv(file);
  }
  [[nodiscard]] std::string refusal(const std::string& text) const {
    try {
      (void)read(text);
    } catch (const FileError& error) {
      return error.what();
    }
    return "accepted";
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(Csv, ReadsPlainFieldsWithEitherLineEndAndWithoutTheLast) {
  for (const char* text : {"a,b\n1,2\n3,4\n", "a,b\r\n1,2\r\n3,4\r\n", "a,b\r\n1,2\n3,4",
                           "\xEF\xBB\xBF"
                           "a,b\n1,2\n3,4\n"}) {
    const CsvTable table = read(text);
    EXPECT_THAT(table.header, ElementsAre("a", "b")) << text;
    ASSERT_EQ(table.rows.size(), 2U) << text;
    EXPECT_THAT(table.rows[0].fields, ElementsAre("1", "2"));
    EXPECT_THAT(table.rows[1].fields, ElementsAre("3", "4"));
    EXPECT_EQ(table.rows[1].line, 3U);
  }
}

TEST_F(Csv, ReadsQuotedFieldsWithCommasQuotesAndLineEnds) {
  const CsvTable table = read("a,b\n\"1,5\",\"he said \"\"no\"\"\"\n\"two\r\nlines\",\"\"\nlast,x\n");
  EXPECT_THAT(table.rows[0].fields, ElementsAre("1,5", "he said \"no\""));
  EXPECT_THAT(table.rows[1].fields, ElementsAre("two\r\nlines", ""));
  EXPECT_EQ(table.rows[2].line, 5U) << "a line end in a field counts";
}

TEST_F(Csv, KeepsEmptyFieldsAndSpacesAndSkipsEmptyLines) {
  const CsvTable table = read("\n\na,b,c\n\n, x ,\n\r\n1,2,3\n\n");
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_THAT(table.rows[0].fields, ElementsAre("", " x ", ""));
  EXPECT_EQ(table.rows[0].line, 5U);
  EXPECT_EQ(table.rows[1].line, 7U);
  EXPECT_THAT(read("a,b\n1,").rows[0].fields, ElementsAre("1", ""))
      << "an empty last field at the end of the file";
}

TEST_F(Csv, NamesTheLineOfWhatIsWrong) {
  EXPECT_THAT(refusal("a,b\n1,2\n3,\"4\n5,6\n"), AllOf(HasSubstr("line 3"), HasSubstr("never closed")));
  EXPECT_THAT(refusal("a,b\n1,x\"y\n"), AllOf(HasSubstr("line 2"), HasSubstr("quote")));
  EXPECT_THAT(refusal("a,b\n1,\"x\"y\n"), AllOf(HasSubstr("line 2"), HasSubstr("closing quote")));
  EXPECT_THAT(refusal("a,b\n1,2\n1,2,3\n"),
              AllOf(HasSubstr("line 3"), HasSubstr("3 fields"), HasSubstr("has 2")));
  EXPECT_THAT(refusal("a,b\n1\n"), AllOf(HasSubstr("line 2"), HasSubstr("1 fields")));
  EXPECT_THAT(refusal("a,b\n1\r2,3\n"), AllOf(HasSubstr("line 2"), HasSubstr("carriage return")));
  EXPECT_THAT(refusal(std::string("a,b\n1,2\n3,\0\n", 11)), AllOf(HasSubstr("line 3"), HasSubstr("NUL")));
}

TEST_F(Csv, RefusesTablesWithoutRowsAndOtherEncodings) {
  EXPECT_THAT(refusal(""), HasSubstr("empty"));
  EXPECT_THAT(refusal("\n\n"), HasSubstr("empty"));
  EXPECT_THAT(refusal("a,b\n"), HasSubstr("no row"));
  EXPECT_THAT(refusal("\xFF\xFE"
                      "a"),
              HasSubstr("UTF-16"));
  EXPECT_THROW((void)read_csv("/nowhere/table.csv"), FileError);
}

}  // namespace
}  // namespace eigenpose
