#include "core/parts/cell_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include <opencv2/imgproc.hpp>

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

const std::array<Share, CellMap::pixels>& shares() {
  static const std::array<Share, CellMap::pixels> table = [] {
    std::array<Share, CellMap::pixels> made{};
    for (int p = 0; p < CellMap::pixels; ++p) {
      const float position = (static_cast<float>(p) + 0.5F) / CellMap::cell - 0.5F;
      const float first = std::floor(position);
      made[static_cast<std::size_t>(p)] = {static_cast<int>(first), 1.0F - (position - first)};
    }
    return made;
  }();
  return table;
}

/// Orientation of (x, y) in bins, 0…8: atan2 with an error below 0.004 bins.
inline float orientation_in_bins(float x, float y) {
  const float ax = std::fabs(x);
  const float ay = std::fabs(y);
  const float ratio = std::min(ax, ay) / std::max(std::max(ax, ay), 1e-12F);
  const float square = ratio * ratio;
  float angle = ((-0.0464964749F * square + 0.15931422F) * square - 0.327622764F) * square * ratio + ratio;
  constexpr auto pi = std::numbers::pi_v<float>;
  if (ay > ax) {
    angle = 0.5F * pi - angle;
  }
  if (x < 0.0F) {
    angle = pi - angle;
  }
  if (y < 0.0F) {
    angle = 2.0F * pi - angle;
  }
  return angle * (static_cast<float>(CellMap::bins) / (2.0F * pi));
}

/// Sobel gradient of the strongest band, /8, borders repeated.
template <int Bands>
inline void strongest_gradient(const float* above, const float* here, const float* below, int left,
                               int middle, int right, float& gx, float& gy) {
  float strongest = -1.0F;
  for (int b = 0; b < Bands; ++b) {
    const float al = above[left * Bands + b];
    const float ar = above[right * Bands + b];
    const float bl = below[left * Bands + b];
    const float br = below[right * Bands + b];
    const float x = (ar - al + 2.0F * (here[right * Bands + b] - here[left * Bands + b]) + br - bl) * 0.125F;
    const float y =
        (bl - al + 2.0F * (below[middle * Bands + b] - above[middle * Bands + b]) + br - ar) * 0.125F;
    const float magnitude = x * x + y * y;
    if (magnitude > strongest) {
      strongest = magnitude;
      gx = x;
      gy = y;
    }
  }
}

template <int Bands>
void fill(const std::vector<float>& root, CellMap& map) {
  constexpr int n = CellMap::pixels;
  constexpr int bins = CellMap::bins;
  // Pixels outside have no share in a cell; a cell weight sums to 1 over its 8×8 pixels.
  constexpr float norm = 1.0F / (CellMap::cell * CellMap::cell);
  const auto& share = shares();
  for (int r = 0; r < n; ++r) {
    const float* above = root.data() + static_cast<std::ptrdiff_t>(std::max(r - 1, 0)) * n * Bands;
    const float* here = root.data() + static_cast<std::ptrdiff_t>(r) * n * Bands;
    const float* below = root.data() + static_cast<std::ptrdiff_t>(std::min(r + 1, n - 1)) * n * Bands;
    const Share row = share[static_cast<std::size_t>(r)];
    for (int c = 0; c < n; ++c) {
      float gx = 0.0F;
      float gy = 0.0F;
      strongest_gradient<Bands>(above, here, below, std::max(c - 1, 0), c, std::min(c + 1, n - 1), gx, gy);
      const float magnitude = std::sqrt(gx * gx + gy * gy) * norm;
      const Share column = share[static_cast<std::size_t>(c)];
      const bool lit = magnitude > 0.0F;
      const float place = lit ? orientation_in_bins(gx, gy) : 0.0F;
      const int whole = static_cast<int>(place);
      const float part = place - static_cast<float>(whole);
      const int bin = whole & (bins - 1);
      const int next = (bin + 1) & (bins - 1);
      for (int i = 0; i < 2; ++i) {
        const float row_weight = i == 0 ? row.weight : 1.0F - row.weight;
        for (int j = 0; j < 2; ++j) {
          const int cell_row = row.first + i;
          const int cell_column = column.first + j;
          if (cell_row < 0 || cell_row >= CellMap::cells || cell_column < 0 ||
              cell_column >= CellMap::cells) {
            continue;
          }
          const float weight = row_weight * (j == 0 ? column.weight : 1.0F - column.weight);
          const auto at = static_cast<std::size_t>((cell_row + CellMap::pad) * CellMap::side + cell_column +
                                                   CellMap::pad);
          if (lit) {
            map.orientation[at * bins + static_cast<std::size_t>(bin)] += weight * magnitude * (1.0F - part);
            map.orientation[at * bins + static_cast<std::size_t>(next)] += weight * magnitude * part;
          }
          for (int b = 0; b < Bands; ++b) {
            map.brightness[at * Bands + static_cast<std::size_t>(b)] += weight * norm * here[c * Bands + b];
          }
        }
      }
    }
  }
}

}  // namespace

void CellMapper::compute(const cv::Mat& picture, CellMap& map) {
  if ((picture.type() != CV_8UC1 && picture.type() != CV_8UC3) || picture.rows != picture.cols ||
      picture.empty()) {
    throw std::invalid_argument("a cell map is made of a square 8-bit picture of 1 or 3 bands, not of " +
                                std::to_string(picture.cols) + "×" + std::to_string(picture.rows) +
                                " of OpenCV type " + std::to_string(picture.type()));
  }
  const cv::Mat* source = &picture;
  if (picture.rows != CellMap::pixels) {
    cv::resize(picture, resized_, cv::Size(CellMap::pixels, CellMap::pixels), 0.0, 0.0, cv::INTER_AREA);
    source = &resized_;
  }
  const int bands = source->channels();
  const std::size_t row_length = static_cast<std::size_t>(CellMap::pixels) * static_cast<std::size_t>(bands);
  root_.resize(row_length * CellMap::pixels);
  const auto& table = root_table();
  for (int r = 0; r < CellMap::pixels; ++r) {
    const std::uint8_t* bytes = source->ptr<std::uint8_t>(r);
    float* out = root_.data() + static_cast<std::size_t>(r) * row_length;
    for (std::size_t i = 0; i < row_length; ++i) {
      out[i] = table[bytes[i]];
    }
  }
  constexpr auto places = static_cast<std::size_t>(CellMap::side) * CellMap::side;
  map.bands = bands;
  map.orientation.assign(places * CellMap::bins, 0.0F);
  map.brightness.assign(places * static_cast<std::size_t>(bands), 0.0F);
  if (bands == 1) {
    fill<1>(root_, map);
  } else {
    fill<3>(root_, map);
  }
  for (int r = CellMap::pad; r < CellMap::pad + CellMap::cells; ++r) {
    for (int c = CellMap::pad; c < CellMap::pad + CellMap::cells; ++c) {
      float* values = map.brightness.data() + static_cast<std::size_t>((r * CellMap::side + c) * bands);
      for (int b = 0; b < bands; ++b) {
        values[b] = std::max(0.0F, values[b] - background_[static_cast<std::size_t>(b)]);
      }
    }
  }
}

std::array<float, 3> background_level(const std::vector<CellMap>& maps) {
  std::array<float, 3> level{};
  if (maps.empty()) {
    return level;
  }
  constexpr int first = CellMap::pad;
  constexpr int last = CellMap::pad + CellMap::cells - 1;
  for (int b = 0; b < maps.front().bands; ++b) {
    std::vector<float> corners;
    corners.reserve(maps.size() * 4);
    for (const CellMap& map : maps) {
      for (const int r : {first, last}) {
        for (const int c : {first, last}) {
          corners.push_back(map.brightness_at(r, c)[b]);
        }
      }
    }
    const auto middle = corners.begin() + static_cast<std::ptrdiff_t>(corners.size() / 2);
    std::nth_element(corners.begin(), middle, corners.end());
    level[static_cast<std::size_t>(b)] = *middle;
  }
  return level;
}

}  // namespace eigenpose
