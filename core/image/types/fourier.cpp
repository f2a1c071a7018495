/// Fourier magnitude: what is in the picture, not where.

#include <cmath>
#include <vector>

#include <opencv2/core.hpp>

#include "core/image/types/types.h"

namespace eigenpose::types {
namespace {

/// √|F(u, v)| of brightness, the zero frequency in the middle. The root keeps the few lowest frequencies from
/// drowning all others. Shifting the picture around its edges changes nothing.
class Fourier final : public ImageType {
 public:
  explicit Fourier(int size) : grey_(size, size, CV_32FC1), spectrum_(size, size, CV_32FC2) {}

  void make(const PictureView& picture, std::span<float> out) override {
    const int n = picture.size;
    auto* grey = grey_.ptr<float>();
    for (std::size_t i = 0; i < grey_.total(); ++i) grey[i] = picture.brightness(i);
    cv::dft(grey_, spectrum_, cv::DFT_COMPLEX_OUTPUT);
    for (int v = 0; v < n; ++v) {
      const auto* row = spectrum_.ptr<cv::Vec2f>(v);
      float* to = out.data() + static_cast<std::ptrdiff_t>((v + n / 2) % n) * n;
      for (int u = 0; u < n; ++u)
        to[(u + n / 2) % n] = std::sqrt(std::sqrt(row[u][0] * row[u][0] + row[u][1] * row[u][1]));
    }
  }

 private:
  cv::Mat grey_;
  cv::Mat spectrum_;
};

}  // namespace

std::unique_ptr<ImageType> make_fourier(int size) {
  return std::make_unique<Fourier>(size);
}

}  // namespace eigenpose::types
