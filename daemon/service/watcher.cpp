#include "daemon/service/watcher.h"

#include <exception>
#include <span>
#include <utility>

#include <spdlog/spdlog.h>

namespace eigenpose {
namespace {

/// Between two beats of the watcher's thread: a frame with much clutter takes seconds to recognise, and a
/// model of many objects to take up.
constexpr std::chrono::seconds watcher_look_limit{90};

}  // namespace

Watcher::Watcher(const WatcherOptions& options, const FrameHub& camera, const ModelStore& models,
                 EventSink& events, Heartbeat& heartbeat)
    : camera_(camera),
      models_(models),
      events_(events),
      region_time_(options.region_time),
      frame_time_(options.frame_time),
      scene_(options.scene) {
  if (!options.enabled) return;
  pulse_ = heartbeat.join("watcher", watcher_look_limit);
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

Watcher::~Watcher() = default;

Watcher::Pause::Pause(Watcher& watcher) : watcher_(watcher) {
  const std::lock_guard lock(watcher_.looking_);
  ++watcher_.pauses_;
  const std::lock_guard status_lock(watcher_.mutex_);
  watcher_.status_.paused = true;
  watcher_.status_.current_result.reset();
}

Watcher::Pause::~Pause() {
  const std::lock_guard lock(watcher_.looking_);
  --watcher_.pauses_;
  watcher_.look_anew_ = true;
  const std::lock_guard status_lock(watcher_.mutex_);
  watcher_.status_.paused = watcher_.pauses_ > 0;
}

WatchStatus Watcher::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void Watcher::run(const std::stop_token& stop) {
  std::uint64_t cursor = 0;
  while (!stop.stop_requested()) {
    pulse_.beat();
    const std::optional<Frame> frame = camera_.next(cursor, stop);
    if (!frame) continue;
    const std::lock_guard lock(looking_);
    if (pauses_ > 0) continue;
    if (std::exchange(look_anew_, false)) {
      scene_.reset();
      settled_reported_ = false;
    }
    try {
      look(*frame, stop);
    } catch (const std::exception& error) {
      note_failure(error);
    }
  }
}

void Watcher::note_failure(const std::exception& error) {
  const std::lock_guard lock(mutex_);
  if (status_.error != error.what()) spdlog::error("event=recognition_failed error=\"{}\"", error.what());
  status_.error = error.what();
  status_.current_result.reset();
}

void Watcher::forget_result() {
  const std::lock_guard lock(mutex_);
  status_.current_result.reset();
}

void Watcher::publish(SceneResult result) {
  const std::uint64_t frame = result.frame.sequence;
  events_.publish(std::move(result));
  const std::lock_guard lock(mutex_);
  status_.current_result = frame;
}

SceneChange::Observation Watcher::observe(const Frame& frame) {
  try {
    return scene_.update(frame);
  } catch (...) {
    look_anew_ = true;  // what was known of the scene is of no use
    throw;
  }
}

void Watcher::look(const Frame& frame, const std::stop_token& stop) {
  const SceneChange::Observation seen = observe(frame);
  {
    const std::lock_guard lock(mutex_);
    ++status_.frames;
    status_.flicker = scene_.flicker();
  }
  if (auto model = models_.current(); model != model_) use_model(std::move(model));
  if (!recognizer_) return;
  if (seen.settled && (seen.changed || !settled_reported_ || fresh_model_))
    report_settled(frame, stop);
  else if (!seen.settled && seen.changed && settled_reported_)
    report_change(frame);
}

void Watcher::use_model(std::shared_ptr<const Model> model) {
  model_ = std::move(model);
  recognizer_.reset();
  if (model_) recognizer_.emplace(model_);
  fresh_model_ = true;
}

void Watcher::report_change(const Frame& frame) {
  settled_reported_ = false;
  SceneResult result;
  result.state = SceneResult::State::changing;
  result.frame = {frame.sequence, frame.exposure_start};
  result.time = std::chrono::system_clock::now();
  publish(std::move(result));
}

void Watcher::report_settled(const Frame& frame, const std::stop_token& stop) {
  // Whatever happens below, this scene has been looked at: a failure is reported once, not with every frame.
  scene_.accept();
  settled_reported_ = true;
  fresh_model_ = false;
  forget_result();
  SceneResult result;
  result.frame = {frame.sequence, frame.exposure_start};
  result.model = model_;
  RecognitionTimes times;
  const std::span<const Outcome> outcomes = recognizer_->recognize(
      frame.image, {.stop = stop, .region_time = region_time_, .frame_time = frame_time_}, &times);
  if (stop.stop_requested()) return;  // what was found so far is not the whole scene
  result.outcomes.assign(outcomes.begin(), outcomes.end());
  result.times = times;
  result.time = std::chrono::system_clock::now();
  spdlog::info("event=result frame={} regions={} {}", frame.sequence, result.outcomes.size(),
               log_text(result));
  publish(std::move(result));
  const std::lock_guard lock(mutex_);
  ++status_.recognitions;
  status_.error.reset();
}

}  // namespace eigenpose
