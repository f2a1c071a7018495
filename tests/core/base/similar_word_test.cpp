#include "core/base/similar_word.h"

#include <vector>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

const std::vector<std::string> known = {"recognize", "results", "resample", "settle_ms", "status"};

TEST(SimilarWord, FindsAWordThatDiffersInTwoLettersAtMost) {
  EXPECT_EQ(similar_word("recogniz", known), "recognize");
  EXPECT_EQ(similar_word("recognise", known), "recognize");
  EXPECT_EQ(similar_word("statuss", known), "status");
  EXPECT_EQ(similar_word("sattus", known), "status") << "two letters swapped";
  EXPECT_EQ(similar_word("sttts", known), "status");
  EXPECT_EQ(similar_word("tts", known), std::nullopt) << "three letters are another word";
}

TEST(SimilarWord, PrefersTheNearest) {
  EXPECT_EQ(similar_word("result", known), "results");
  const std::vector<std::string> near = {"at", "as"};
  EXPECT_EQ(similar_word("a", near), "at") << "of equals the first";
}

TEST(SimilarWord, TakesAWrongUnitForNear) {
  EXPECT_EQ(similar_word("settle_seconds", known), "settle_ms");
  EXPECT_EQ(similar_word("settle", {}), std::nullopt);
}

}  // namespace
}  // namespace eigenpose
