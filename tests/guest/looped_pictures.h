#pragma once

/// Our own pictures through the kernel's virtual camera: what is written to vivid's HDMI output comes back
/// from its HDMI input.

#include <atomic>
#include <functional>
#include <string>
#include <thread>

#include <opencv2/core.hpp>

namespace eigenpose::test {

/// Feeds pictures of 640x480 from a thread of its own. Starts anew when the device was disconnected.
/// Thread-safe.
class LoopedPictures {
 public:
  /// Joins vivid's HDMI output to its HDMI input. @param draw fills a black CV_8UC1 with luma; called on the
  /// thread.
  /// @throws std::runtime_error when vivid is not loaded with node_types=0x101.
  explicit LoopedPictures(std::function<void(cv::Mat&)> draw);

  /// The node from which the pictures come.
  [[nodiscard]] const std::string& capture_node() const { return capture_; }
  /// The cable is pulled and put back: every program that has the camera open loses it (ENODEV).
  void disconnect();
  [[nodiscard]] int pictures_shown() const { return shown_; }

 private:
  void feed(const std::stop_token& stop);
  bool feed_until_lost(const std::stop_token& stop);

  std::function<void(cv::Mat&)> draw_;
  std::string capture_;
  std::string output_;
  std::atomic<int> shown_{0};
  std::jthread thread_;
};

}  // namespace eigenpose::test
