#include "core/color/chromaticity.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

namespace eigenpose {
namespace {

constexpr float spread = 0.3F;   // of the opponent differences, as a share of the brightness
constexpr float dark = 8.0F;     // a brightness of noise, 0…255
constexpr std::size_t bins = 8;  // each way
constexpr int common_side = 64;  // pixels that pictures of every size are brought to

std::uint8_t rounded(float value) {
  return static_cast<std::uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F));
}

void resize_to(int side, const cv::Mat& picture, cv::Mat& small) {
  cv::resize(picture, small, {side, side}, 0.0, 0.0, cv::INTER_AREA);
}

/// Where a value 0…255 lies among the middles of the bins: the bin below, and the share of the next.
struct BetweenBins {
  std::size_t bin = 0;
  float next = 0.0F;
};

BetweenBins between_bins(std::uint8_t value) {
  const float at =
      std::clamp(static_cast<float>(value) * (static_cast<float>(bins) / 255.0F) - 0.5F, 0.0F, bins - 1.0F);
  const std::size_t bin = std::min(static_cast<std::size_t>(at), bins - 2);
  return {bin, at - static_cast<float>(bin)};
}

}  // namespace

ChromaticityMap chromaticity_map(const cv::Mat& picture, const std::array<float, 3>& background) {
  std::array<std::uint8_t, ChromaticityMap::bytes> pixels{};
  cv::Mat small(ChromaticityMap::side, ChromaticityMap::side, CV_8UC3, pixels.data());  // no memory is taken
  cv::Mat common;
  if (picture.rows == common_side)
    common = picture;
  else
    resize_to(common_side, picture, common);
  resize_to(ChromaticityMap::side, common, small);
  std::array<float, 3> level{};
  for (std::size_t b = 0; b < 3; ++b) level[b] = 255.0F * background[b] * background[b];
  ChromaticityMap map;
  for (std::size_t i = 0; i < ChromaticityMap::pixels; ++i) {
    const std::uint8_t* bgr = pixels.data() + 3 * i;
    const auto above = [&](std::size_t b) { return std::max(0.0F, static_cast<float>(bgr[b]) - level[b]); };
    const float blue = above(0);
    const float green = above(1);
    const float red = above(2);
    const float brightness = (red + green + blue) / 3.0F;
    const float scale = spread * (brightness + dark);
    const auto relative = [scale](float d) { return rounded(127.5F + 127.5F * d / (std::abs(d) + scale)); };
    map.u[i] = relative(red - green);
    map.v[i] = relative(0.5F * (red + green) - blue);
    map.brightness[i] = rounded(brightness);
  }
  return map;
}

ChromaticityRoots chromaticity_roots(const ChromaticityMap& map, std::span<const float> visible) {
  ChromaticityRoots roots{};
  float sum = 0.0F;
  for (std::size_t i = 0; i < ChromaticityMap::pixels; ++i) {
    const float weight = static_cast<float>(map.brightness[i]) * (visible.empty() ? 1.0F : visible[i]);
    const auto [u, next_u] = between_bins(map.u[i]);
    const auto [v, next_v] = between_bins(map.v[i]);
    float* at = roots.data() + u * bins + v;
    at[0] += weight * (1.0F - next_u) * (1.0F - next_v);
    at[1] += weight * (1.0F - next_u) * next_v;
    at[bins] += weight * next_u * (1.0F - next_v);
    at[bins + 1] += weight * next_u * next_v;
    sum += weight;
  }
  if (sum > 0.0F)
    for (float& root : roots) root = std::sqrt(root / sum);
  return roots;
}

double hellinger_distance(const ChromaticityRoots& a, const ChromaticityRoots& b) {
  float common = 0.0F;
  float squared = 0.0F;
  for (std::size_t i = 0; i < a.size(); ++i) {
    common += a[i] * b[i];
    squared += (a[i] - b[i]) * (a[i] - b[i]);
  }
  return common > 0.0F ? std::sqrt(0.5 * static_cast<double>(squared)) : 1.0;
}

}  // namespace eigenpose
