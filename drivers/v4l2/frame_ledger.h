#pragma once

/// Makes facts of what drivers say about frames: a count that never goes back, and a moment before which no
/// photon fell.

#include <cstdint>
#include <optional>

#include "drivers/v4l2/buffer_stream.h"

namespace eigenpose {

/// What is known of a camera's timing.
struct FrameTiming {
  Duration interval = std::chrono::milliseconds(33);  ///< from frame to frame
  std::optional<Duration> exposure;  ///< if locked and told; otherwise up to a whole interval is assumed
  int internal_frames = 1;           ///< whole frames the camera may hold before it sends them
};

/// Numbers and dates the frames of one camera across reopenings. Lives on one thread.
class FrameLedger {
 public:
  /// Called for each new stream: sequence numbers start anew, ours goes on.
  void restart(const FrameTiming& timing, TimePoint now);

  /// The extended number of the frame that the driver calls `raw`. 32-bit wraps are followed. Numbers that
  /// stand still, go back, or leap further than time allows count as the next one.
  std::uint64_t number(std::uint32_t raw, TimePoint now);

  /// The moment before which no photon of the frame fell. From the driver's stamp if that is monotonic and
  /// lies near the time the driver had the buffer (some drivers stamp nonsense), else from when the buffer
  /// was last known to be empty. From it are taken:
  ///  - the readout, up to an interval, when the stamp is of the end of the frame;
  ///  - the exposure, also when the stamp claims to be of its start: uvcvideo claims so and stamps the first
  ///  packet received;
  ///  - the frames the camera may hold.
  [[nodiscard]] TimePoint exposure_start(const FilledBuffer& buffer, TimePoint now) const;

 private:
  FrameTiming timing_;
  std::optional<std::uint32_t> last_raw_;  ///< of the present stream
  std::uint64_t last_ = 0;                 ///< 0: no frame yet
  TimePoint last_at_{};
};

}  // namespace eigenpose
