#include "drivers/v4l2/buffer_stream.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <linux/videodev2.h>

#include "core/base/error.h"

namespace eigenpose {

void throw_device_error(const std::string& device, const std::string& operation, int error) {
  const std::string cause = std::strerror(error);
  switch (error) {
    case ENODEV:
    case ENXIO:
    case ENOENT:
    case EBADF:
      throw DeviceLost(device, operation, cause + ": the camera is unplugged or its driver has let it go");
    case EACCES:
    case EPERM:
      throw DeviceError(device, operation, cause + ": the user running this must be in the group 'video'");
    case EBUSY:
      throw DeviceError(
          device, operation,
          cause + ": another program uses the camera; close it (fuser -v /dev/video* names it)");
    case ENOSPC:
      throw DeviceError(device, operation,
                        cause + ": the USB bus has no bandwidth left; use another port or a smaller mode");
    default:
      throw DeviceError(device, operation, cause);
  }
}

BufferStream::BufferStream(VideoDevice& device, std::string name, unsigned buffers, const Clock& clock)
    : device_(device), name_(std::move(name)), clock_(clock) {
  v4l2_requestbuffers request{};
  request.count = buffers;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (const int error = device_.control(VIDIOC_REQBUFS, &request); error != 0)
    fail("asking for buffers", error);
  try {
    map_all(request.count);
    for (std::uint32_t index = 0; index < mapped_.size(); ++index) {
      if (const int error = queue(index); error != 0) fail("queueing a buffer", error);
    }
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (const int error = device_.control(VIDIOC_STREAMON, &type); error != 0)
      fail("starting the stream", error);
  } catch (...) {
    release();
    throw;
  }
}

BufferStream::~BufferStream() {
  release();
}

void BufferStream::fail(const char* operation, int error) const {
  throw_device_error(name_, operation, error);
}

void BufferStream::map_all(unsigned count) {
  // One being filled, one waiting, one being read: with fewer a frame is lost whenever one is read.
  if (count < 3)
    throw DeviceError(name_, "asking for buffers", "the driver grants only " + std::to_string(count));
  for (std::uint32_t index = 0; index < count; ++index) {
    v4l2_buffer buffer{};
    buffer.index = index;
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    if (const int error = device_.control(VIDIOC_QUERYBUF, &buffer); error != 0)
      fail("asking for a buffer", error);
    Mapped mapped;
    mapped.length = buffer.length;
    mapped.address = device_.map(buffer.length, buffer.m.offset);
    if (mapped.address == nullptr) fail("mapping a buffer", errno);
    mapped_.push_back(mapped);
  }
}

int BufferStream::queue(std::uint32_t index) {
  v4l2_buffer buffer{};
  buffer.index = index;
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  mapped_[index].queued = clock_.now();
  const int error = device_.control(VIDIOC_QBUF, &buffer);
  if (error == 0) ++with_driver_;
  return error;
}

std::optional<FilledBuffer> BufferStream::take() {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  const TimePoint now = clock_.now();
  const int error = device_.control(VIDIOC_DQBUF, &buffer);
  if (error == EAGAIN) {
    empty_at_ = now;
    return std::nullopt;
  }
  if (error != 0) fail("taking a frame", error);
  if (buffer.index >= mapped_.size()) fail("taking a frame", EPROTO);
  if (with_driver_ > 0) --with_driver_;
  const Mapped& mapped = mapped_[buffer.index];
  FilledBuffer filled;
  filled.index = buffer.index;
  filled.bytes = {mapped.address, std::min<std::size_t>(buffer.bytesused, mapped.length)};
  filled.sequence = buffer.sequence;
  filled.damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
  filled.stamp_is_monotonic =
      (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  filled.stamp_is_start = (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  filled.stamp = TimePoint(std::chrono::seconds(buffer.timestamp.tv_sec) +
                           std::chrono::microseconds(buffer.timestamp.tv_usec));
  filled.not_before = std::max(mapped.queued, empty_at_);
  return filled;
}

void BufferStream::give_back(std::uint32_t index) {
  refused_.push_back(index);
  std::erase_if(refused_, [this](std::uint32_t waiting) { return queue(waiting) == 0; });
}

void BufferStream::release() noexcept {
  // A device that is gone refuses these; its memory must be let go all the same.
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  device_.control(VIDIOC_STREAMOFF, &type);
  for (const Mapped& mapped : mapped_) device_.unmap(mapped.address, mapped.length);
  mapped_.clear();
  v4l2_requestbuffers none{};
  none.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  none.memory = V4L2_MEMORY_MMAP;
  device_.control(VIDIOC_REQBUFS, &none);
}

}  // namespace eigenpose
