#include "core/windows/orientation_grid.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "core/base/statistics.h"

namespace eigenpose {
namespace {

/// Root of a byte's brightness, 0…1.
const std::array<float, 256>& root_table() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> roots{};
    for (std::size_t i = 0; i < roots.size(); ++i) {
      roots[i] = std::sqrt(static_cast<float>(i) / 255.0F);
    }
    return roots;
  }();
  return table;
}

/// Share of a pixel that belongs to the first of the two cells it lies between, and that cell's index. The
/// triangle [1 3 5 7 7 5 3 1]/32 stands symmetrically on each cell, so that the map of a mirrored picture is
/// the mirrored map.
struct Share {
  int first = 0;
  float weight = 0.0F;
};

const std::array<Share, OrientationGrid::pixels>& shares() {
  static const std::array<Share, OrientationGrid::pixels> table = [] {
    std::array<Share, OrientationGrid::pixels> made{};
    for (int p = 0; p < OrientationGrid::pixels; ++p) {
      const float position = (static_cast<float>(p) + 0.5F) / OrientationGrid::cell - 0.5F;
      const float first = std::floor(position);
      made[static_cast<std::size_t>(p)] = {static_cast<int>(first), 1.0F - (position - first)};
    }
    return made;
  }();
  return table;
}

/// Orientation of (x, y) in bins, 0…8: atan2 with an error below 0.004 bins. Without branches, so that
/// neighbouring pixels are done together.
inline float orientation_in_bins(float x, float y) {
  const float ax = std::fabs(x);
  const float ay = std::fabs(y);
  const float larger = ax > ay ? ax : ay;
  const float smaller = ax > ay ? ay : ax;
  const float ratio = smaller / (larger > 1e-12F ? larger : 1e-12F);
  const float square = ratio * ratio;
  constexpr auto pi = std::numbers::pi_v<float>;
  float angle = ((-0.0464964749F * square + 0.15931422F) * square - 0.327622764F) * square * ratio + ratio;
  angle = ay > ax ? 0.5F * pi - angle : angle;
  angle = x < 0.0F ? pi - angle : angle;
  angle = y < 0.0F ? 2.0F * pi - angle : angle;
  return angle * (static_cast<float>(OrientationGrid::bins) / (2.0F * pi));
}

/// A row of gradients: of the strongest band, as orientation and magnitude.
struct GradientRow {
  std::array<float, OrientationGrid::pixels> place{};      ///< orientation in bins, 0…8
  std::array<float, OrientationGrid::pixels> magnitude{};  ///< of the Sobel gradient, /8
};

/// @param above, here, below rows of root brightness that begin one pixel before the first, borders repeated.
template <int Bands>
void find_gradients(const float* above, const float* here, const float* below, GradientRow& row) {
  for (std::size_t c = 0; c < OrientationGrid::pixels; ++c) {
    const std::size_t left = c * Bands;
    float gx = 0.0F;
    float gy = 0.0F;
    float strongest = -1.0F;
    for (std::size_t b = 0; b < Bands; ++b) {
      const std::size_t l = left + b;
      const std::size_t m = l + Bands;
      const std::size_t r = m + Bands;
      const float x = (above[r] - above[l] + 2.0F * (here[r] - here[l]) + below[r] - below[l]) * 0.125F;
      const float y = (below[l] - above[l] + 2.0F * (below[m] - above[m]) + below[r] - above[r]) * 0.125F;
      const float squared = x * x + y * y;
      const bool stronger = squared > strongest;
      gx = stronger ? x : gx;
      gy = stronger ? y : gy;
      strongest = stronger ? squared : strongest;
    }
    row.place[c] = orientation_in_bins(gx, gy);
    row.magnitude[c] = strongest;
  }
  for (float& magnitude : row.magnitude) magnitude = std::sqrt(magnitude);
}

/// One row of pixels between the columns of cells; the first and the last place lie outside.
template <int Bands>
struct RowSums {
  static constexpr std::size_t places = OrientationGrid::cells + 2;
  std::array<float, places * OrientationGrid::bins> orientation{};
  std::array<float, places * Bands> brightness{};
};

