#include "core/image/appearance_maker.h"

#include <algorithm>
#include <cmath>

#include "core/simd/pixel_arithmetic.h"

namespace eigenpose {
namespace {

float energy_of(std::span<const float> numbers) {
  return std::sqrt(sum_of_squares(numbers.data(), numbers.size()));
}

}  // namespace

AppearanceMaker::AppearanceMaker(const NormalizationOptions& options)
    : size_(options.size), picture_bands_(picture_bands(options)) {
  if (appearance_is_picture(options)) return;
  const auto pixels = static_cast<std::size_t>(size_) * static_cast<std::size_t>(size_);
  std::size_t most = 0;
  for (const ImageTypeSum::Part& part : parse_image_type(image_type_name(options)).parts) {
    const auto bands = static_cast<std::size_t>(part.row->bands);
    parts_.push_back({part.row->make(size_), bands, static_cast<float>(std::sqrt(part.weight))});
    bands_ += bands;
    most = std::max(most, bands);
  }
  if (parts_.size() > 1) numbers_.resize(pixels * most);
}

float AppearanceMaker::make(std::span<const float> picture, std::span<float> appearance) {
  const PictureView view{picture, size_, picture_bands_};
  if (parts_.empty()) {
    std::copy(picture.begin(), picture.end(), appearance.begin());
    return energy_of(appearance);
  }
  if (parts_.size() == 1) {
    parts_.front().type->make(view, appearance);
    return energy_of(appearance);
  }
  const std::size_t pixels = appearance.size() / bands_;
  std::size_t band = 0;
  for (Part& part : parts_) {
    const std::span<float> numbers(numbers_.data(), pixels * part.bands);
    part.type->make(view, numbers);
    const float energy = energy_of(numbers);
    const float gain = energy > 0.0F ? part.weight / energy : 0.0F;
    for (std::size_t i = 0; i < pixels; ++i)
      for (std::size_t b = 0; b < part.bands; ++b)
        appearance[i * bands_ + band + b] = gain * numbers[i * part.bands + b];
    band += part.bands;
  }
  return energy_of(appearance);
}

}  // namespace eigenpose
