#include "core/image/background.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace eigenpose {
namespace {

using Histogram = std::array<int, 256>;

constexpr int samples_wanted = 4000;

/// Rows apart and columns apart, so that about `samples_wanted` pixels are sampled. Odd, so that periodic
/// patterns do not fall into step.
int sample_step(const cv::Mat& image) {
  const double pixels = static_cast<double>(image.rows) * image.cols;
  const int step = std::max(1, static_cast<int>(std::sqrt(pixels / samples_wanted)));
  return step | 1;
}

/// Sum over five neighbouring levels.
int smooth(const Histogram& histogram, int level) {
  int sum = 0;
  for (int i = std::max(0, level - 2); i <= std::min(255, level + 2); ++i)
    sum += histogram[static_cast<std::size_t>(i)];
  return sum;
}

/// The level of the highest smoothed peak among the darker half of the samples.
int darkest_peak(const Histogram& histogram, int samples) {
  int best = 0;
  int best_count = -1;
  int below = 0;
  for (int level = 0; level < 256 && below <= samples / 2; ++level) {
    below += histogram[static_cast<std::size_t>(level)];
    if (const int count = smooth(histogram, level); count > best_count) {
      best_count = count;
      best = level;
    }
  }
  // A flat top: its middle.
  int last = best;
  while (last < 255 && smooth(histogram, last + 1) == best_count) ++last;
  return (best + last) / 2;
}

/// Sigma of the peak from its darker side, where no object contributes, or from its width where black cuts it
/// off.
double peak_sigma(const Histogram& histogram, int peak) {
  double squares = 0;
  int count = 0;
  for (int level = 0; level <= peak; ++level) {
    const int here = histogram[static_cast<std::size_t>(level)];
    squares += static_cast<double>(here) * (peak - level) * (peak - level);
    count += level == peak ? here / 2 : here;
  }
  const double below = count > 0 ? std::sqrt(squares / count) : 0.0;
  // A Gaussian falls to exp(-1/2) of its height one sigma from its middle.
  const int height = histogram[static_cast<std::size_t>(peak)];
  int upper = peak;
  while (upper < 255 && histogram[static_cast<std::size_t>(upper)] > 0.6065 * height) ++upper;
  return peak >= 3 ? below : static_cast<double>(upper - peak);
}

}  // namespace

Background measure_background(const cv::Mat& image, const SegmentationOptions& options) {
  const int bands = image.channels();
  const int step = sample_step(image);
  std::array<Histogram, 4> histograms{};  // one a band, then the brightest band
  int samples = 0;
  for (int y = step / 2; y < image.rows; y += step) {
    const auto* row = image.ptr<std::uint8_t>(y);
    for (int x = step / 2; x < image.cols; x += step) {
      const std::uint8_t* pixel = row + static_cast<std::ptrdiff_t>(x) * bands;
      std::uint8_t brightest = 0;
      for (int b = 0; b < bands; ++b) {
        ++histograms[static_cast<std::size_t>(b)][pixel[b]];
        brightest = std::max(brightest, pixel[b]);
      }
      ++histograms[3][brightest];
      ++samples;
    }
  }
  Background background;
  for (int b = 0; b < bands; ++b)
    background.level[static_cast<std::size_t>(b)] =
        static_cast<std::uint8_t>(darkest_peak(histograms[static_cast<std::size_t>(b)], samples));
  const int level = darkest_peak(histograms[3], samples);
  background.noise = peak_sigma(histograms[3], level);
  const double contrast = std::max<double>(options.least_contrast, options.noise_sigmas * background.noise);
  background.threshold = std::min(254, static_cast<int>(std::lround(level + contrast)));
  return background;
}

}  // namespace eigenpose
