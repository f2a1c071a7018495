#pragma once

/// Tells a still scene from one in which something moves.

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
  int block = 8;  ///< side of a block, pixels; averaging over it reduces noise. 2…64
};

/// Compares block means of each frame with those when the picture last began to be still, so that slow motion
/// adds up and is seen, and with those of the scene that was last accepted. One thread at a time; allocates
/// nothing after the first frame.
///
/// Flicker of the light (a lamp on the mains) multiplies the brightness of all blocks by one gain, which is
/// the median ratio of the blocks that are bright enough to show it, if it is 0.8…1.25. A block is unchanged
/// if it followed the gain wholly, in part (where it is saturated, or lit by another light too) or not at
/// all. What of the flicker differs from block to block (bands of a rolling shutter) is noise in proportion
/// to brightness: its median over the bright blocks, times 6.5 and the brightness of a block, is the least
/// threshold of that block, up to half its brightness. So an object that appears on dark ground is noticed as
/// early as without flicker.
class SceneChange {
 public:
  /// @throws std::invalid_argument for a block that is out of range.
  explicit SceneChange(const SceneChangeOptions& options = {});

  struct Observation {
    bool settled = false;  ///< nothing has changed for the settling time
    bool changed = false;  ///< differs from the scene last accepted, or none was
  };
  /// Takes the next frame of the same camera. A frame of another size or type begins anew.
  Observation update(const Frame& frame);
  /// The scene of the last frame is known now: `changed` compares with it.
  void accept();
  /// Forgets everything, the measured noise included.
  void reset();

  /// The threshold of a dark block, grey levels.
  [[nodiscard]] double threshold() const;
  /// Amplitude of the flicker over the last 30 still frames: 0.05 is a brightness of ±5 %. 0 while fewer than
  /// ten are known. Values below 0.005 are noise of the measurement.
  [[nodiscard]] double flicker() const;

 private:
  static constexpr std::size_t noise_samples = 9;
  static constexpr std::size_t gain_samples = 30;
  /// The common ratio of the last frame to `reference`, 1 if there is none.
  [[nodiscard]] double gain(const cv::Mat& reference) const;
  [[nodiscard]] bool differs(const cv::Mat& reference, double gain) const;
  void begin(const Frame& frame);
  void measure_noise();

  SceneChangeOptions options_;
  cv::Mat now_;       ///< block means of the last frame
  cv::Mat before_;    ///< of the one before
  cv::Mat anchor_;    ///< when the picture began to be still
  cv::Mat accepted_;  ///< of the scene last accepted; empty: none
  TimePoint still_since_{};
  std::array<double, noise_samples> noise_{};           ///< between the last frames, a ring
  std::array<double, noise_samples> relative_noise_{};  ///< the same over brightness, of bright blocks
  std::size_t noise_count_ = 0;
  std::array<double, gain_samples> gains_{};  ///< of the last frames to the anchor, a ring
  std::size_t gain_count_ = 0;
};

}  // namespace eigenpose
