/// Opponent colours.

#include "core/image/types/types.h"

namespace eigenpose::types {
namespace {

/// What the neighbours of a learned view do not predict of it is smaller in the two opponent axes than in
/// brightness: on 50 objects of turntable photographs, by 2.5 to 3.3 times (standard deviations, views 20° to
/// 90° apart). With this weight it is about equal in all three, so that distances count a colour as what it
/// says of the object.
constexpr float opponent_weight = 3.0F;

/// An orthonormal basis of (blue, green, red), but for the weight: brightness, red against green, and blue
/// against both.
class Opponent final : public ImageType {
 public:
  void make(const PictureView& picture, std::span<float> out) override {
    constexpr float brightness = 0.57735027F;                     // 1/√3
    constexpr float red_green = opponent_weight * 0.70710678F;    // 1/√2
    constexpr float blue_yellow = opponent_weight * 0.40824829F;  // 1/√6
    const float* in = picture.pixels.data();
    float* to = out.data();
    for (std::size_t i = 0; i < out.size(); i += 3) {
      const float blue = in[i];
      const float green = in[i + 1];
      const float red = in[i + 2];
      to[i] = brightness * (blue + green + red);
      to[i + 1] = red_green * (red - green);
      to[i + 2] = blue_yellow * (2.0F * blue - red - green);
    }
  }
};

}  // namespace

std::unique_ptr<ImageType> make_opponent(int /*size*/) {
  return std::make_unique<Opponent>();
}

}  // namespace eigenpose::types
