#pragma once

/// A camera of the Linux kernel (V4L2), spoken to directly.

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "drivers/camera.h"
#include "drivers/v4l2/camera_controls.h"
#include "drivers/v4l2/capture_mode.h"
#include "drivers/v4l2/frame_ledger.h"
#include "drivers/v4l2/frame_pool.h"
#include "drivers/v4l2/video_system.h"

namespace eigenpose {

/// Which camera is meant. What is empty does not matter; all empty means the only camera there is.
struct CameraSelector {
  std::string serial;    ///< USB serial number: follows the camera from socket to socket
  std::string bus_path;  ///< VideoNode::bus_info or ::port: stays with the socket
  std::string name;      ///< VideoNode::name
  std::string node;  ///< "/dev/video0"; changes with the order of plugging in, so only for trying things out
};

/// Whether `node` is one of the device that is meant. Of a node that may not be opened the bus path may be
/// not known: then it decides nothing.
bool is_meant(const VideoNode& node, CameraSelector selector);

/// The camera meant among `nodes`; of several nodes of one device the first. @throws DeviceLost when there is
/// none, DeviceError when several devices fit or the node may not be opened; the text lists what is there.
const VideoNode& find_camera(const std::vector<VideoNode>& nodes, const CameraSelector& selector,
                             const std::string& device_name);

struct V4l2CameraOptions {
  std::string name = "camera";  ///< the configuration's name for it
  CameraSelector selector;
  ModeWishes mode;
  /// By V4L2 name. A control the camera does not have, or refuses, is an error at the first opening.
  std::map<std::string, std::int64_t> controls;
  /// Automatic exposure, gain, white balance and focus are turned off and stay off: brightness is evidence.
  bool lock_automatics = true;
  std::optional<int> input;                        ///< of a frame grabber; otherwise left as it is
  unsigned buffers = 4;                            ///< 3 or more
  Duration stall_after = std::chrono::seconds(2);  ///< no frame for so long: closed and opened anew
  int internal_frames =
      1;  ///< whole frames the camera may hold before it sends them; makes `exposure_start` earlier
  /// Facts worth a line in a log: opened, granted, lost, found. Called on the camera's thread.
  std::function<void(const std::string&)> log;
};

/// What was asked and what was given at the latest opening.
struct OpeningReport {
  VideoNode node;
  CaptureMode requested;  ///< the best of what the camera offers
  CaptureMode granted;
  std::vector<ControlResult> controls;
};

/// See Camera for the threads. `next_frame` hands out pictures of its own (pooled) memory.
///
/// Newest wins: all filled buffers are taken, the newest is decoded. If the driver had run out of buffers,
/// those are old; then the next frame is waited for, up to two intervals. A stream that breaks (EIO) is
/// opened anew within the call. A camera that is gone (ENODEV) or silent for `stall_after` is closed and
/// DeviceLost thrown; later calls look for it, wait for it until their deadline, open it and set every
/// control as it was.
class V4l2Camera final : public Camera {
 public:
  /// Opens the camera. `system` and `clock` must outlive it. @throws DeviceLost when it is not there;
  /// DeviceError.
  V4l2Camera(V4l2CameraOptions options, VideoSystem& system, const Clock& clock);
  ~V4l2Camera() override;

  [[nodiscard]] const CameraInfo& info() const override { return info_; }
  Frame next_frame(TimePoint deadline, std::stop_token stop) override;
  [[nodiscard]] CameraStatistics statistics() const override;

  [[nodiscard]] const OpeningReport& report() const { return report_; }

 private:
  struct Session;
  struct Candidate;

  std::unique_ptr<Session> open_session();
  void choose_input(VideoDevice& device) const;
  /// Format, size and rate, and the decoder for them.
  void set_mode(Session& session, OpeningReport& report) const;
  void set_controls(CameraControls& controls, OpeningReport& report) const;
  void describe_session(const Session& session, const OpeningReport& report, const CameraControls& controls);
  /// What to set again after the camera was lost.
  void remember_controls(const CameraControls& controls);
  void note_opening() const;
  void reopen(TimePoint deadline, const std::stop_token& stop);
  Frame frame_from_session(TimePoint deadline, const std::stop_token& stop);
  /// Takes all filled buffers and keeps the newest good one in `newest`. @return true if every buffer was
  /// filled.
  bool drain(std::optional<Candidate>& newest);
  /// Makes a frame of `newest` and gives its buffer back. @return nothing if it is damaged.
  std::optional<Frame> decode(std::optional<Candidate>& newest);
  /// Gives the buffer back unseen.
  void set_aside(std::optional<Candidate>& newest);
  void count(std::uint64_t CameraStatistics::*what, std::uint64_t by = 1);
  void count_damaged(FrameFault fault);
  /// "3 cut short, 1 too short": the damaged frames since `before`; empty when there were none.
  [[nodiscard]] std::string damage_since(const CameraStatistics& before) const;
  void note(const std::string& text) const;

  V4l2CameraOptions options_;
  VideoSystem& system_;
  const Clock& clock_;
  WakeUp wake_up_;
  FramePool pool_;
  FrameLedger ledger_;
  CameraInfo info_;
  OpeningReport report_;
  std::map<std::string, std::int64_t>
      locked_controls_;               ///< as found after the first opening; set again after each loss
  std::unique_ptr<Session> session_;  ///< nothing while lost
  std::uint64_t last_number_ = 0;     ///< of the last frame the device took
  Duration waited_{};                 ///< without any frame
  unsigned empty_wakes_ = 0;          ///< in a row

  mutable std::mutex mutex_;
  CameraStatistics statistics_;  ///< guarded by mutex_
};

}  // namespace eigenpose
