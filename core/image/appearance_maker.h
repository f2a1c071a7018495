#pragma once

/// From a normalised picture to the appearance that is compared.

#include <memory>
#include <span>
#include <vector>

#include "core/image/image_type.h"
#include "core/image/normalization.h"

namespace eigenpose {

/// Makes appearances of the image type that the options name. Holds scratch memory: one thread at a time;
/// allocates nothing after construction (the Fourier transform apart, which OpenCV does).
class AppearanceMaker {
 public:
  /// @throws std::invalid_argument for an unknown image type.
  explicit AppearanceMaker(const NormalizationOptions& options);

  /// The appearance is the picture itself: nothing needs to be made.
  [[nodiscard]] bool is_picture() const { return parts_.empty(); }

  /// @param picture picture_length(options) components. @param appearance appearance_length(options) ones.
  /// @return its energy ‖appearance‖; 0 where nothing is to be seen.
  float make(std::span<const float> picture, std::span<float> appearance);

 private:
  struct Part {
    std::unique_ptr<ImageType> type;
    std::size_t bands = 1;
    float weight = 1.0F;  ///< of its unit-energy components
  };
  int size_ = 0;
  int picture_bands_ = 1;
  std::vector<Part> parts_;
  std::size_t bands_ = 0;
  std::vector<float> numbers_;  ///< of one part, where there are several
};

}  // namespace eigenpose
