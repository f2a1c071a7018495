#pragma once

/// The newest frame as JPEG, encoded once however many ask for it.

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "core/image/frame.h"

namespace eigenpose {

/// Keeps the last frame that was asked for. Thread-safe; those who ask while one encodes wait for it.
class FrameJpeg {
 public:
  /// The frame's JPEG. A 16-bit picture keeps its upper eight bits. @throws Error where it cannot be encoded.
  [[nodiscard]] std::shared_ptr<const std::string> of(const Frame& frame);

 private:
  std::mutex mutex_;
  std::uint64_t sequence_ = 0;  ///< guarded by mutex_, as all below: of the frame that is kept
  TimePoint exposure_start_{};
  std::shared_ptr<const std::string> bytes_;
};

}  // namespace eigenpose