template <int Bands>
void fill(const std::vector<float>& root, OrientationGrid& map) {
  constexpr int n = OrientationGrid::pixels;
  constexpr std::size_t bins = OrientationGrid::bins;
  constexpr std::size_t cells = OrientationGrid::cells;
  constexpr std::ptrdiff_t stride = std::ptrdiff_t{n + 2} * Bands;
  // Pixels outside have no share in a cell; a cell weight sums to 1 over its 8×8 pixels.
  constexpr float norm = 1.0F / (OrientationGrid::cell * OrientationGrid::cell);
  const auto& share = shares();
  GradientRow gradients;
  for (int r = 0; r < n; ++r) {
    const float* here = root.data() + r * stride;
    find_gradients<Bands>(root.data() + std::max(r - 1, 0) * stride, here,
                          root.data() + std::min(r + 1, n - 1) * stride, gradients);
    RowSums<Bands> sums;
    for (std::size_t c = 0; c < n; ++c) {
      const auto cell = static_cast<std::size_t>(share[c].first + 1);
      const float near = share[c].weight * norm;
      const float far = (1.0F - share[c].weight) * norm;
      const int whole = static_cast<int>(gradients.place[c]);
      const float part = gradients.place[c] - static_cast<float>(whole);
      const auto bin = static_cast<std::size_t>(whole) & (bins - 1);
      const auto next = (bin + 1) & (bins - 1);
      const float second = gradients.magnitude[c] * part;
      const float first = gradients.magnitude[c] - second;
      float* orientation = sums.orientation.data() + cell * bins;
      orientation[bin] += near * first;
      orientation[next] += near * second;
      orientation[bins + bin] += far * first;
      orientation[bins + next] += far * second;
      for (std::size_t b = 0; b < Bands; ++b) {
        const float level = here[(c + 1) * Bands + b];
        sums.brightness[cell * Bands + b] += near * level;
        sums.brightness[(cell + 1) * Bands + b] += far * level;
      }
    }
    const Share row = share[static_cast<std::size_t>(r)];
    for (const auto& [cell_row, weight] :
         {std::pair(row.first, row.weight), {row.first + 1, 1.0F - row.weight}}) {
      if (cell_row < 0 || cell_row >= OrientationGrid::cells) continue;
      const auto at = static_cast<std::size_t>((cell_row + OrientationGrid::pad) * OrientationGrid::side +
                                               OrientationGrid::pad);
      for (std::size_t i = 0; i < cells * bins; ++i)
        map.orientation[at * bins + i] += weight * sums.orientation[bins + i];
      for (std::size_t i = 0; i < cells * Bands; ++i)
        map.brightness[at * Bands + i] += weight * sums.brightness[Bands + i];
    }
  }
}

}  // namespace

void OrientationGridMaker::compute(const cv::Mat& picture, OrientationGrid& map) {
  if ((picture.type() != CV_8UC1 && picture.type() != CV_8UC3) || picture.rows != picture.cols ||
      picture.empty()) {
    throw std::invalid_argument("a cell map is made of a square 8-bit picture of 1 or 3 bands, not of " +
                                std::to_string(picture.cols) + "×" + std::to_string(picture.rows) +
                                " of OpenCV type " + std::to_string(picture.type()));
  }
  const cv::Mat* source = &picture;
  if (picture.rows != OrientationGrid::pixels) {
    cv::resize(picture, resized_, cv::Size(OrientationGrid::pixels, OrientationGrid::pixels), 0.0, 0.0,
               cv::INTER_AREA);
    source = &resized_;
  }
  const int bands = source->channels();
  // One pixel more on either side, which repeats the border.
  const auto band_count = static_cast<std::size_t>(bands);
  const std::size_t row_length = OrientationGrid::pixels * band_count;
  root_.resize((row_length + 2 * band_count) * OrientationGrid::pixels);
  const auto& table = root_table();
  for (int r = 0; r < OrientationGrid::pixels; ++r) {
    const std::uint8_t* bytes = source->ptr<std::uint8_t>(r);
    float* out = root_.data() + static_cast<std::size_t>(r) * (row_length + 2 * band_count) + band_count;
    for (std::size_t i = 0; i < row_length; ++i) {
      out[i] = table[bytes[i]];
    }
    std::copy_n(out, band_count, out - band_count);
    std::copy_n(out + row_length - band_count, band_count, out + row_length);
  }
  constexpr auto places = static_cast<std::size_t>(OrientationGrid::side) * OrientationGrid::side;
  map.bands = bands;
  map.orientation.assign(places * OrientationGrid::bins, 0.0F);
  map.brightness.assign(places * static_cast<std::size_t>(bands), 0.0F);
  if (bands == 1) {
    fill<1>(root_, map);
  } else {
    fill<3>(root_, map);
  }
  take_off(background_, map);
}

void take_off(const std::array<float, 3>& background, OrientationGrid& map) {
  for (int r = OrientationGrid::pad; r < OrientationGrid::pad + OrientationGrid::cells; ++r) {
    for (int c = OrientationGrid::pad; c < OrientationGrid::pad + OrientationGrid::cells; ++c) {
      float* values =
          map.brightness.data() + static_cast<std::size_t>((r * OrientationGrid::side + c) * map.bands);
      for (int b = 0; b < map.bands; ++b) {
        values[b] = std::max(0.0F, values[b] - background[static_cast<std::size_t>(b)]);
      }
    }
  }
}

std::array<float, 3> background_level(const std::vector<OrientationGrid>& maps) {
  std::array<float, 3> level{};
  if (maps.empty()) {
    return level;
  }
  constexpr int first = OrientationGrid::pad;
  constexpr int last = OrientationGrid::pad + OrientationGrid::cells - 1;
  for (int b = 0; b < maps.front().bands; ++b) {
    std::vector<float> corners;
    corners.reserve(maps.size() * 4);
    for (const OrientationGrid& map : maps) {
      for (const int r : {first, last}) {
        for (const int c : {first, last}) {
          corners.push_back(map.brightness_at(r, c)[b]);
        }
      }
    }
    level[static_cast<std::size_t>(b)] = upper_median(corners);
  }
  return level;
}

}  // namespace eigenpose
