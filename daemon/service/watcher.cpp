#include "daemon/service/watcher.h"

#include <exception>
#include <span>

#include <spdlog/spdlog.h>

#include "daemon/api/result_json.h"

namespace eigenpose {
namespace {

SceneChangeOptions scene_options(const WatchOptions& options) {
  SceneChangeOptions scene;
  scene.settle = options.settle;
  scene.threshold = options.threshold;
  return scene;
}

}  // namespace

Watcher::Watcher(const WatchOptions& options, const FrameHub& camera, const ModelStore& models,
                 EventLog& results)
    : camera_(camera), models_(models), results_(results), scene_(scene_options(options)) {
  if (options.enabled) thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

Watcher::~Watcher() = default;

WatchStatus Watcher::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void Watcher::run(const std::stop_token& stop) {
  std::uint64_t cursor = 0;
  while (!stop.stop_requested()) {
    const std::optional<Frame> frame = camera_.next(cursor, stop);
    if (!frame) continue;
    if (pauses_ > 0) {
      scene_.reset();
      told_settled_ = false;
      continue;
    }
    try {
      look(*frame);
    } catch (const std::exception& error) {
      const std::lock_guard lock(mutex_);
      if (status_.error != error.what()) spdlog::error("event=recognition_failed error=\"{}\"", error.what());
      status_.error = error.what();
    }
  }
}

void Watcher::look(const Frame& frame) {
  const SceneChange::Observation seen = scene_.update(frame);
  {
    const std::lock_guard lock(mutex_);
    ++status_.frames;
  }
  if (auto model = models_.current(); model != model_) use_model(std::move(model));
  if (!recognizer_) return;
  if (seen.settled && (seen.changed || !told_settled_ || fresh_model_))
    report_settled(frame);
  else if (!seen.settled && seen.changed && told_settled_)
    report_change(frame);
}

void Watcher::use_model(std::shared_ptr<const Model> model) {
  model_ = std::move(model);
  recognizer_.reset();
  if (model_) recognizer_.emplace(model_);
  fresh_model_ = true;
}

void Watcher::report_change(const Frame& frame) {
  told_settled_ = false;
  Result result;
  result.state = Result::State::changing;
  result.frame = &frame;
  results_.publish([&](std::uint64_t sequence) { return result_json(result, sequence); });
}

void Watcher::report_settled(const Frame& frame) {
  // Whatever happens below, this scene has been looked at: a failure is told once, not thirty times a second.
  scene_.accept();
  told_settled_ = true;
  fresh_model_ = false;
  RecognitionTimes times;
  Result result;
  result.state = Result::State::settled;
  result.frame = &frame;
  result.model = model_.get();
  result.outcomes = recognizer_->recognize(frame.image, &times);
  result.times = times;
  const std::uint64_t number =
      results_.publish([&](std::uint64_t sequence) { return result_json(result, sequence); });
  spdlog::info("event=result sequence={} regions={} {}", number, result.outcomes.size(),
               result_words(result));
  const std::lock_guard lock(mutex_);
  ++status_.recognitions;
  status_.error.reset();
}

}  // namespace eigenpose
