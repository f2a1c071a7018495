#include "sim/camera/sensor.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

#include "sim/lab/chance.h"

namespace eigenpose::sim {
namespace {

constexpr int top = 16383;  // electrons are kept in 14 bits; the well is smaller
constexpr std::size_t gauss_count = 1U << 15;
constexpr int run = 48;  // values that share one place in the table of normal numbers

double srgb_curve(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
}

double srgb_inverse(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

}  // namespace

Sensor::Sensor(SensorOptions options) : options_(options) {
  if (!(options.full_well > 0.0 && options.full_well <= top) || !(options.read_noise >= 0.0)) {
    throw std::invalid_argument("a sensor needs a full well within 0 … " + std::to_string(top) +
                                " electrons and a read noise of 0 or more");
  }
  sigma_.resize(static_cast<std::size_t>(top) / 8 + 1);
  for (std::size_t i = 0; i < sigma_.size(); ++i) {
    const double electrons = 8.0 * static_cast<double>(i) + 4.0;
    sigma_[i] = static_cast<float>(std::sqrt(electrons + options.read_noise * options.read_noise));
  }
  curve_.resize(static_cast<std::size_t>(top) / 2 + 1);
  for (std::size_t i = 0; i < curve_.size(); ++i) {
    const double linear = std::min(1.0, (2.0 * static_cast<double>(i) + 1.0) / options.full_well);
    curve_[i] = static_cast<std::uint8_t>(std::lround(255.0 * srgb_curve(linear)));
  }
  // The same table in every process: what differs is where a frame starts to read it.
  std::mt19937 generator(20240229);
  std::normal_distribution<float> normal;
  gauss_.resize(gauss_count + run);
  for (float& g : gauss_) g = normal(generator);
}

double Sensor::electrons_of(double value) const {
  return options_.full_well * srgb_inverse(value / 255.0);
}

cv::Mat Sensor::expose(const cv::Mat& light, double exposure_factor) const {
  cv::Mat picture;
  if (options_.color) {
    picture = light;
  } else {
    cv::cvtColor(light, picture, cv::COLOR_BGR2GRAY);
  }
  if (options_.blur_sigma > 0.0)
    cv::GaussianBlur(picture, picture, {}, options_.blur_sigma, 0.0, cv::BORDER_REPLICATE);
  cv::Mat electrons(picture.size(), options_.color ? CV_16UC3 : CV_16UC1);
  const int bands = picture.channels();
  const double cx = 0.5 * (picture.cols - 1);
  const double cy = 0.5 * (picture.rows - 1);
  const double corner = cx * cx + cy * cy;
  const auto well = static_cast<float>(options_.full_well);
  for (int y = 0; y < picture.rows; ++y) {
    const auto* from = picture.ptr<float>(y);
    auto* to = electrons.ptr<std::uint16_t>(y);
    for (int x = 0; x < picture.cols; ++x) {
      const double r2 = ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / corner;
      const auto gain =
          static_cast<float>(options_.full_well * exposure_factor * (1.0 - options_.vignetting * r2));
      for (int c = 0; c < bands; ++c) {
        to[x * bands + c] =
            static_cast<std::uint16_t>(std::clamp(gain * from[x * bands + c] + 0.5F, 0.0F, well));
      }
    }
  }
  return electrons;
}

cv::Mat Sensor::read(const cv::Mat& electrons, std::uint64_t seed, double extra_noise) const {
  cv::Mat values(electrons.size(), electrons.channels() == 3 ? CV_8UC3 : CV_8UC1);
  const int count = electrons.cols * electrons.channels();
  const auto extra = static_cast<float>(extra_noise);
  for (int y = 0; y < electrons.rows; ++y) {
    Chance chance(seed, static_cast<std::uint64_t>(y));
    const auto* from = electrons.ptr<std::uint16_t>(y);
    auto* to = values.ptr<std::uint8_t>(y);
    for (int begin = 0; begin < count; begin += run) {
      const std::uint64_t place = chance.next();
      const float* gauss = gauss_.data() + place % gauss_count;
      const float* more = gauss_.data() + (place >> 32U) % gauss_count;
      const int end = std::min(count - begin, run);
      for (int i = 0; i < end; ++i) {
        const int e = from[begin + i];
        const int noisy = e + static_cast<int>(sigma_[static_cast<std::size_t>(e) >> 3U] * gauss[i]);
        const int clipped = std::clamp(noisy, 0, top);
        to[begin + i] = curve_[static_cast<std::size_t>(clipped) >> 1U];
      }
      if (extra <= 0.0F) continue;
      for (int i = 0; i < end; ++i) {
        to[begin + i] = cv::saturate_cast<std::uint8_t>(static_cast<float>(to[begin + i]) + extra * more[i]);
      }
    }
  }
  return values;
}

}  // namespace eigenpose::sim
