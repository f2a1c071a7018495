#include "core/image/image_type.h"

#include <array>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "core/image/types/types.h"

namespace eigenpose {
namespace {

const std::array rows{
    ImageTypeRow{"grey", "brightness", PictureNeed::brightness, 1, types::make_brightness},
    ImageTypeRow{"color", "brightness and opponent colours jointly", PictureNeed::color, 3,
                 types::make_opponent},
    ImageTypeRow{"gradient", "how steeply brightness or range changes", PictureNeed::any, 1,
                 types::make_gradient},
    ImageTypeRow{"laplacian", "how much a pixel differs from its neighbours", PictureNeed::any, 1,
                 types::make_laplacian},
    ImageTypeRow{"fourier", "root of the Fourier magnitude: does not depend on where the object stands",
                 PictureNeed::any, 1, types::make_fourier},
    ImageTypeRow{"range", "16-bit distances; 0 is not measured", PictureNeed::range, 1,
                 types::make_brightness},
};

std::string known_types() {
  std::string names;
  for (const ImageTypeRow& row : rows) names += (names.empty() ? "" : ", ") + std::string(row.name);
  return names;
}

ImageTypeSum::Part parse_part(std::string_view text) {
  const auto colon = text.find(':');
  const std::string_view name = text.substr(0, colon);
  ImageTypeSum::Part part;
  for (const ImageTypeRow& row : rows)
    if (row.name == name) part.row = &row;
  if (part.row == nullptr)
    throw std::invalid_argument("unknown image type \"" + std::string(name) + "\"; known are " +
                                known_types() + ", and sums such as grey+gradient or grey:0.7+gradient:0.3");
  if (colon == std::string_view::npos) return part;
  const std::string_view number = text.substr(colon + 1);
  const char* end = number.data() + number.size();
  const auto read = std::from_chars(number.data(), end, part.weight);
  if (read.ec != std::errc() || read.ptr != end || !(part.weight > 0.0) || !std::isfinite(part.weight))
    throw std::invalid_argument("the weight of image type \"" + std::string(text) +
                                "\" is not a number above 0; write for example grey:0.7+gradient:0.3");
  return part;
}

}  // namespace

std::span<const ImageTypeRow> image_types() {
  return rows;
}

ImageTypeSum parse_image_type(std::string_view text) {
  ImageTypeSum sum;
  double weights = 0.0;
  PictureNeed need = PictureNeed::any;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('+', at), text.size());
    const ImageTypeSum::Part part = parse_part(text.substr(at, end - at));
    for (const ImageTypeSum::Part& other : sum.parts)
      if (other.row == part.row)
        throw std::invalid_argument("image type \"" + std::string(part.row->name) + "\" stands twice in \"" +
                                    std::string(text) + "\"; name it once");
    if (part.row->need != PictureNeed::any && need != PictureNeed::any && part.row->need != need)
      throw std::invalid_argument(
          "\"" + std::string(text) +
          "\" needs different pictures at once: grey, color and range cannot be summed");
    if (part.row->need != PictureNeed::any) need = part.row->need;
    weights += part.weight;
    sum.bands += part.row->bands;
    sum.parts.push_back(part);
    at = end + 1;
  }
  for (ImageTypeSum::Part& part : sum.parts) part.weight /= weights;
  sum.need = need == PictureNeed::any ? PictureNeed::brightness : need;
  return sum;
}

}  // namespace eigenpose
