#pragma once

/// The camera's thread: fetches frames all the time and keeps the newest for whoever wants it.

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>

#include "core/base/clock.h"
#include "core/image/frame.h"
#include "daemon/rig/heartbeat.h"
#include "drivers/camera.h"

namespace eigenpose {

/// The state of the camera as last seen.
struct CameraStatus {
  bool configured = false;
  std::optional<CameraInfo> info;  ///< once it was opened
  CameraStatistics statistics;
  std::optional<std::string> error;             ///< why there are no frames at the moment
  std::optional<std::uint64_t> frame_sequence;  ///< of the newest frame
  std::optional<Duration> frame_age;            ///< since the exposure of the newest frame began
};

/// Owns the camera: opens it, reopens it when it is lost, and hands every frame to many. Newest wins: nobody
/// who is slow makes the camera wait. Thread-safe.
class FrameHub {
 public:
  using OpenCamera = std::function<std::unique_ptr<Camera>()>;
  /// Called on the camera's thread when frames begin to come (without an error) and when they cease (with the
  /// reason), once each. Must be quick and must not throw.
  using OnChange = std::function<void(const std::optional<std::string>& error)>;

  /// Starts the thread; @param open is called on it, and again a second after each failure. Empty: there is
  /// no camera. Clock and heartbeat outlive the hub.
  FrameHub(OpenCamera open, const Clock& clock, Heartbeat& heartbeat, OnChange on_change = {});
  FrameHub(const FrameHub&) = delete;
  FrameHub& operator=(const FrameHub&) = delete;
  ~FrameHub();

  /// The newest frame, if there ever was one.
  [[nodiscard]] std::optional<Frame> latest() const;

  /// A frame of which no photon is older than `since`. @throws the camera's own DeviceError when it fails and
  /// `deadline` has passed, DeviceTimeout when it does not but no frame so new came, Interrupted on `stop`.
  [[nodiscard]] Frame exposed_after(TimePoint since, TimePoint deadline, std::stop_token stop) const;

  /// Waits for a frame newer than the one `cursor` stands for (0: any) and moves `cursor` on to it.
  /// @return nothing when `stop` was requested first, when the camera failed, or after a second; ask again.
  [[nodiscard]] std::optional<Frame> next(std::uint64_t& cursor, std::stop_token stop) const;

  /// While one lives, frames are fetched only when `exposed_after` waits for one: nobody looks at the others,
  /// and they cost time. The hub must outlive it.
  class OnDemand {
   public:
    explicit OnDemand(FrameHub& hub);
    OnDemand(const OnDemand&) = delete;
    OnDemand& operator=(const OnDemand&) = delete;
    ~OnDemand();

   private:
    FrameHub& hub_;
  };

  [[nodiscard]] CameraStatus status() const;

 private:
  class Demand;
  void run(const std::stop_token& stop);
  void fetch(std::unique_ptr<Camera>& camera, const std::stop_token& stop);
  [[nodiscard]] bool frame_is_wanted() const;
  void publish(Frame frame);
  void report_failure(const std::exception_ptr& failure);

  OpenCamera open_;
  const Clock& clock_;
  const OnChange on_change_;
  Heartbeat::Pulse pulse_;  ///< beaten on the camera's thread
  mutable std::mutex mutex_;
  mutable std::condition_variable_any changed_;
  std::optional<Frame> frame_;  ///< guarded by mutex_
  std::uint64_t frames_ = 0;    ///< guarded by mutex_: frames published so far
  std::uint64_t failures_ = 0;  ///< guarded by mutex_: so far
  std::exception_ptr failure_;  ///< guarded by mutex_: the present one
  CameraStatus status_;         ///< guarded by mutex_; age and sequence are filled in by `status`
  int on_demand_ = 0;           ///< guarded by mutex_: OnDemands alive
  mutable std::multiset<TimePoint>
      demands_;          ///< guarded by mutex_: `since` of each `exposed_after` under way
  std::jthread thread_;  ///< last: ends before the rest goes
};

}  // namespace eigenpose
