#include "daemon/rig/frame_hub.h"

#include <chrono>

#include <spdlog/spdlog.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

/// A camera that gives nothing for so long has trouble; long exposures are shorter.
constexpr std::chrono::seconds frame_timeout{3};
constexpr std::chrono::seconds retry_pause{1};

std::string words(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const std::exception& error) {
    return error.what();
  }
}

/// Between two beats of the camera's thread; opening a camera and its first frame take longer.
constexpr std::chrono::seconds camera_turn_limit{10};
constexpr std::chrono::seconds open_allowance{60};
/// A wait on the condition is looked through so often, in case the camera's thread wakes nobody.
constexpr std::chrono::milliseconds frame_wait_step{200};
constexpr std::chrono::seconds longest_wait{1};

}  // namespace

/// One `exposed_after` under way: the camera must look until its frame has come. The hub's mutex is held
/// where it is made and where it ends.
class FrameHub::Demand {
 public:
  Demand(std::multiset<TimePoint>& demands, TimePoint since)
      : demands_(demands), place_(demands.insert(since)) {}
  Demand(const Demand&) = delete;
  Demand& operator=(const Demand&) = delete;
  ~Demand() { demands_.erase(place_); }

 private:
  std::multiset<TimePoint>& demands_;
  std::multiset<TimePoint>::iterator place_;
};

FrameHub::FrameHub(OpenCamera open, const Clock& clock, Heartbeat& heartbeat, OnChange on_change)
    : open_(std::move(open)), clock_(clock), on_change_(std::move(on_change)) {
  status_.configured = static_cast<bool>(open_);
  if (open_) {
    pulse_ = heartbeat.join("camera", camera_turn_limit);
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  } else {
    report_failure(std::make_exception_ptr(
        DeviceError("camera", "take a picture", "there is none: add [camera] to the configuration")));
  }
}

FrameHub::~FrameHub() = default;

FrameHub::OnDemand::OnDemand(FrameHub& hub) : hub_(hub) {
  const std::lock_guard lock(hub_.mutex_);
  ++hub_.on_demand_;
}

FrameHub::OnDemand::~OnDemand() {
  {
    const std::lock_guard lock(hub_.mutex_);
    --hub_.on_demand_;
  }
  hub_.changed_.notify_all();
}

std::optional<Frame> FrameHub::latest() const {
  const std::lock_guard lock(mutex_);
  return frame_;
}

Frame FrameHub::exposed_after(TimePoint since, TimePoint deadline, std::stop_token stop) const {
  std::unique_lock lock(mutex_);
  const Demand demand(demands_, since);
  changed_.notify_all();
  for (;;) {
    if (stop.stop_requested()) throw Interrupted();
    if (frame_ && !failure_ && frame_->exposure_start >= since) return *frame_;
    if (!open_ || (failure_ && clock_.now() >= deadline)) std::rethrow_exception(failure_);
    if (clock_.now() >= deadline)
      throw DeviceTimeout(status_.info ? status_.info->name : "camera", "take a picture",
                          "no frame was exposed after the axes came to rest");
    const std::uint64_t frames = frames_;
    const std::uint64_t failures = failures_;
    changed_.wait_for(lock, stop, frame_wait_step,
                      [&] { return frames_ != frames || failures_ != failures; });
  }
}

std::optional<Frame> FrameHub::next(std::uint64_t& cursor, std::stop_token stop) const {
  std::unique_lock lock(mutex_);
  const std::uint64_t failures = failures_;
  changed_.wait_for(lock, stop, longest_wait, [&] { return frames_ > cursor || failures_ != failures; });
  if (stop.stop_requested() || frames_ <= cursor) return std::nullopt;
  cursor = frames_;
  return frame_;
}

CameraStatus FrameHub::status() const {
  const std::lock_guard lock(mutex_);
  CameraStatus status = status_;
  if (frame_) {
    status.frame_sequence = frame_->sequence;
    status.frame_age = clock_.now() - frame_->exposure_start;
  }
  return status;
}

bool FrameHub::frame_is_wanted() const {
  if (on_demand_ == 0) return true;
  if (demands_.empty()) return false;
  return failure_ || !frame_ || frame_->exposure_start < *demands_.rbegin();
}

void FrameHub::run(const std::stop_token& stop) {
  std::unique_ptr<Camera> camera;
  while (!stop.stop_requested()) {
    pulse_.beat();
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait_for(lock, stop, longest_wait, [this] { return frame_is_wanted(); })) continue;
    }
    try {
      fetch(camera, stop);
    } catch (const Interrupted&) {
      return;
    } catch (const std::exception&) {
      if (camera) {
        const std::lock_guard lock(mutex_);
        status_.statistics = camera->statistics();  // it may fail because every frame is damaged
      }
      report_failure(std::current_exception());
      clock_.sleep_for(retry_pause, stop);
    }
  }
}

void FrameHub::fetch(std::unique_ptr<Camera>& camera, const std::stop_token& stop) {
  if (!camera) {
    pulse_.beat(open_allowance);
    camera = open_();
    const std::lock_guard lock(mutex_);
    status_.info = camera->info();
  }
  // A camera that was lost is looked for and opened again within this call.
  pulse_.beat(open_allowance);
  Frame frame = camera->next_frame(clock_.now() + frame_timeout, stop);
  {
    const std::lock_guard lock(mutex_);
    status_.statistics = camera->statistics();
  }
  publish(std::move(frame));
}

void FrameHub::publish(Frame frame) {
  bool found = false;
  {
    const std::lock_guard lock(mutex_);
    found = failure_ || !frame_;
    failure_ = nullptr;
    status_.error.reset();
    frame_ = std::move(frame);
    ++frames_;
  }
  changed_.notify_all();
  if (!found) return;
  spdlog::info("event=camera_found");
  if (on_change_) on_change_(std::nullopt);
}

void FrameHub::report_failure(const std::exception_ptr& failure) {
  const std::string text = words(failure);
  bool lost = false;
  bool fresh = false;
  {
    const std::lock_guard lock(mutex_);
    lost = !failure_;
    fresh = status_.error != text;
    failure_ = failure;
    status_.error = text;
    ++failures_;
  }
  changed_.notify_all();
  if (!open_) return;
  if (fresh) spdlog::error("event=camera_failed error=\"{}\"", text);
  if (lost && on_change_) on_change_(text);
}

}  // namespace eigenpose
