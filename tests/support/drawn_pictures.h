#pragma once

/// Drawn objects that turn: coloured or grey patches on a cylinder, seen from the side.

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include <opencv2/core.hpp>

#include "core/learning/parts_learning.h"

namespace eigenpose::test {

/// A drawn object: a body of its own outline with spots around it that come and go as it turns.
class DrawnObject {
 public:
  explicit DrawnObject(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    width_ = 0.25 + 0.12 * unit(random);
    depth_ = 0.6 + 0.4 * unit(random);
    for (int i = 0; i < 14; ++i) {
      spots_.push_back({2.0 * std::numbers::pi * unit(random), 0.1 + 0.8 * unit(random),
                        0.04 + 0.08 * unit(random), 60.0 + 190.0 * unit(random)});
    }
  }

  /// Grey picture of n×n at an angle, with the object moved by (dx, dy) pixels and enlarged.
  [[nodiscard]] cv::Mat view(double degrees, int n = 64, double dx = 0.0, double dy = 0.0,
                             double enlarge = 1.0) const {
    const double angle = degrees * std::numbers::pi / 180.0;
    // An outline that is wider from the front than from the side.
    const double half = width_ * (depth_ + (1.0 - depth_) * std::fabs(std::cos(angle)));
    cv::Mat picture(n, n, CV_8UC1, cv::Scalar(0));
    for (int r = 0; r < n; ++r) {
      for (int c = 0; c < n; ++c) {
        double sum = 0.0;
        for (const double ox : {0.25, 0.75}) {
          for (const double oy : {0.25, 0.75}) {
            const double x = ((c + ox - dx) / n - 0.5) / enlarge;
            const double y = ((r + oy - dy) / n - 0.5) / enlarge + 0.5;
            sum += shade(x, y, half, angle);
          }
        }
        picture.at<std::uint8_t>(r, c) = cv::saturate_cast<std::uint8_t>(0.25 * sum);
      }
    }
    return picture;
  }

 private:
  struct Spot {
    double angle, height, radius, brightness;
  };

  [[nodiscard]] double shade(double x, double y, double half, double angle) const {
    if (std::fabs(x) > half || y < 0.04 || y > 0.96) {
      return 0.0;
    }
    double value = 110.0 + 40.0 * x / half;
    for (const Spot& spot : spots_) {
      const double turned = spot.angle + angle;
      if (std::cos(turned) > 0.0) {
        const double sx = half * std::sin(turned);
        const double distance = std::hypot((x - sx) / std::max(std::cos(turned), 0.2), y - spot.height);
        value += (spot.brightness - value) * std::clamp((spot.radius - distance) / 0.03, 0.0, 1.0);
      }
    }
    return value;
  }

  double width_ = 0.3;
  double depth_ = 0.8;
  std::vector<Spot> spots_;
};

/// Views of `object` at every `step` degrees.
inline PartsViews turntable_views(const DrawnObject& object, double step) {
  SampleAxis axis{turntable_workspace()[0], {}};
  for (double q = 0.0; q < 360.0 - 1e-9; q += step) {
    axis.samples.push_back(q);
  }
  auto drawn = std::make_shared<std::vector<cv::Mat>>();
  for (const double q : axis.samples) drawn->push_back(object.view(q));
  return {{axis}, drawn->size(), [drawn](std::size_t i) { return (*drawn)[i]; }};
}

inline double turn_error(double a, double b) {
  return std::fabs(std::remainder(a - b, 360.0));
}

}  // namespace eigenpose::test
