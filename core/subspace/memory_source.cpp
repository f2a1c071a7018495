#include "core/subspace/memory_source.h"

#include <algorithm>
#include <cmath>
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

void bytes_to_unit_columns(const std::uint8_t* bytes, std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) {
  const auto length = static_cast<std::size_t>(tile.rows());
  for (Eigen::Index j = 0; j < tile.cols(); ++j) {
    const std::uint8_t* view = bytes + static_cast<std::size_t>(j) * length;
    std::uint64_t energy = 0;
    for (std::size_t k = 0; k < length; ++k) energy += static_cast<std::uint64_t>(view[k]) * view[k];
    if (energy == 0) {
      throw std::invalid_argument("view " + std::to_string(first + static_cast<std::size_t>(j)) +
                                  " is black: it has no energy to scale; leave it out");
    }
    const double scale = 1.0 / std::sqrt(static_cast<double>(energy));
    for (std::size_t k = 0; k < length; ++k) {
      tile(static_cast<Eigen::Index>(k), j) = static_cast<float>(view[k] * scale);
    }
  }
}

ByteSource::ByteSource(std::span<const std::uint8_t> bytes, std::size_t length,
                       std::optional<AppearanceShape> shape)
    : bytes_(bytes), shape_(checked_shape(shape, length)), count_(bytes.size() / length) {
  if (bytes.size() % length != 0) {
    throw std::invalid_argument(std::to_string(bytes.size()) + " bytes are not a whole number of views of " +
                                std::to_string(length));
  }
}

void ByteSource::read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const {
  check_columns(first, static_cast<std::size_t>(tile.cols()), count_);
  bytes_to_unit_columns(bytes_.data() + first * length(), first, tile);
}

void ByteSource::read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const {
  check_columns(first, n, count_);
  std::copy_n(bytes_.data() + first * length(), n * length(), tile);
}

FloatSource::FloatSource(Eigen::MatrixXf columns, std::optional<AppearanceShape> shape)
    : columns_(std::move(columns)), shape_(checked_shape(shape, static_cast<std::size_t>(columns_.rows()))) {}

void FloatSource::read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const {
  check_columns(first, static_cast<std::size_t>(tile.cols()), count());
  tile = columns_.middleCols(static_cast<Eigen::Index>(first), tile.cols());
}

}  // namespace eigenpose
