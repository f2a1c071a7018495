#include "tests/support/byte_source.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/subspace/memory_source.h"

namespace eigenpose {

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

}  // namespace eigenpose
