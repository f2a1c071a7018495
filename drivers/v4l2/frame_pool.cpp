#include "drivers/v4l2/frame_pool.h"

#include <mutex>
#include <vector>

namespace eigenpose {

/// Hands memory to cv::Mat and takes it back. Each block in use keeps the allocator alive through its owner
/// record.
class FramePool::Allocator final : public cv::MatAllocator, public std::enable_shared_from_this<Allocator> {
 public:
  Allocator() = default;
  Allocator(const Allocator&) = delete;
  Allocator& operator=(const Allocator&) = delete;
  ~Allocator() override {
    for (const Block& block : free_) cv::fastFree(block.memory);
  }

  cv::UMatData* allocate(int dimensions, const int* sizes, int type, void* data, std::size_t* steps,
                         cv::AccessFlag, cv::UMatUsageFlags) const override {
    CV_Assert(data == nullptr);
    std::size_t bytes = CV_ELEM_SIZE(type);
    for (int i = dimensions - 1; i >= 0; --i) {
      if (steps != nullptr) steps[i] = bytes;
      bytes *= static_cast<std::size_t>(sizes[i]);
    }
    auto record = std::make_unique<Record>(this);
    record->data = record->origdata = take(bytes);
    record->size = bytes;
    record->keep_alive = shared_from_this();
    return record.release();
  }

  bool allocate(cv::UMatData* data, cv::AccessFlag, cv::UMatUsageFlags) const override {
    return data != nullptr;
  }

  void deallocate(cv::UMatData* data) const override {
    const std::unique_ptr<Record> record(static_cast<Record*>(data));
    const std::lock_guard lock(mutex_);
    free_.push_back({record->origdata, record->size});
    record->origdata = nullptr;
  }

  std::size_t blocks_made() const {
    const std::lock_guard lock(mutex_);
    return blocks_made_;
  }

 private:
  struct Block {
    std::uint8_t* memory;
    std::size_t bytes;
  };
  struct Record final : cv::UMatData {
    using cv::UMatData::UMatData;
    std::shared_ptr<const Allocator> keep_alive;
  };

  std::uint8_t* take(std::size_t bytes) const {
    const std::lock_guard lock(mutex_);
    while (!free_.empty()) {
      const Block block = free_.back();
      free_.pop_back();
      if (block.bytes == bytes) return block.memory;
      cv::fastFree(block.memory);  // of another size: the mode has changed
    }
    ++blocks_made_;
    return static_cast<std::uint8_t*>(cv::fastMalloc(bytes));
  }

  mutable std::mutex mutex_;
  mutable std::vector<Block> free_;      ///< guarded by mutex_
  mutable std::size_t blocks_made_ = 0;  ///< guarded by mutex_
};

FramePool::FramePool() : allocator_(std::make_shared<Allocator>()) {}

FramePool::~FramePool() = default;

cv::Mat FramePool::picture(int rows, int columns, int type) {
  cv::Mat mat;
  mat.allocator = allocator_.get();
  mat.create(rows, columns, type);
  // A copy of the header that is created anew elsewhere must not come back here for memory.
  mat.allocator = nullptr;
  return mat;
}

std::size_t FramePool::blocks_made() const {
  return allocator_->blocks_made();
}

}  // namespace eigenpose
