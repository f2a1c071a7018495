#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/subspace/memory_source.h"
#include "tests/support/byte_source.h"

namespace eigenpose {
namespace {

TEST(ByteSource, ScalesViewsToUnitEnergy) {
  const std::vector<std::uint8_t> bytes{3, 4, 0, 5, 12, 0};
  const ByteSource source(bytes, 3);
  ASSERT_EQ(source.count(), 2U);
  Eigen::MatrixXf tile(3, 2);
  source.read(0, tile);
  EXPECT_FLOAT_EQ(tile(0, 0), 0.6F);
  EXPECT_FLOAT_EQ(tile(1, 1), 12.0F / 13.0F);
  std::vector<std::uint8_t> raw(3);
  source.read_bytes(1, 1, raw.data());
  EXPECT_EQ(raw, (std::vector<std::uint8_t>{5, 12, 0}));
}

TEST(ByteSource, RefusesWhatIsNoWholeNumberOfViews) {
  const std::vector<std::uint8_t> bytes(7);
  EXPECT_THROW(ByteSource(bytes, 3), std::invalid_argument);
  EXPECT_THROW(ByteSource(bytes, 0), std::invalid_argument);
  EXPECT_THROW(ByteSource(bytes, 7, AppearanceShape{2, 3, 1}), std::invalid_argument);
}

TEST(ByteSource, RefusesViewsThatAreNotThereAndViewsThatAreBlack) {
  const std::vector<std::uint8_t> bytes{1, 2, 0, 0};
  const ByteSource source(bytes, 2);
  Eigen::MatrixXf tile(2, 2);
  EXPECT_THROW(source.read(0, tile), std::invalid_argument) << "black";
  EXPECT_THROW(source.read(1, tile), std::invalid_argument) << "beyond the end";
}

TEST(FloatSource, HandsOutItsColumnsAndHasNoBytes) {
  Eigen::MatrixXf columns(2, 3);
  columns << 1, 0, 0.6F, 0, 1, 0.8F;
  const FloatSource source(columns);
  Eigen::MatrixXf tile(2, 2);
  source.read(1, tile);
  EXPECT_EQ(tile, columns.rightCols(2));
  std::uint8_t byte = 0;
  EXPECT_FALSE(source.has_bytes());
  EXPECT_THROW(source.read_bytes(0, 1, &byte), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose
