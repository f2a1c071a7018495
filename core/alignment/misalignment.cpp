#include "core/alignment/misalignment.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/simd/dense_products.h"

namespace eigenpose {
namespace {

/// Where a row of the result is sampled: offset of the texel above left, and how far from it.
struct RowPlaces {
  std::vector<std::int32_t> at;
  std::vector<float> fx;
  std::vector<float> fy;
};

template <int Bands>
void resample_row(const float* in, int side, const RowPlaces& places, float* out) {
  for (int c = 0; c < side; ++c, out += Bands) {
    const auto i = static_cast<std::size_t>(c);
    const float* top = in + static_cast<std::ptrdiff_t>(places.at[i]) * Bands;
    const float* bottom = top + static_cast<std::ptrdiff_t>(side) * Bands;
    for (int b = 0; b < Bands; ++b) {
      const float above = top[b] + places.fx[i] * (top[Bands + b] - top[b]);
      const float below = bottom[b] + places.fx[i] * (bottom[Bands + b] - bottom[b]);
      out[b] = above + places.fy[i] * (below - above);
    }
  }
}

}  // namespace

float undo_misalignment(std::span<const float> appearance, int side, int bands,
                        const Misalignment& misalignment, std::span<float> out) {
  const auto n = static_cast<float>(side);
  const auto enlarge = static_cast<float>(1.0 + misalignment.scale);
  const float cosine = enlarge * static_cast<float>(std::cos(misalignment.rotation));
  const float sine = enlarge * static_cast<float>(std::sin(misalignment.rotation));
  const float middle = 0.5F * (n - 1.0F);
  const float cx = middle + n * static_cast<float>(misalignment.dx);
  const float cy = middle + n * static_cast<float>(misalignment.dy);
  const float last = n - 1.0F;
  const int most = side - 2;
  thread_local RowPlaces places;
  places.at.resize(static_cast<std::size_t>(side));
  places.fx.resize(static_cast<std::size_t>(side));
  places.fy.resize(static_cast<std::size_t>(side));
  for (int r = 0; r < side; ++r) {
    const float v = static_cast<float>(r) - middle;
    for (int c = 0; c < side; ++c) {
      const auto i = static_cast<std::size_t>(c);
      const float u = static_cast<float>(c) - middle;
      const float x = std::min(std::max(cx + cosine * u - sine * v, 0.0F), last);
      const float y = std::min(std::max(cy + sine * u + cosine * v, 0.0F), last);
      const int ix = std::min(static_cast<int>(x), most);
      const int iy = std::min(static_cast<int>(y), most);
      places.fx[i] = x - static_cast<float>(ix);
      places.fy[i] = y - static_cast<float>(iy);
      places.at[i] = iy * side + ix;
    }
    float* row = out.data() + static_cast<std::ptrdiff_t>(r) * side * bands;
    bands == 3 ? resample_row<3>(appearance.data(), side, places, row)
               : resample_row<1>(appearance.data(), side, places, row);
  }
  return std::sqrt(dot(out.data(), out.data(), side * side * bands));
}

}  // namespace eigenpose
