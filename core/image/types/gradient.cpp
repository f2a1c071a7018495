/// Gradient magnitude: edges count, flat areas and slow shading do not.

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/image/types/types.h"

namespace eigenpose::types {
namespace {

/// √(gx² + gy²) of brightness, by central differences; at the picture's edge by the difference inwards.
class Gradient final : public ImageType {
 public:
  explicit Gradient(int size) : grey_(static_cast<std::size_t>(size) * static_cast<std::size_t>(size)) {}

  void make(const PictureView& picture, std::span<float> out) override {
    const auto n = static_cast<std::size_t>(picture.size);
    for (std::size_t i = 0; i < grey_.size(); ++i) grey_[i] = picture.brightness(i);
    for (std::size_t y = 0; y < n; ++y) {
      const std::size_t above = y > 0 ? y - 1 : y;
      const std::size_t below = std::min(y + 1, n - 1);
      const float down = 1.0F / static_cast<float>(below - above);
      for (std::size_t x = 0; x < n; ++x) {
        const std::size_t left = x > 0 ? x - 1 : x;
        const std::size_t right = std::min(x + 1, n - 1);
        const float gx = (grey_[y * n + right] - grey_[y * n + left]) / static_cast<float>(right - left);
        const float gy = (grey_[below * n + x] - grey_[above * n + x]) * down;
        out[y * n + x] = std::sqrt(gx * gx + gy * gy);
      }
    }
  }

 private:
  std::vector<float> grey_;
};

}  // namespace

std::unique_ptr<ImageType> make_gradient(int size) {
  return std::make_unique<Gradient>(size);
}

}  // namespace eigenpose::types
