#include "core/learning/calibration/perturbation.h"

#include <cmath>
#include <numbers>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace eigenpose {

Misalignment Perturbation::draw(SeededRandom& random) const {
  Misalignment m;
  m.dx = shift * random.symmetric();
  m.dy = shift * random.symmetric();
  m.scale = scale * random.symmetric();
  m.rotation = turn_deg * random.symmetric() * std::numbers::pi / 180.0;
  return m;
}

Misalignment Perturbation::of(std::string_view object, std::size_t view) const {
  SeededRandom random(seed_of(object, view));
  return draw(random);
}

cv::Mat perturbed(const cv::Mat& picture, const Perturbation& by, std::string_view object, std::size_t view) {
  cv::Mat result = displaced(picture, by.of(object, view));
  if (picture.channels() != 3 || by.tint <= 0.0) return result;
  SeededRandom random(seed_of(object, view) ^ 0x9E3779B9U);  // not the draws of its misalignment
  const double blue = 1.0 + by.tint * random.symmetric();
  const double red = 1.0 + by.tint * random.symmetric();
  cv::multiply(result, cv::Scalar(blue, 1.0, red), result);
  return result;
}

std::uint32_t seed_of(std::string_view object, std::size_t view) {
  std::uint32_t hash = 2166136261U;  // FNV-1a
  for (const char c : object) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619U;
  return hash + static_cast<std::uint32_t>(view);
}

cv::Mat displaced(const cv::Mat& picture, const Misalignment& by) {
  const double enlarge = 1.0 + by.scale;
  const double cosine = enlarge * std::cos(by.rotation);
  const double sine = enlarge * std::sin(by.rotation);
  const double x = 0.5 * picture.cols - 0.5;
  const double y = 0.5 * picture.rows - 0.5;
  const double dx = by.dx * picture.cols;
  const double dy = by.dy * picture.cols;
  const cv::Matx23d map(cosine, -sine, x + dx - cosine * x + sine * y, sine, cosine,
                        y + dy - sine * x - cosine * y);
  const int interpolation = picture.depth() == CV_16U ? cv::INTER_NEAREST : cv::INTER_LINEAR;
  cv::Mat result;
  cv::warpAffine(picture, result, map, picture.size(), interpolation, cv::BORDER_REPLICATE);
  return result;
}

}  // namespace eigenpose
