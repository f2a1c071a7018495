#include "core/base/object_name.h"

#include <stdexcept>
#include <string>

#include <gmock/gmock.h>

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::ThrowsMessage;

TEST(ObjectName, IsMadeOfLettersDigitsAndAFewMarks) {
  for (const std::string name : {"a", "Z", "0", "duck", "obj1_a.b-c", "9-9"})
    EXPECT_NO_THROW(check_object_name(name)) << name;
  EXPECT_NO_THROW(check_object_name(std::string(64, 'x')));
}

TEST(ObjectName, CanBeNothingThatLeavesAFolderOrALine) {
  for (const std::string name : {"", ".", "..", ".a", "-a", "_a", "a/b", "a b", "ä", "a\n", "a\x1b", "k\xe4"})
    EXPECT_THROW(check_object_name(name), std::invalid_argument) << name;
  EXPECT_THROW(check_object_name(std::string(65, 'x')), std::invalid_argument);
  EXPECT_THROW(check_object_name(std::string("a\0b", 3)), std::invalid_argument);
}

TEST(ObjectName, IsShownInOneLineWhereItIsRefused) {
  EXPECT_THAT([] { check_object_name("x\nlevel=error \x1b[2J"); },
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr("\"x\\nlevel=error \\x1b[2J\" cannot be"), Not(HasSubstr("\n")))));
  EXPECT_THAT([] { check_object_name(std::string(100'000, 'x')); },
              ThrowsMessage<std::invalid_argument>(HasSubstr(std::string(80, 'x') + "…\"")));
}

}  // namespace
}  // namespace eigenpose
