#include "core/parts/misalignment.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace eigenpose {
namespace {

template <int Bands>
float resample(const float* in, int side, const Misalignment& m, float* out) {
  const auto n = static_cast<float>(side);
  const auto enlarge = static_cast<float>(1.0 + m.scale);
  const float cosine = enlarge * static_cast<float>(std::cos(m.rotation));
  const float sine = enlarge * static_cast<float>(std::sin(m.rotation));
  const float middle = 0.5F * (n - 1.0F);
  const float cx = middle + n * static_cast<float>(m.dx);
  const float cy = middle + n * static_cast<float>(m.dy);
  const float last = n - 1.0F;
  const int most = side - 2;
  float energy = 0.0F;
  for (int r = 0; r < side; ++r) {
    const float v = static_cast<float>(r) - middle;
    for (int c = 0; c < side; ++c, out += Bands) {
      const float u = static_cast<float>(c) - middle;
      const float x = std::clamp(cx + cosine * u - sine * v, 0.0F, last);
      const float y = std::clamp(cy + sine * u + cosine * v, 0.0F, last);
      const int ix = std::min(static_cast<int>(x), most);
      const int iy = std::min(static_cast<int>(y), most);
      const float fx = x - static_cast<float>(ix);
      const float fy = y - static_cast<float>(iy);
      const float* top = in + static_cast<std::ptrdiff_t>(iy * side + ix) * Bands;
      const float* bottom = top + static_cast<std::ptrdiff_t>(side) * Bands;
      for (int b = 0; b < Bands; ++b) {
        const float above = top[b] + fx * (top[Bands + b] - top[b]);
        const float below = bottom[b] + fx * (bottom[Bands + b] - bottom[b]);
        out[b] = above + fy * (below - above);
        energy += out[b] * out[b];
      }
    }
  }
  return std::sqrt(energy);
}

}  // namespace

float undo_misalignment(std::span<const float> appearance, int side, int bands,
                        const Misalignment& misalignment, std::span<float> out) {
  return bands == 3 ? resample<3>(appearance.data(), side, misalignment, out.data())
                    : resample<1>(appearance.data(), side, misalignment, out.data());
}

}  // namespace eigenpose
