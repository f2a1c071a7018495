#pragma once

/// What a camera offers (formats × sizes × intervals) and which of it suits us best.

#include <optional>
#include <string>
#include <vector>

#include "drivers/v4l2/pixel_format.h"
#include "drivers/v4l2/video_system.h"

namespace eigenpose {

/// One way a camera can be run.
struct CaptureMode {
  std::uint32_t fourcc = 0;  ///< as the camera names it
  PixelFormat format = PixelFormat::yuyv;
  int width = 0;                   ///< pixels
  int height = 0;                  ///< pixels
  double frames_per_second = 0.0;  ///< 0: the camera does not say
};

/// What is asked for.
struct ModeWishes {
  int width = 640;
  int height = 480;
  double frames_per_second = 30.0;
  bool color = true;                 ///< BGR pictures; false: grey, for which luma alone is read
  std::vector<PixelFormat> formats;  ///< only these; empty: any we read
};

/// All modes whose format we read. Ranges of sizes and rates (stepwise, continuous) are represented by the
/// member nearest to the wishes, so the result stays short.
std::vector<CaptureMode> offered_modes(VideoDevice& device, const ModeWishes& wishes);

/// How badly a mode suits; 0 is perfect. The sum of
///  - size: relative difference of width and of height, doubled where the camera has fewer pixels than asked;
///  - rate: the missing fraction, or a twentieth of the surplus factor; a rate the camera does not tell
///  counts 0.1;
///  - format: what it costs per frame and loses (GREY 0, NV12 0.01, YUYV 0.02, MJPEG 0.15).
/// So size comes before rate, and an uncompressed format before MJPEG unless MJPEG alone brings the size or
/// the rate.
/// @return nothing when the mode is out of question: a format not listed, or no colour where colour is asked.
std::optional<double> badness(const CaptureMode& mode, const ModeWishes& wishes);

/// The mode with the least badness; nothing when none will do.
std::optional<CaptureMode> best_mode(const std::vector<CaptureMode>& modes, const ModeWishes& wishes);

/// "YUYV 640x480 at 30 fps".
std::string to_string(const CaptureMode& mode);

}  // namespace eigenpose
