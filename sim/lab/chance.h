#pragma once

/// Small repeatable chance: the same seed and stream give the same numbers on every machine.

#include <cstdint>

namespace eigenpose::sim {

/// Sebastiano Vigna's splitmix64. One thread at a time.
class Chance {
 public:
  /// @param stream tells apart several uses of one seed.
  explicit Chance(std::uint64_t seed, std::uint64_t stream = 0)
      : state_(scramble(seed + 0x9E3779B97F4A7C15ULL * (stream + 1))) {}

  std::uint64_t next() {
    state_ += 0x9E3779B97F4A7C15ULL;
    return scramble(state_);
  }
  /// Even in [0, 1).
  double uniform() { return static_cast<double>(next() >> 11U) * 0x1.0p-53; }

 private:
  static constexpr std::uint64_t scramble(std::uint64_t x) {
    x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
    return x ^ (x >> 31U);
  }
  std::uint64_t state_;
};

}  // namespace eigenpose::sim
