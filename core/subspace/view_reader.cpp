#include "core/subspace/view_reader.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace eigenpose {

ViewBlock ViewBlock::part(std::size_t first, std::size_t n) const {
  return {bytes != nullptr ? bytes + first * length : nullptr,
          floats != nullptr ? floats + first * length : nullptr, n, length,
          doubles != nullptr ? doubles + first * length : nullptr};
}

void ViewBlock::widen(std::size_t view, std::size_t offset, std::size_t n, double* out) const {
  const std::size_t start = view * length + offset;
  if (bytes != nullptr) {
    std::copy_n(bytes + start, n, out);
  } else if (floats != nullptr) {
    std::copy_n(floats + start, n, out);
  } else {
    std::copy_n(doubles + start, n, out);
  }
}

ViewReader::ViewReader(const AppearanceSource& source)
    : source_(source),
      resident_(source.has_bytes() ? source.resident_bytes() != nullptr
                                   : source.resident_floats() != nullptr) {}

std::size_t ViewReader::buffer_bytes(std::size_t n) const {
  return resident_ ? 0 : n * source_.length() * (source_.has_bytes() ? sizeof(std::uint8_t) : sizeof(float));
}

std::size_t ViewReader::views_in(std::size_t memory) const {
  if (resident_ || memory == 0) return source_.count();
  const std::size_t views = memory / buffer_bytes(1);
  if (views == 0) {
    throw std::invalid_argument("the memory limit leaves " + std::to_string(memory) + " bytes for views of " +
                                std::to_string(buffer_bytes(1)) + " bytes: raise it");
  }
  return std::min(views, source_.count());
}

ViewBlock ViewReader::read(std::size_t first, std::size_t n) {
  const std::size_t length = source_.length();
  if (resident_) {
    const ViewBlock all{source_.resident_bytes(), source_.has_bytes() ? nullptr : source_.resident_floats(),
                        source_.count(), length};
    return all.part(first, n);
  }
  if (source_.has_bytes()) {
    bytes_.resize(n * length);
    source_.read_bytes(first, n, bytes_.data());
    return {bytes_.data(), nullptr, n, length};
  }
  floats_.resize(n * length);
  source_.read(first, Eigen::Map<Eigen::MatrixXf>(floats_.data(), static_cast<Eigen::Index>(length),
                                                  static_cast<Eigen::Index>(n)));
  return {nullptr, floats_.data(), n, length};
}

}  // namespace eigenpose
