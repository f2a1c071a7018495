#include "core/subspace/memory_source.h"

#include <stdexcept>
#include <string>
#include <utility>

namespace eigenpose {

AppearanceShape checked_shape(std::optional<AppearanceShape> shape, std::size_t length) {
  if (length == 0) throw std::invalid_argument("an appearance has 0 numbers: give views of at least one");
  const AppearanceShape result = shape.value_or(AppearanceShape{1, length, 1});
  if (result.length() != length) {
    throw std::invalid_argument("the shape has " + std::to_string(result.length()) +
                                " numbers, the views have " + std::to_string(length));
  }
  return result;
}

void check_columns(std::size_t first, std::size_t n, std::size_t count) {
  if (first > count || n > count - first) {
    throw std::invalid_argument("views " + std::to_string(first) + " to " + std::to_string(first + n) +
                                " were asked for, there are " + std::to_string(count));
  }
}

void AppearanceSource::read_bytes(std::size_t, std::size_t, std::uint8_t*) const {
  throw std::invalid_argument("this source has no 8-bit views: ask has_bytes() first, or call read()");
}

FloatSource::FloatSource(Eigen::MatrixXf columns, std::optional<AppearanceShape> shape)
    : columns_(std::move(columns)), shape_(checked_shape(shape, static_cast<std::size_t>(columns_.rows()))) {}

void FloatSource::read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const {
  check_columns(first, static_cast<std::size_t>(tile.cols()), count());
  tile = columns_.middleCols(static_cast<Eigen::Index>(first), tile.cols());
}

}  // namespace eigenpose
