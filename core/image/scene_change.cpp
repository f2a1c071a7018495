#include "core/image/scene_change.h"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>

#include <opencv2/imgproc.hpp>

namespace eigenpose {
namespace {

/// Of the noise between two frames: one block in 10⁹ of a still picture goes beyond.
constexpr double noise_factor = 6.5;
/// Standard deviation of a normal distribution over the median of its absolute values.
constexpr double sigma_over_median = 1.4826;

/// Largest difference of any block in any band, in grey levels of 255.
double largest_difference(const cv::Mat& a, const cv::Mat& b) {
  const double full = a.depth() == CV_16U ? 257.0 : 1.0;
  return cv::norm(a, b, cv::NORM_INF) / full;
}

}  // namespace

SceneChange::SceneChange(const SceneChangeOptions& options) : options_(options) {
  if (options.block < 2 || options.block > 64)
    throw std::invalid_argument("a block is 2 to 64 pixels, got " + std::to_string(options.block));
}

SceneChange::Observation SceneChange::update(const Frame& frame) {
  const cv::Size blocks((frame.image.cols + options_.block - 1) / options_.block,
                        (frame.image.rows + options_.block - 1) / options_.block);
  cv::swap(now_, before_);
  cv::resize(frame.image, now_, blocks, 0, 0, cv::INTER_AREA);
  if (anchor_.size() != now_.size() || anchor_.type() != now_.type()) {
    reset();
    cv::resize(frame.image, now_, blocks, 0, 0, cv::INTER_AREA);
    now_.copyTo(before_);
    now_.copyTo(anchor_);
    still_since_ = frame.exposure_start;
    return {};
  }
  measure_noise();
  if (largest_difference(now_, anchor_) > threshold()) {
    now_.copyTo(anchor_);
    still_since_ = frame.exposure_start;
  }
  Observation seen;
  seen.settled = frame.exposure_start - still_since_ >= options_.settle;
  seen.changed = accepted_.empty() || largest_difference(now_, accepted_) > threshold();
  return seen;
}

void SceneChange::accept() {
  now_.copyTo(accepted_);
}

void SceneChange::reset() {
  now_.release();
  before_.release();
  anchor_.release();
  accepted_.release();
  noise_count_ = 0;
}

double SceneChange::threshold() const {
  if (options_.threshold) return *options_.threshold;
  const std::size_t count = std::min(noise_count_, noise_samples);
  if (count == 0) return options_.smallest_threshold;
  // The median over several pairs of frames: a lamp switched on once is no noise.
  std::array<double, noise_samples> sorted = noise_;
  std::nth_element(sorted.begin(), sorted.begin() + count / 2, sorted.begin() + count);
  return std::max(options_.smallest_threshold, noise_factor * sorted[count / 2]);
}

void SceneChange::measure_noise() {
  cv::absdiff(now_, before_, difference_);
  // The median over all blocks: whatever moves covers fewer than half of them.
  std::array<std::size_t, 256> histogram{};
  const bool wide = difference_.depth() == CV_16U;
  const int values = difference_.cols * difference_.channels();
  for (int y = 0; y < difference_.rows; ++y)
    for (int x = 0; x < values; ++x)
      ++histogram[wide ? difference_.ptr<std::uint16_t>(y)[x] >> 8U : difference_.ptr<std::uint8_t>(y)[x]];
  std::size_t below = 0;
  std::size_t median = 0;
  const std::size_t half = static_cast<std::size_t>(difference_.rows) * static_cast<std::size_t>(values) / 2;
  while (median < 255 && below + histogram[median] <= half) below += histogram[median++];
  noise_[noise_count_++ % noise_samples] = sigma_over_median * static_cast<double>(median);
}

}  // namespace eigenpose
