#pragma once

/// From light to numbers: lens blur, vignetting, photon and read noise, saturation, the usual camera curve.

#include <array>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

namespace eigenpose::sim {

struct SensorOptions {
  double full_well = 12000.0;  ///< electrons at saturation
  double read_noise = 4.0;     ///< electrons, standard deviation
  double blur_sigma = 0.55;    ///< lens, pixels
  double vignetting = 0.07;    ///< light lost in the corners, 0…1
  bool color = true;           ///< false: one grey band
};

/// Immutable after construction; any thread may use it.
class Sensor {
 public:
  explicit Sensor(SensorOptions options);

  [[nodiscard]] const SensorOptions& options() const { return options_; }
  /// Electrons gathered from a picture in linear light (CV_32FC3, 1 fills the well at `exposure_factor` 1).
  /// CV_16UC3 or CV_16UC1, without noise.
  [[nodiscard]] cv::Mat expose(const cv::Mat& light, double exposure_factor) const;
  /// One reading of these electrons, CV_8UC3 or CV_8UC1. The noise is a function of `seed`.
  /// @param extra_noise standard deviation added, grey levels of 255.
  [[nodiscard]] cv::Mat read(const cv::Mat& electrons, std::uint64_t seed, double extra_noise = 0.0) const;
  /// Electrons that a value of 0…255 stands for.
  [[nodiscard]] double electrons_of(double value) const;

 private:
  SensorOptions options_;
  std::vector<float> sigma_;         ///< noise by electrons / 8
  std::vector<std::uint8_t> curve_;  ///< value by electrons / 2
  std::vector<float> gauss_;         ///< standard normal numbers
};

}  // namespace eigenpose::sim
