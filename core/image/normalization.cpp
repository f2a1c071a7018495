#include "core/image/normalization.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/image/image_type.h"
#include "core/simd/pixel_arithmetic.h"

namespace eigenpose {
namespace {

/// Brightness of a colour pixel: the weights of ITU-R BT.601.
float luma(float blue, float green, float red) {
  return 0.114F * blue + 0.587F * green + 0.299F * red;
}

/// A pixel of range counts as measured when this share of its area was.
constexpr float least_measured = 0.5F;

/// Of colour pixels: out[3j…] = Σ weights[j·taps + s] · pixel first[j] + s, j < count. Four floats at once:
/// a pixel and the first of the next, which is overwritten by the next; one more than is wanted is read and
/// written at the end. `Taps` is `taps`, or 0 for any.
template <int Taps>
void sum_colors(const float* source, const int* first, const float* weights, int taps, std::size_t count,
                float* out) {
  using Four [[gnu::vector_size(16), gnu::aligned(4)]] = float;
  const int n = Taps > 0 ? Taps : taps;
  for (std::size_t j = 0; j < count; ++j, weights += n) {
    const float* pixels = source + std::ptrdiff_t{3} * first[j];
    Four sum = weights[0] * *reinterpret_cast<const Four*>(pixels);
    for (int s = 1; s < n; ++s) sum += weights[s] * *reinterpret_cast<const Four*>(pixels + 3 * s);
    *reinterpret_cast<Four*>(out + 3 * j) = sum;
  }
}

using SumColors = void (*)(const float*, const int*, const float*, int, std::size_t, float*);

SumColors sum_colors_with(int taps) {
  switch (taps) {
    case 2:
      return sum_colors<2>;
    case 3:
      return sum_colors<3>;
    case 4:
      return sum_colors<4>;
    case 5:
      return sum_colors<5>;
    case 6:
      return sum_colors<6>;
    default:
      return sum_colors<0>;
  }
}

}  // namespace

void set_image_type(NormalizationOptions& options, const std::string& type) {
  const ImageTypeSum sum = parse_image_type(type);
  options.color = sum.need == PictureNeed::color;
  options.type = type == "grey" || type == "color" ? "" : type;
}

std::string image_type_name(const NormalizationOptions& options) {
  if (options.type.empty()) return options.color ? "color" : "grey";
  return options.type;
}

int picture_bands(const NormalizationOptions& options) {
  return options.color ? 3 : 1;
}

std::size_t picture_length(const NormalizationOptions& options) {
  return static_cast<std::size_t>(options.size) * static_cast<std::size_t>(options.size) *
         static_cast<std::size_t>(picture_bands(options));
}

bool is_range(const NormalizationOptions& options) {
  return !options.type.empty() && parse_image_type(options.type).need == PictureNeed::range;
}

bool appearance_is_picture(const NormalizationOptions& options) {
  return options.type.empty() && !options.color;
}

int appearance_bands(const NormalizationOptions& options) {
  return options.type.empty() ? picture_bands(options) : parse_image_type(options.type).bands;
}

std::size_t appearance_length(const NormalizationOptions& options) {
  return static_cast<std::size_t>(options.size) * static_cast<std::size_t>(options.size) *
         static_cast<std::size_t>(appearance_bands(options));
}

Normalizer::Normalizer(const NormalizationOptions& options) : options_(options), range_(is_range(options)) {
  if (options.size < 8 || options.size > 256)
    throw std::invalid_argument("the side of an appearance is " + std::to_string(options.size) +
                                " pixels, allowed are 8 to 256");
}

void Normalizer::prepare(Axis& axis, int extent, int square) const {
  if (axis.extent == extent && axis.square == square) return;
  axis.extent = extent;
  axis.square = square;
  const int n = options_.size;
  const double scale = static_cast<double>(square) / n;  // source pixels an output pixel
  const double width = std::max(1.0, scale);             // never narrower than a source pixel
  const double origin = 0.5 * (extent - square);         // left edge of the square, from the cut's edge
  axis.taps = std::min(extent, static_cast<int>(std::ceil(width)) + 1);
  axis.first.resize(static_cast<std::size_t>(n));
  axis.weights.resize(static_cast<std::size_t>(n) * static_cast<std::size_t>(axis.taps));
  float* weight = axis.weights.data();
  const double share = 1.0 / width;
  for (int i = 0; i < n; ++i) {
    const double middle = origin + (i + 0.5) * scale;
    const double low = middle - 0.5 * width;
    const double high = middle + 0.5 * width;
    const int first = std::clamp(static_cast<int>(std::floor(low)), 0, extent - axis.taps);
    axis.first[static_cast<std::size_t>(i)] = first;
    for (int s = first; s < first + axis.taps; ++s) {
      const double covered = std::min<double>(high, s + 1) - std::max<double>(low, s);
      *weight++ = static_cast<float>(std::max(0.0, covered) * share);
    }
  }
}

void Normalizer::add_row(const cv::Mat& cut, int y, float weight) {
  const auto width = static_cast<std::size_t>(cut.cols);
  if (cut.type() != CV_16UC1) {
    const auto* pixels = cut.ptr<std::uint8_t>(y);
    const int bands = cut.channels();
    const std::size_t numbers = width * static_cast<std::size_t>(bands);
    if (bands == 1 || options_.color) {
      add_above_levels(pixels, numbers, levels_.data(), weight, sums_.data());
      return;
    }
    std::fill_n(converted_.begin(), numbers, 0.0F);
    add_above_levels(pixels, numbers, levels_.data(), weight, converted_.data());
    for (std::size_t x = 0; x < width; ++x)
      sums_[x] += luma(converted_[3 * x], converted_[3 * x + 1], converted_[3 * x + 2]);
    return;
  }
  const auto* pixels = cut.ptr<std::uint16_t>(y);
  const float base = 256.0F * levels_[0];
  for (std::size_t x = 0; x < width; ++x) {
    const float above = std::max(0.0F, static_cast<float>(pixels[x]) - base);
    if (range_) {
      sums_[2 * x] += weight * above;
      sums_[2 * x + 1] += pixels[x] > 0 ? weight : 0.0F;
    } else {
      sums_[x] += weight * above / 256.0F;
    }
  }
}

float Normalizer::normalize(const cv::Mat& cut, const std::array<std::uint8_t, 3>& level,
                            std::span<float> picture) {
  if (cut.empty() || (cut.type() != CV_8UC1 && cut.type() != CV_8UC3 && cut.type() != CV_16UC1))
    throw std::invalid_argument("a picture is 8-bit grey, 8-bit BGR or 16-bit grey and not empty; got type " +
                                cv::typeToString(cut.type()));
  if (options_.color && cut.channels() != 3)
    throw std::invalid_argument("the image type is in colour, the picture is grey; take the type \"grey\"");
  if (range_ && cut.type() != CV_16UC1)
    throw std::invalid_argument("the model was learned from range, the picture is not 16-bit grey but " +
                                cv::typeToString(cut.type()));
  if (picture.size() != length())
    throw std::invalid_argument("a normalised picture has " + std::to_string(length()) +
                                " components, room is for " + std::to_string(picture.size()));
  const auto n = static_cast<std::size_t>(options_.size);
  const auto bands = range_ ? std::size_t{2} : static_cast<std::size_t>(picture_bands(options_));
  const auto width = static_cast<std::size_t>(cut.cols) * bands;
  const int square = std::max(cut.rows, cut.cols);
  levels_.resize(level_block);
  for (std::size_t i = 0; i < level_block; ++i) levels_[i] = level[cut.channels() == 3 ? i % 3 : 0];
  prepare(vertical_, cut.rows, square);
  prepare(horizontal_, cut.cols, square);
  converted_.resize(std::max(converted_.size(), static_cast<std::size_t>(cut.cols) * 3));
  // Each row of the result: the source rows it overlaps, summed, then the same within the row.
  const auto taps = static_cast<std::size_t>(horizontal_.taps);
  // Colour pixels beyond which the cut goes on for one more, so that nothing beyond it is read.
  std::size_t inner = 0;
  while (bands == 3 && inner + 1 < n && horizontal_.first[inner] + horizontal_.taps < horizontal_.extent)
    ++inner;
  const SumColors sum_inner = sum_colors_with(horizontal_.taps);
  const auto sum_row = [&](const float* source, float* out) {
    sum_inner(source, horizontal_.first.data(), horizontal_.weights.data(), horizontal_.taps, inner, out);
    std::size_t j = inner;
    for (; j < n; ++j) {
      const float* weights = horizontal_.weights.data() + j * taps;
      const float* pixels = source + static_cast<std::size_t>(horizontal_.first[j]) * bands;
      for (std::size_t b = 0; b < bands; ++b) {
        float sum = 0.0F;
        for (std::size_t s = 0; s < taps; ++s) sum += weights[s] * pixels[s * bands + b];
        out[j * bands + b] = sum;
      }
    }
  };
  if (range_) depths_.resize(n * n * bands);
  float* out = range_ ? depths_.data() : picture.data();
  const float* weight = vertical_.weights.data();
  for (std::size_t i = 0; i < n; ++i) {
    sums_.assign(width, 0.0F);
    for (int s = 0; s < vertical_.taps; ++s, ++weight)
      if (*weight > 0.0F) add_row(cut, vertical_.first[i] + s, *weight);
    sum_row(sums_.data(), out + i * n * bands);
  }
  if (range_)
    for (std::size_t i = 0; i < n * n; ++i) {
      const float measured = depths_[2 * i + 1];
      picture[i] = measured >= least_measured ? depths_[2 * i] / measured : 0.0F;
    }
  return std::sqrt(sum_of_squares(picture.data(), picture.size()));
}

void shrink_appearance(std::span<const float> appearance, int size, int bands, int side,
                       std::span<float> reduced) {
  std::fill(reduced.begin(), reduced.end(), 0.0F);
  if (size == 2 * side) {
    const auto row = static_cast<std::ptrdiff_t>(size) * bands;
    float* out = reduced.data();
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        const float* upper = appearance.data() + 2 * y * row + static_cast<std::ptrdiff_t>(2 * x) * bands;
        const float* lower = upper + row;
        for (int b = 0; b < bands; ++b)
          *out++ = 0.25F * (upper[b] + upper[bands + b] + lower[b] + lower[bands + b]);
      }
    return;
  }
  const double scale = static_cast<double>(side) / size;
  const float area = static_cast<float>(scale * scale);
  // Where source pixel i falls: mostly into one target pixel, else into two.
  const auto part = [&](int i, int& first) {
    const double low = i * scale;
    first = std::min(side - 1, static_cast<int>(low));
    return static_cast<float>(std::min(1.0, (first + 1 - low) / scale));
  };
  for (int y = 0; y < size; ++y) {
    int row = 0;
    const float upper = part(y, row);
    for (int x = 0; x < size; ++x) {
      int column = 0;
      const float left = part(x, column);
      const float* pixel = appearance.data() + (static_cast<std::ptrdiff_t>(y) * size + x) * bands;
      for (int dy = 0; dy < 2; ++dy) {
        const float vertical = dy == 0 ? upper : 1.0F - upper;
        if (vertical <= 0.0F || row + dy >= side) continue;
        for (int dx = 0; dx < 2; ++dx) {
          const float weight = area * vertical * (dx == 0 ? left : 1.0F - left);
          if (weight <= 0.0F || column + dx >= side) continue;
          float* out = reduced.data() + (static_cast<std::ptrdiff_t>(row + dy) * side + column + dx) * bands;
          for (int b = 0; b < bands; ++b) out[b] += weight * pixel[b];
        }
      }
    }
  }
}

void quantize(std::span<const float> picture, std::span<std::uint8_t> bytes) {
  const float largest = largest_of(picture.data(), picture.size());
  round_scaled(picture.data(), largest > 0.0F ? 255.0F / largest : 0.0F, picture.size(), bytes.data());
}

}  // namespace eigenpose
