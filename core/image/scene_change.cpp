#include "core/image/scene_change.h"

#include <algorithm>
#include <cmath>
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
/// A block of fewer grey levels does not show flicker: ±2 % of 24 is half a level.
constexpr double bright = 24.0;
/// Of fewer blocks no median is taken.
constexpr std::size_t least_bright_values = 16;
/// A lamp on the mains flickers by ±10 % at most (LEDs without a converter are no light to see by): a ratio
/// of 1.1 / 0.9 between the extremes. Beyond it the light was changed.
constexpr double largest_gain = 1.25;
constexpr double largest_share = 0.5;  ///< of the brightness of a block that the threshold may reach

template <typename Value, typename Visit>
bool visit_all(const cv::Mat& now, const cv::Mat& then, double scale, Visit visit) {
  const int values = now.cols * now.channels();
  for (int y = 0; y < now.rows; ++y) {
    const auto* a = now.ptr<Value>(y);
    const auto* b = then.ptr<Value>(y);
    for (int i = 0; i < values; ++i)
      if (!visit(scale * a[i], scale * b[i])) return false;
  }
  return true;
}

/// Calls `visit` with every value of both and its counterpart, in grey levels of 255 whatever the depth,
/// until it returns false. @return false then.
template <typename Visit>
bool visit_pairs(const cv::Mat& now, const cv::Mat& then, Visit visit) {
  return now.depth() == CV_16U ? visit_all<std::uint16_t>(now, then, 1.0 / 257.0, visit)
                               : visit_all<std::uint8_t>(now, then, 1.0, visit);
}

/// The median of many values in [lower, upper], to within a bin; values outside count at the ends.
template <std::size_t Bins>
class Median {
 public:
  Median(double lower, double upper)
      : lower_(lower), step_((upper - lower) / static_cast<double>(Bins - 1)) {}
  void add(double value) {
    const double bin = std::clamp((value - lower_) / step_ + 0.5, 0.0, static_cast<double>(Bins - 1));
    ++histogram_[static_cast<std::size_t>(bin)];
    ++count_;
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] double value() const {
    std::size_t below = 0;
    std::size_t bin = 0;
    while (bin + 1 < Bins && below + histogram_[bin] <= count_ / 2) below += histogram_[bin++];
    return lower_ + static_cast<double>(bin) * step_;
  }

 private:
  double lower_;
  double step_;
  std::size_t count_ = 0;
  std::array<std::uint32_t, Bins> histogram_{};
};

/// The median of the first `count` values of a ring.
template <std::size_t Size>
double median_of(std::array<double, Size> ring, std::size_t count) {
  count = std::min(count, Size);
  const auto middle = ring.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(ring.begin(), middle, ring.begin() + static_cast<std::ptrdiff_t>(count));
  return *middle;
}

/// How far `value` lies from what `reference` may have become under `gain`: anything from none of it to all.
double beyond(double value, double reference, double gain) {
  const auto [low, high] = std::minmax({reference, gain * reference});
  return std::max({low - value, value - high, 0.0});
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
    begin(frame);
    return {};
  }
  measure_noise();
  const double gain_to_anchor = gain(anchor_);
  if (differs(anchor_, gain_to_anchor)) {
    now_.copyTo(anchor_);
    still_since_ = frame.exposure_start;
    gain_count_ = 0;
  } else {
    gains_[gain_count_++ % gain_samples] = gain_to_anchor;
  }
  Observation seen;
  seen.settled = frame.exposure_start - still_since_ >= options_.settle;
  seen.changed = accepted_.empty() || differs(accepted_, gain(accepted_));
  return seen;
}

void SceneChange::begin(const Frame& frame) {
  const cv::Mat first = now_;
  reset();
  now_ = first;
  now_.copyTo(before_);
  now_.copyTo(anchor_);
  still_since_ = frame.exposure_start;
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
  gain_count_ = 0;
}

double SceneChange::threshold() const {
  if (options_.threshold) return *options_.threshold;
  if (noise_count_ == 0) return options_.smallest_threshold;
  // The median over several pairs of frames: a lamp switched on once is no noise.
  return std::max(options_.smallest_threshold, noise_factor * median_of(noise_, noise_count_));
}

double SceneChange::flicker() const {
  constexpr std::size_t least = 10;
  const std::size_t count = std::min(gain_count_, gain_samples);
  if (count < least) return 0.0;
  const auto [low, high] =
      std::minmax_element(gains_.begin(), gains_.begin() + static_cast<std::ptrdiff_t>(count));
  return (*high - *low) / (*high + *low);
}

double SceneChange::gain(const cv::Mat& reference) const {
  // 0.5…1.5 in steps of 1/1024: the ratio 1 is one of them.
  Median<1025> ratios(0.5, 1.5);
  visit_pairs(now_, reference, [&](double value, double before) {
    if (std::min(value, before) >= bright) ratios.add(value / before);
    return true;
  });
  if (ratios.count() < least_bright_values) return 1.0;
  const double median = ratios.value();
  return median <= largest_gain && median >= 1.0 / largest_gain ? median : 1.0;
}

bool SceneChange::differs(const cv::Mat& reference, double gain) const {
  const double dark = threshold();
  const bool measured = !options_.threshold && noise_count_ > 0;
  const double share =
      measured ? std::min(largest_share, noise_factor * median_of(relative_noise_, noise_count_)) : 0.0;
  return !visit_pairs(now_, reference, [&](double value, double before) {
    return beyond(value, before, gain) <= std::max(dark, share * std::min(value, before));
  });
}

void SceneChange::measure_noise() {
  // Medians over all blocks: what moves covers fewer than half of them.
  const double common = gain(before_);
  Median<256> absolute(0.0, 255.0);
  Median<1025> relative(0.0, 1.0);
  visit_pairs(now_, before_, [&](double value, double before) {
    const double difference = std::abs(value - common * before);
    absolute.add(difference);
    // One level is rounding, not noise.
    if (std::min(value, before) >= bright) relative.add(std::max(0.0, difference - 1.0) / before);
    return true;
  });
  const std::size_t slot = noise_count_++ % noise_samples;
  noise_.at(slot) = sigma_over_median * absolute.value();
  relative_noise_.at(slot) =
      relative.count() < least_bright_values ? 0.0 : sigma_over_median * relative.value();
}

}  // namespace eigenpose
