// BufferStream over a driver that says what it likes.
#include <algorithm>
#include <array>
#include <cerrno>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <linux/videodev2.h>

#include "core/base/error.h"
#include "drivers/v4l2/buffer_stream.h"

namespace eigenpose::test {
namespace {

using testing::ElementsAre;

constexpr std::uint32_t buffer_bytes = 100;

/// Grants four buffers of 100 bytes, records what ends a stream, and fills buffers as the test tells it.
class ScriptedDevice final : public VideoDevice {
 public:
  int control(unsigned long request, void* argument) override {
    if (request == failing) return EIO;
    auto* buffer = static_cast<v4l2_buffer*>(argument);
    if (request == VIDIOC_REQBUFS) {
      auto* wanted = static_cast<v4l2_requestbuffers*>(argument);
      if (wanted->count == 0) ending.emplace_back("buffers given back");
      wanted->count = wanted->count == 0 ? 0 : static_cast<std::uint32_t>(memory_.size());
    } else if (request == VIDIOC_QUERYBUF) {
      buffer->length = buffer_bytes;
      buffer->m.offset = buffer->index;
    } else if (request == VIDIOC_DQBUF) {
      buffer->index = filled_index;
      buffer->bytesused = filled_bytes;
    } else if (request == VIDIOC_STREAMOFF) {
      ending.emplace_back("stream off");
    }
    return 0;
  }
  std::uint8_t* map(std::size_t, std::int64_t offset) override {
    return memory_.at(static_cast<std::size_t>(offset)).data();
  }
  void unmap(std::uint8_t*, std::size_t length) override {
    EXPECT_EQ(length, buffer_bytes);
    ending.emplace_back("unmapped");
  }
  Readiness wait(TimePoint, const WakeUp&) override { return Readiness::ready; }

  unsigned long failing = 0;  ///< the request that fails
  std::uint32_t filled_index = 0;
  std::uint32_t filled_bytes = buffer_bytes;
  std::vector<std::string> ending;

 private:
  std::array<std::array<std::uint8_t, buffer_bytes>, 4> memory_{};
};

TEST(BufferStream, BelievesNoMoreBytesThanABufferHas) {
  const ManualClock clock;
  ScriptedDevice device;
  BufferStream stream(device, "camera", 4, clock);
  for (const std::uint32_t said : {0U, 1U, buffer_bytes - 1, buffer_bytes, buffer_bytes + 1, 0xffff'ffffU}) {
    device.filled_bytes = said;
    const auto filled = stream.take();
    ASSERT_TRUE(filled.has_value());
    EXPECT_EQ(filled->bytes.size(), std::min(said, buffer_bytes));
    stream.give_back(filled->index);
  }
}

TEST(BufferStream, ABufferThatThereIsNotIsABrokenStream) {
  const ManualClock clock;
  ScriptedDevice device;
  BufferStream stream(device, "camera", 4, clock);
  device.filled_index = 3;
  EXPECT_TRUE(stream.take().has_value());
  device.filled_index = 4;
  EXPECT_THROW((void)stream.take(), DeviceError);
}

TEST(BufferStream, IsSwitchedOffBeforeItsBuffersAreLetGo) {
  const ManualClock clock;
  for (const unsigned long failing :
       {0UL, static_cast<unsigned long>(VIDIOC_QBUF), static_cast<unsigned long>(VIDIOC_STREAMON)}) {
    ScriptedDevice device;
    device.failing = failing;
    try {
      const BufferStream stream(device, "camera", 4, clock);
      EXPECT_EQ(failing, 0U);
    } catch (const DeviceError&) {
      EXPECT_NE(failing, 0U);
    }
    EXPECT_THAT(device.ending, ElementsAre("stream off", "unmapped", "unmapped", "unmapped", "unmapped",
                                           "buffers given back"))
        << failing;
  }
}

}  // namespace
}  // namespace eigenpose::test
