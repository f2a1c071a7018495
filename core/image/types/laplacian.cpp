/// Laplacian: what a pixel has more or less than its neighbours. Signed; 0 on planes of brightness.

#include <vector>

#include "core/image/types/types.h"

namespace eigenpose::types {
namespace {

/// The sum of the second differences in x and y of brightness. Beyond the edge the picture goes on straight:
/// there the second difference across it is 0.
class Laplacian final : public ImageType {
 public:
  explicit Laplacian(int size) : grey_(static_cast<std::size_t>(size) * static_cast<std::size_t>(size)) {}

  void make(const PictureView& picture, std::span<float> out) override {
    const auto n = static_cast<std::size_t>(picture.size);
    for (std::size_t i = 0; i < grey_.size(); ++i) grey_[i] = picture.brightness(i);
    for (std::size_t y = 0; y < n; ++y)
      for (std::size_t x = 0; x < n; ++x) {
        const std::size_t i = y * n + x;
        float sum = 0.0F;
        if (x > 0 && x + 1 < n) sum += grey_[i - 1] - 2.0F * grey_[i] + grey_[i + 1];
        if (y > 0 && y + 1 < n) sum += grey_[i - n] - 2.0F * grey_[i] + grey_[i + n];
        out[i] = sum;
      }
  }

 private:
  std::vector<float> grey_;
};

}  // namespace

std::unique_ptr<ImageType> make_laplacian(int size) {
  return std::make_unique<Laplacian>(size);
}

}  // namespace eigenpose::types
