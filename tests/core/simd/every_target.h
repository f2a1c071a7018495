#pragma once

/// Runs a check once for every SIMD target that this processor can run.

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "core/simd/targets.h"

namespace eigenpose::test {

/// Calls check() under each target; failures name it.
template <class Check>
void on_every_target(const Check& check) {
  for (const std::string& name : simd_targets()) {
    SCOPED_TRACE("SIMD target " + name);
    const OnlySimdTarget only(name);
    check();
    if (testing::Test::HasFatalFailure()) return;
  }
}

/// Lengths around the vectors' lengths and their multiples, 0 among them.
inline const std::vector<std::size_t> lengths = {0,  1,  2,   3,   4,   5,   7,   8,  9,  15,
                                                 16, 17, 31,  32,  33,  47,  63,  64, 65, 95,
                                                 96, 97, 127, 128, 130, 191, 193, 517};

/// `count` values that begin `offset` elements after an address that every vector would like.
template <class T>
class Unaligned {
 public:
  Unaligned(std::size_t count, std::size_t offset, T value = T())
      : values_(count + offset + guard, value), offset_(offset), count_(count) {}
  [[nodiscard]] T* data() { return values_.data() + offset_; }
  [[nodiscard]] const T* data() const { return values_.data() + offset_; }
  [[nodiscard]] std::size_t size() const { return count_; }
  T& operator[](std::size_t i) { return data()[i]; }
  const T& operator[](std::size_t i) const { return data()[i]; }

  /// Whether nothing before or after the values differs from `value`.
  [[nodiscard]] bool surroundings_are(T value) const {
    for (std::size_t i = 0; i < values_.size(); ++i)
      if ((i < offset_ || i >= offset_ + count_) && values_[i] != value) return false;
    return true;
  }

 private:
  static constexpr std::size_t guard = 64;
  std::vector<T> values_;
  std::size_t offset_;
  std::size_t count_;
};

/// Fills with normal values.
template <class Values>
void fill_normal(Values& values, std::mt19937& random) {
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<std::remove_reference_t<decltype(values[0])>>(normal(random));
}

/// Fills with any bytes.
template <class Values>
void fill_bytes(Values& values, std::mt19937& random) {
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<std::uint8_t>(random());
}

}  // namespace eigenpose::test
