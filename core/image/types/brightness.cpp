/// The picture as it is: grey, colour or range.

#include <algorithm>

#include "core/image/types/types.h"

namespace eigenpose::types {
namespace {

class Brightness final : public ImageType {
 public:
  void make(const PictureView& picture, std::span<float> out) override {
    std::copy(picture.pixels.begin(), picture.pixels.end(), out.begin());
  }
};

}  // namespace

std::unique_ptr<ImageType> make_brightness(int /*size*/) {
  return std::make_unique<Brightness>();
}

}  // namespace eigenpose::types
