#pragma once

/// Telling a still picture from one in which something moves.

#include <array>
#include <chrono>
#include <cstddef>
#include <optional>

#include <opencv2/core.hpp>

#include "core/base/clock.h"
#include "core/image/frame.h"

namespace eigenpose {

struct SceneChangeOptions {
  /// The picture must not have changed for so long to count as settled.
  Duration settle = std::chrono::milliseconds(300);
  /// Grey levels (of 255) by which the mean of a block may differ in a still picture. Not given: at least
  /// `smallest_threshold`, and 6.5 times the block noise measured between frames, so that a noisy camera
  /// settles too.
  std::optional<double> threshold;
  double smallest_threshold = 3.0;
  int block = 8;  ///< side of a block, pixels; averaging over it takes noise out. 2…64
};

/// Compares block means of each frame with those when the picture last began to be still, so that slow motion
/// adds up and is seen, and with those of the scene that was last looked at. One thread at a time; allocates
/// nothing after the first frame.
class SceneChange {
 public:
  explicit SceneChange(const SceneChangeOptions& options = {});

  struct Observation {
    bool settled = false;  ///< nothing has changed for the settling time
    bool changed = false;  ///< differs from the scene last accepted, or none was
  };
  /// Takes the next frame of the same camera. A frame of another size or type begins anew.
  Observation update(const Frame& frame);
  /// The scene of the last frame is known now: `changed` compares with it.
  void accept();
  /// Forgets everything; the noise measured, too.
  void reset();

  /// The threshold in use, grey levels.
  [[nodiscard]] double threshold() const;

 private:
  static constexpr std::size_t noise_samples = 9;
  void measure_noise();

  SceneChangeOptions options_;
  cv::Mat now_;       ///< block means of the last frame
  cv::Mat before_;    ///< of the one before
  cv::Mat anchor_;    ///< when the picture began to be still
  cv::Mat accepted_;  ///< of the scene last accepted; empty: none
  cv::Mat difference_;
  TimePoint still_since_{};
  std::array<double, noise_samples> noise_{};  ///< between the last frames, a ring
  std::size_t noise_count_ = 0;
};

}  // namespace eigenpose
