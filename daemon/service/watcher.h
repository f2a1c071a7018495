#pragma once

/// Watching: from frames to results, on a thread of its own.

#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "core/image/scene_change.h"
#include "core/recognition/recognizer.h"
#include "daemon/rig/frame_hub.h"
#include "daemon/rig/heartbeat.h"
#include "daemon/service/events.h"
#include "daemon/service/model_store.h"

namespace eigenpose {

struct WatcherOptions {
  bool enabled = true;
  /// For the search in one region: an outcome that took longer says that it is unfinished.
  Duration region_time = std::chrono::seconds(2);
  /// For the search in all regions of a frame together. Well below the time that the watcher's thread has
  /// between two beats (90 s), however much clutter stands there.
  Duration frame_time = std::chrono::seconds(30);
  SceneChangeOptions scene;  ///< when a picture counts as settled
};

/// Counts since the start.
struct WatchStatus {
  std::uint64_t frames = 0;        ///< looked at for change
  std::uint64_t recognitions = 0;  ///< settled scenes recognised
  /// The frame of the last result published, for as long as that result says what the newest frame shows.
  /// None before the first, while paused and until a result after it, and from a failure on until a result.
  std::optional<std::uint64_t> current_result;
  bool paused = false;               ///< by a Watcher::Pause
  double flicker = 0.0;              ///< amplitude of the light's flicker, 0.05 is ±5 % (see SceneChange)
  std::optional<std::string> error;  ///< why the last one could not be
};

/// Looks at the newest frame, always: when the picture changes it publishes that once; when it has settled it
/// recognises what stands there and publishes the result; a new model looks at the standing scene anew.
/// Nothing is published without a model, nor while paused. Thread-safe.
class Watcher {
 public:
  /// Starts the thread, if enabled. All references outlive the watcher.
  Watcher(const WatcherOptions& options, const FrameHub& camera, const ModelStore& models, EventSink& events,
          Heartbeat& heartbeat);
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;
  ~Watcher();

  /// Nothing is looked at or published while one lives: the rig moves on its own account. Making one waits
  /// for the look in progress.
  class Pause {
   public:
    explicit Pause(Watcher& watcher);
    Pause(const Pause&) = delete;
    Pause& operator=(const Pause&) = delete;
    ~Pause();

   private:
    Watcher& watcher_;
  };

  [[nodiscard]] WatchStatus status() const;

 private:
  void run(const std::stop_token& stop);
  SceneChange::Observation observe(const Frame& frame);
  void look(const Frame& frame, const std::stop_token& stop);
  void report_change(const Frame& frame);
  void report_settled(const Frame& frame, const std::stop_token& stop);
  void use_model(std::shared_ptr<const Model> model);
  void publish(SceneResult result);
  void forget_result();
  void note_failure(const std::exception& error);

  const FrameHub& camera_;
  const ModelStore& models_;
  EventSink& events_;
  const Duration region_time_;
  const Duration frame_time_;
  Heartbeat::Pulse pulse_;  ///< beaten on the watcher's thread
  std::mutex looking_;      ///< held while a frame is looked at
  int pauses_ = 0;          ///< guarded by looking_
  bool look_anew_ = false;  ///< guarded by looking_: the standing scene is not the one last looked at
  mutable std::mutex mutex_;
  WatchStatus status_;  ///< guarded by mutex_
  // The rest is touched on the watcher's thread only.
  SceneChange scene_;
  std::shared_ptr<const Model> model_;
  std::optional<Recognizer> recognizer_;
  bool fresh_model_ = false;       ///< the standing scene has not been looked at with it
  bool settled_reported_ = false;  ///< the last result published says what stands there
  std::jthread thread_;            ///< last: ends before the rest goes
};

}  // namespace eigenpose
