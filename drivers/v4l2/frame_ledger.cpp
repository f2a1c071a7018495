#include "drivers/v4l2/frame_ledger.h"

#include <algorithm>

namespace eigenpose {

void FrameLedger::restart(const FrameTiming& timing, TimePoint now) {
  timing_ = timing;
  last_raw_.reset();
  last_at_ = now;
}

std::uint64_t FrameLedger::number(std::uint32_t raw, TimePoint now) {
  std::uint64_t step = 1;
  if (last_raw_) {
    const std::uint32_t difference = raw - *last_raw_;  // modulo 2³²: a wrap is a small step
    // Twice the frames there was time for, and some more for bursts; a greater leap is a driver's slip.
    const auto time_for = 2 * std::max<std::int64_t>((now - last_at_) / timing_.interval, 0) + 100;
    if (difference != 0 && difference <= static_cast<std::uint64_t>(time_for)) step = difference;
  }
  last_raw_ = raw;
  last_at_ = now;
  last_ += step;
  return last_;
}

TimePoint FrameLedger::exposure_start(const FilledBuffer& buffer, TimePoint now) const {
  const Duration slack = std::chrono::milliseconds(1);
  // A stamp may lie before the buffer was seen empty, but not long before.
  const TimePoint earliest = buffer.not_before - 2 * timing_.interval - std::chrono::milliseconds(100);
  const bool trusted = buffer.stamp_is_monotonic && buffer.stamp >= earliest && buffer.stamp <= now + slack;
  const TimePoint stamp = trusted ? std::min(buffer.stamp, now) : buffer.not_before;
  const Duration readout = trusted && buffer.stamp_is_start ? Duration{} : timing_.interval;
  return stamp - readout - timing_.exposure.value_or(timing_.interval) -
         timing_.internal_frames * timing_.interval;
}

}  // namespace eigenpose
