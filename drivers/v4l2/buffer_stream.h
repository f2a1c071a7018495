#pragma once

/// The mapped buffers of one streaming device: taken when filled, given back when read.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/v4l2/video_system.h"

namespace eigenpose {

/// A filled buffer. The bytes stay until the buffer is given back.
struct FilledBuffer {
  std::uint32_t index = 0;
  std::span<const std::uint8_t> bytes;
  std::uint32_t sequence = 0;
  bool damaged = false;             ///< the driver says so
  bool stamp_is_monotonic = false;  ///< `stamp` is on our clock
  bool stamp_is_start =
      false;  ///< of the start of exposure, the driver says; otherwise of the end of the frame
  TimePoint stamp{};
  TimePoint not_before{};  ///< the buffer was filled after this, whatever the stamp says
};

/// Owns the buffers and the stream's being on. Refers to the device, which must outlive it. Lives on one
/// thread.
class BufferStream {
 public:
  /// Asks for `buffers`, maps them, queues them, starts. @throws DeviceError and DeviceLost.
  BufferStream(VideoDevice& device, std::string name, unsigned buffers, const Clock& clock);
  /// Stops and unmaps.
  ~BufferStream();
  BufferStream(const BufferStream&) = delete;
  BufferStream& operator=(const BufferStream&) = delete;

  /// The oldest filled buffer, or nothing if none is filled. @throws DeviceLost when the device is gone;
  /// DeviceError when the stream has broken.
  std::optional<FilledBuffer> take();
  /// A buffer that the driver refuses is kept aside and offered again with the next one.
  void give_back(std::uint32_t index);

  [[nodiscard]] unsigned buffers() const { return static_cast<unsigned>(mapped_.size()); }
  /// How many buffers the driver has, filled or not.
  [[nodiscard]] unsigned with_driver() const { return with_driver_; }

 private:
  struct Mapped {
    std::uint8_t* address = nullptr;
    std::size_t length = 0;
    TimePoint queued{};
  };
  [[noreturn]] void fail(const char* operation, int error) const;
  void map_all(unsigned count);
  int queue(std::uint32_t index);
  void release() noexcept;

  VideoDevice& device_;
  std::string name_;
  const Clock& clock_;
  std::vector<Mapped> mapped_;
  std::vector<std::uint32_t> refused_;
  unsigned with_driver_ = 0;
  TimePoint empty_at_{};  ///< when no buffer was filled, at the last poll
};

/// The typed failure for errno of a call on a video device: DeviceLost when it means that the device is gone.
[[noreturn]] void throw_device_error(const std::string& device, const std::string& operation, int error);

}  // namespace eigenpose
