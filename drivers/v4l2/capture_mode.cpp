#include "drivers/v4l2/capture_mode.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <linux/videodev2.h>

namespace eigenpose {
namespace {

/// Some drivers never say "no more"; no camera has this many of anything.
constexpr std::uint32_t most_entries = 256;

int nearest_step(int wanted, std::uint32_t least, std::uint32_t most, std::uint32_t step) {
  const int low = static_cast<int>(least);
  const int high = static_cast<int>(most);
  const int stride = std::max<int>(1, static_cast<int>(step));
  const int steps = (std::clamp(wanted, low, high) - low + stride / 2) / stride;
  return std::min(low + steps * stride, low + (high - low) / stride * stride);
}

double rate_of(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0.0 : static_cast<double>(interval.denominator) / interval.numerator;
}

std::vector<std::pair<int, int>> offered_sizes(VideoDevice& device, std::uint32_t fourcc,
                                               const ModeWishes& wishes) {
  std::vector<std::pair<int, int>> sizes;
  for (std::uint32_t index = 0; index < most_entries; ++index) {
    v4l2_frmsizeenum size{};
    size.index = index;
    size.pixel_format = fourcc;
    if (device.control(VIDIOC_ENUM_FRAMESIZES, &size) != 0) break;
    if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
      const auto& range = size.stepwise;
      return {{nearest_step(wishes.width, range.min_width, range.max_width, range.step_width),
               nearest_step(wishes.height, range.min_height, range.max_height, range.step_height)}};
    }
    sizes.emplace_back(static_cast<int>(size.discrete.width), static_cast<int>(size.discrete.height));
  }
  // A driver that does not enumerate sizes is asked for the wished one; what it grants is seen then.
  if (sizes.empty()) sizes.emplace_back(wishes.width, wishes.height);
  return sizes;
}

std::vector<double> offered_rates(VideoDevice& device, std::uint32_t fourcc, int width, int height,
                                  const ModeWishes& wishes) {
  std::vector<double> rates;
  for (std::uint32_t index = 0; index < most_entries; ++index) {
    v4l2_frmivalenum interval{};
    interval.index = index;
    interval.pixel_format = fourcc;
    interval.width = static_cast<std::uint32_t>(width);
    interval.height = static_cast<std::uint32_t>(height);
    if (device.control(VIDIOC_ENUM_FRAMEINTERVALS, &interval) != 0) break;
    if (interval.type != V4L2_FRMIVAL_TYPE_DISCRETE) {
      const double slowest = rate_of(interval.stepwise.max);
      const double fastest = rate_of(interval.stepwise.min);
      return {std::clamp(wishes.frames_per_second, std::min(slowest, fastest), std::max(slowest, fastest))};
    }
    rates.push_back(rate_of(interval.discrete));
  }
  if (rates.empty()) rates.push_back(0.0);
  return rates;
}

double cost_of(PixelFormat format) {
  switch (format) {
    case PixelFormat::grey:
      return 0.0;
    case PixelFormat::nv12:
      return 0.01;
    case PixelFormat::yuyv:
      return 0.02;
    case PixelFormat::mjpeg:
      return 0.15;
  }
  return 1.0;
}

double size_difference(int offered, int wanted) {
  const double relative = static_cast<double>(offered - wanted) / wanted;
  return relative < 0.0 ? -2.0 * relative : relative;
}

}  // namespace

std::vector<CaptureMode> offered_modes(VideoDevice& device, const ModeWishes& wishes) {
  std::vector<CaptureMode> modes;
  for (std::uint32_t index = 0; index < most_entries; ++index) {
    v4l2_fmtdesc description{};
    description.index = index;
    description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (device.control(VIDIOC_ENUM_FMT, &description) != 0) break;
    const auto format = pixel_format_from_fourcc(description.pixelformat);
    if (!format) continue;
    for (const auto& [width, height] : offered_sizes(device, description.pixelformat, wishes)) {
      for (const double rate : offered_rates(device, description.pixelformat, width, height, wishes)) {
        modes.push_back({description.pixelformat, *format, width, height, rate});
      }
    }
  }
  return modes;
}

std::optional<double> badness(const CaptureMode& mode, const ModeWishes& wishes) {
  if (wishes.color && mode.format == PixelFormat::grey) return std::nullopt;
  if (!wishes.formats.empty() &&
      std::find(wishes.formats.begin(), wishes.formats.end(), mode.format) == wishes.formats.end()) {
    return std::nullopt;
  }
  const double size = size_difference(mode.width, wishes.width) + size_difference(mode.height, wishes.height);
  double rate = 0.1;
  if (mode.frames_per_second > 0.0) {
    const double ratio = mode.frames_per_second / wishes.frames_per_second;
    rate = ratio < 1.0 ? 1.0 - ratio : 0.05 * (ratio - 1.0);
  }
  return size + rate + cost_of(mode.format);
}

std::optional<CaptureMode> best_mode(const std::vector<CaptureMode>& modes, const ModeWishes& wishes) {
  std::optional<CaptureMode> best;
  double least = 0.0;
  for (const CaptureMode& mode : modes) {
    const auto bad = badness(mode, wishes);
    if (bad && (!best || *bad < least)) {
      best = mode;
      least = *bad;
    }
  }
  return best;
}

std::string to_string(const CaptureMode& mode) {
  char rate[32];
  std::snprintf(rate, sizeof rate, "%.4g", mode.frames_per_second);
  return text_of_fourcc(mode.fourcc) + " " + std::to_string(mode.width) + "x" + std::to_string(mode.height) +
         (mode.frames_per_second > 0.0 ? std::string(" at ") + rate + " fps" : "");
}

}  // namespace eigenpose
