/// Opponent colours.

#include "core/image/types/types.h"
#include "core/simd/pixel_arithmetic.h"

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
    to_opponent_axes(picture.pixels.data(), out.size() / 3, opponent_weight, out.data());
  }
};

}  // namespace

std::unique_ptr<ImageType> make_opponent(int /*size*/) {
  return std::make_unique<Opponent>();
}

}  // namespace eigenpose::types
