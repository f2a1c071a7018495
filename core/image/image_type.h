#pragma once

/// Image types: what of a normalised picture is compared. Grey or colour brightness, gradient magnitude,
/// Laplacian, Fourier magnitude, range; and sums of them.
///
/// A new type is one file in types/ with an `ImageType`, and one row in the table of image_type.cpp. The name
/// of a type is part of the model, so learning and watching use the same.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace eigenpose {

/// A normalised picture: size × size pixels, bands of a pixel together, background 0.
struct PictureView {
  std::span<const float> pixels;
  int size = 0;
  int bands = 1;  ///< 3: blue, green, red

  /// Its brightness at pixel `i` by the weights of ITU-R BT.601, or its only band.
  [[nodiscard]] float brightness(std::size_t i) const {
    return bands == 3 ? 0.114F * pixels[3 * i] + 0.587F * pixels[3 * i + 1] + 0.299F * pixels[3 * i + 2]
                      : pixels[i];
  }
};

/// One way to make an appearance of a picture. Holds scratch memory: one thread at a time; allocates nothing
/// after construction.
///
/// Every type is homogeneous: c times the picture gives a positive multiple of the same components for c > 0.
/// So brightness cancels out at unit energy.
class ImageType {
 public:
  ImageType() = default;
  ImageType(const ImageType&) = delete;
  ImageType& operator=(const ImageType&) = delete;
  virtual ~ImageType() = default;
  /// @param out size × size × bands components, those of a pixel together.
  virtual void make(const PictureView& picture, std::span<float> out) = 0;
};

/// What pictures a type is made from.
enum class PictureNeed {
  brightness,  ///< 8 or 16 bits, grey; colour is reduced to brightness
  color,       ///< 8 bits in three bands
  range,       ///< 16 bits: distances in the sensor's own unit, 0 where nothing was measured
  any,         ///< whatever the other types of a sum need; brightness alone
};

/// A row of the table of types.
struct ImageTypeRow {
  std::string_view name;
  std::string_view summary;
  PictureNeed need = PictureNeed::any;
  int bands = 1;
  std::unique_ptr<ImageType> (*make)(int size) = nullptr;
};

/// All types, in the order that help shows them.
std::span<const ImageTypeRow> image_types();

/// A type or a sum of types, as its name says: "gradient", "grey+gradient", "grey:0.7+gradient:0.3".
///
/// In a sum every part is brought to unit energy and multiplied by the root of its weight's share, so that
/// the weights (1 unless stated) are shares of the energy of the whole.
struct ImageTypeSum {
  struct Part {
    const ImageTypeRow* row = nullptr;
    double weight = 1.0;  ///< share; all sum up to 1
  };
  std::vector<Part> parts;
  int bands = 0;                               ///< components a pixel: those of all parts
  PictureNeed need = PictureNeed::brightness;  ///< never `any`
};

/// @throws std::invalid_argument for an unknown name (those known are listed), a weight that is not positive,
/// a type twice, or types that need different pictures.
ImageTypeSum parse_image_type(std::string_view text);

}  // namespace eigenpose
