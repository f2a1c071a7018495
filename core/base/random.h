#pragma once

/// Random numbers from a seed, the same with every standard library: the generator is fixed by the C++
/// standard, its distributions (std::uniform_real_distribution, std::shuffle …) are not.

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace eigenpose {

/// A sequence of random numbers. Value type: a copy goes on with the same numbers. One thread at a time.
class SeededRandom {
 public:
  explicit SeededRandom(std::uint32_t seed) : generator_(seed) {}

  /// Uniform in [0, 1), in steps of 2⁻³².
  double unit() { return static_cast<double>(generator_()) * 0x1p-32; }
  /// Uniform in [−1, 1), in steps of 2⁻³¹.
  double symmetric() { return static_cast<double>(generator_()) * 0x1p-31 - 1.0; }
  /// Uniform in 0…count − 1, biased by less than count·2⁻³². @pre count ≥ 1.
  int below(int count) { return static_cast<int>(generator_() % static_cast<std::uint32_t>(count)); }
  /// Normal with mean 0 and variance 1 (Box and Muller). Takes two numbers of the sequence each.
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - unit()));
    return radius * std::cos(2.0 * std::numbers::pi * unit());
  }

 private:
  std::mt19937 generator_;
};

}  // namespace eigenpose
