#pragma once

/// Memory for pictures that is used again once the last holder has released it.

#include <memory>

#include <opencv2/core.hpp>

namespace eigenpose {

/// After the first few frames no picture memory is asked of the system: fresh pages cost more than a copy.
/// Lives on one thread; the pictures may be released by any thread, also after the pool is gone.
class FramePool {
 public:
  FramePool();
  ~FramePool();
  FramePool(const FramePool&) = delete;
  FramePool& operator=(const FramePool&) = delete;

  /// A picture of undefined content.
  cv::Mat picture(int rows, int columns, int type);
  /// How many blocks of memory were ever asked of the system.
  [[nodiscard]] std::size_t blocks_made() const;

 private:
  class Allocator;
  std::shared_ptr<Allocator> allocator_;
};

}  // namespace eigenpose
