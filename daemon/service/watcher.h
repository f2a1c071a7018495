#pragma once

/// Watching: from frames to results, on a thread of its own.

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "core/image/scene_change.h"
#include "core/recognition/recognizer.h"
#include "daemon/rig/frame_hub.h"
#include "daemon/service/events.h"
#include "daemon/service/model_store.h"

namespace eigenpose {

struct WatcherOptions {
  bool enabled = true;
  SceneChangeOptions scene;  ///< when a picture counts as settled
};

/// Counts since the start.
struct WatchStatus {
  std::uint64_t frames = 0;          ///< looked at for change
  std::uint64_t recognitions = 0;    ///< settled scenes recognised
  std::optional<std::string> error;  ///< why the last one could not be
};

/// Looks at the newest frame, always: when the picture changes it says so once; when it has settled it
/// recognises what stands there and publishes the result; a new model looks at the standing scene anew.
/// Nothing is published without a model, nor while paused. Thread-safe.
class Watcher {
 public:
  /// Starts the thread, if enabled. Camera, models and events outlive the watcher.
  Watcher(const WatcherOptions& options, const FrameHub& camera, const ModelStore& models, EventSink& events);
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;
  ~Watcher();

  /// While the rig moves on its own account nothing is watched. Pauses add up.
  class Pause {
   public:
    explicit Pause(Watcher& watcher) : watcher_(watcher) { ++watcher_.pauses_; }
    Pause(const Pause&) = delete;
    Pause& operator=(const Pause&) = delete;
    ~Pause() { --watcher_.pauses_; }

   private:
    Watcher& watcher_;
  };

  [[nodiscard]] WatchStatus status() const;

 private:
  void run(const std::stop_token& stop);
  void look(const Frame& frame);
  void report_change(const Frame& frame);
  void report_settled(const Frame& frame);
  void use_model(std::shared_ptr<const Model> model);

  const FrameHub& camera_;
  const ModelStore& models_;
  EventSink& events_;
  std::atomic<int> pauses_{0};
  mutable std::mutex mutex_;
  WatchStatus status_;  ///< guarded by mutex_
  // The rest is touched on the watcher's thread only.
  SceneChange scene_;
  std::shared_ptr<const Model> model_;
  std::optional<Recognizer> recognizer_;
  bool fresh_model_ = false;   ///< the standing scene has not been looked at with it
  bool told_settled_ = false;  ///< the last result says what stands there
  std::jthread thread_;        ///< last: ends before the rest goes
};

}  // namespace eigenpose
