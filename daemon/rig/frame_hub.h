#pragma once

/// The camera's thread: fetches frames all the time and keeps the newest for whoever wants it.

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "core/base/clock.h"
#include "core/image/frame.h"
#include "drivers/camera.h"

namespace eigenpose {

/// What a person may know about the camera now.
struct CameraStatus {
  bool configured = false;
  std::optional<CameraInfo> info;  ///< once it was opened
  CameraStatistics statistics;
  std::optional<std::string> error;  ///< why there are no frames at the moment
};

/// Owns the camera: opens it, reopens it when it is lost, and hands every frame to many. Newest wins: nobody
/// who is slow makes the camera wait. Thread-safe.
class FrameHub {
 public:
  using OpenCamera = std::function<std::unique_ptr<Camera>()>;

  /// Starts the thread; @param open is called on it, and again a second after each failure. Empty: there is
  /// no camera. The clock must outlive the hub.
  FrameHub(OpenCamera open, const Clock& clock);
  FrameHub(const FrameHub&) = delete;
  FrameHub& operator=(const FrameHub&) = delete;
  ~FrameHub();

  /// The newest frame, if there ever was one.
  [[nodiscard]] std::optional<Frame> latest() const;

  /// A frame of which no photon is older than `since`. @throws the camera's own DeviceError when there is
  /// trouble and `deadline` has passed, DeviceTimeout when frames come but none so new, Interrupted on
  /// `stop`.
  [[nodiscard]] Frame exposed_after(TimePoint since, TimePoint deadline, std::stop_token stop) const;

  /// Waits for a frame newer than the one `cursor` stands for (0: any) and moves `cursor` on to it.
  /// @return nothing when `stop` was requested first, or when the camera has trouble; ask again.
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
  void run(const std::stop_token& stop);
  void publish(Frame frame);
  void report_trouble(const std::exception_ptr& failure);

  OpenCamera open_;
  const Clock& clock_;
  mutable std::mutex mutex_;
  mutable std::condition_variable_any changed_;
  std::optional<Frame> frame_;  ///< guarded by mutex_
  std::uint64_t frames_ = 0;    ///< guarded by mutex_: frames published so far
  std::uint64_t troubles_ = 0;  ///< guarded by mutex_: failures so far
  std::exception_ptr trouble_;  ///< guarded by mutex_: the present one
  CameraStatus status_;         ///< guarded by mutex_
  int on_demand_ = 0;           ///< guarded by mutex_: OnDemands alive
  mutable int waiting_ = 0;     ///< guarded by mutex_: threads in `exposed_after`
  std::jthread thread_;         ///< last: ends before the rest goes
};

}  // namespace eigenpose
