#include "core/evaluation/evaluation.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <mutex>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/statistics.h"
#include "core/base/work_meter.h"
#include "core/image/occlusion.h"
#include "core/learning/calibration/decision_calibration.h"
#include "core/learning/calibration/perturbation.h"

namespace eigenpose {
namespace {

constexpr double gross_error = 45.0;

/// One worker's recogniser and what it spent.
struct Worker {
  explicit Worker(const std::shared_ptr<const RecognitionIndex>& index) : recognizer(index) {}
  Recognizer recognizer;
  RecognitionTimes spent;
  Duration load_time{};
};

void add(RecognitionTimes& sum, const RecognitionTimes& part) {
  sum.segment += part.segment;
  sum.normalize += part.normalize;
  sum.project += part.project;
  sum.search += part.search;
  sum.total += part.total;
}

/// What the stages of an evaluation share.
struct Task {
  std::span<const ImageSet> sets;
  std::span<const SetView> tests;
  const EvaluationOptions& options;
  const Progress& progress;
  std::stop_token stop;
};

/// Sets what was said of the shown view, and the errors of its pose.
void record_outcome(const Outcome& outcome, std::span<const ImageSet> sets, RegionRecord& record) {
  record.verdict = outcome.verdict;
  record.evidence = outcome.evidence;
  record.required_evidence = outcome.required_evidence;
  record.confidence = outcome.confidence;
  if (!outcome.best) return;
  const auto said = std::ranges::find(sets, outcome.best->object, &ImageSet::object);
  record.said = static_cast<std::size_t>(said - sets.begin());
  record.said_q = outcome.best->q;
  if (!record.best_is_right()) return;
  const Dof& dof = sets[record.object].workspace()[0];
  const auto error = [&](const std::vector<double>& q) {
    return std::abs(dof.difference(q.front(), record.true_q.front()));
  };
  record.pose_error = error(outcome.best->q);
  if (outcome.other_pose) record.other_pose_error = error(outcome.other_pose->q);
}

/// Shows test number `index`.
RegionRecord recognize_one(Worker& worker, const Task& task, std::size_t index, bool known) {
  const SetView& test = task.tests[index];
  const ImageSet& set = task.sets[test.set];
  const TimePoint began = std::chrono::steady_clock::now();
  cv::Mat image = set.load(test.view);
  if (task.options.damage.any()) image = damaged(image, task.options.damage, index);
  worker.load_time += std::chrono::steady_clock::now() - began;
  RecognitionTimes times;
  const auto outcomes = worker.recognizer.recognize(image, &times);
  add(worker.spent, times);
  RegionRecord record;
  record.object = test.set;
  record.known = known;
  record.view = test.view;
  record.true_q = set.views()[test.view].q;
  const auto largest =
      std::ranges::max_element(outcomes, {}, [](const Outcome& outcome) { return outcome.box.area(); });
  if (largest != outcomes.end()) record_outcome(*largest, task.sets, record);
  return record;
}

/// The model without one of its objects, whose views have no part in the decision either.
std::shared_ptr<const Model> without_object(const Model& model, std::size_t object,
                                            const LearningReport& learning) {
  auto rest = std::make_shared<Model>(model);
  const auto at = static_cast<std::ptrdiff_t>(object);
  rest->decision = calibrate_decision(learning.probes, model.decision.set, object);
  rest->objects.erase(rest->objects.begin() + at);
  if (model.parts) {
    auto parts = std::make_shared<PartsModel>(*model.parts);
    parts->objects.erase(parts->objects.begin() + at);
    parts->poses.erase(parts->poses.begin() + at);
    parts->calibration.erase(parts->calibration.begin() + at);
    parts->view_poses.erase(parts->view_poses.begin() + at);
    if (!parts->colors.empty()) parts->colors.erase(parts->colors.begin() + at);
    if (!parts->extents.empty()) parts->extents.erase(parts->extents.begin() + at);
    rest->parts = std::move(parts);
  }
  return rest;
}

/// Shows every test view to the model with all objects.
void show_known(const std::shared_ptr<const RecognitionIndex>& index, const Task& task,
                EvaluationReport& report) {
  const EvaluationOptions& options = task.options;
  const unsigned threads = resolved_threads(options.threads);
  std::vector<Worker> workers;
  for (unsigned t = 0; t < threads; ++t) workers.emplace_back(index);
  report.records.resize(task.tests.size());
  WorkMeter meter(task.progress, task.stop, "recognising", task.tests.size());
  parallel_for(threads, threads, [&](std::size_t t) {
    for (std::size_t i = t; i < task.tests.size(); i += threads) {
      meter.check_stop();
      report.records[i] = recognize_one(workers[t], task, i, true);
      meter.finished(1);
    }
  });
  for (const Worker& worker : workers) {
    add(report.times, worker.spent);
    report.load_time += worker.load_time;
  }
}

/// Shows every test view to a model without its object.
void show_unknown(const Model& model, const Task& task, EvaluationReport& report) {
  const EvaluationOptions& options = task.options;
  std::vector<RegionRecord> records(task.tests.size());
  WorkMeter meter(task.progress, task.stop, "showing unknown objects", task.sets.size());
  parallel_for(task.sets.size(), options.threads, [&](std::size_t s) {
    Worker worker(std::make_shared<const RecognitionIndex>(without_object(model, s, report.learning),
                                                           options.recognizer));
    for (std::size_t i = 0; i < task.tests.size(); ++i) {
      if (task.tests[i].set != s) continue;
      meter.check_stop();
      records[i] = recognize_one(worker, task, i, false);
    }
    meter.finished(1);
  });
  std::ranges::move(records, std::back_inserter(report.records));
}

/// Counts the records, of all objects and of each.
void count_records(EvaluationReport& report) {
  report.counts = count_answers(report.records);
  for (const RegionRecord& record : report.records) {
    ObjectEvaluation& object = report.objects[record.object];
    object.counts.add(record);
    if (record.pose_error) object.pose_errors.push_back(*record.pose_error);
  }
}

/// Shows scenes composed of test views.
SceneReport show_scenes(const std::shared_ptr<const RecognitionIndex>& index, const Task& task) {
  const EvaluationOptions& options = task.options;
  SceneReport report;
  std::mutex mutex;  // guards report
  WorkMeter meter(task.progress, task.stop, "composing scenes", options.scenes.count);
  const unsigned threads = resolved_threads(options.threads);
  parallel_for(threads, threads, [&](std::size_t t) {
    SceneComposer composer(task.sets, task.tests, options.scenes, index->model().normalization.segmentation);
    Recognizer recognizer(index);
    for (std::size_t i = t; i < options.scenes.count; i += threads) {
      meter.check_stop();
      const ComposedScene scene = composer.compose(i);
      if (!scene.objects.empty()) {
        const auto outcomes = recognizer.recognize(scene.picture);
        const std::lock_guard lock(mutex);
        count_scene(scene, task.sets, outcomes, report);
      }
      meter.finished(1);
    }
  });
  return report;
}

/// @throws std::invalid_argument for what the sets cannot show, before anything is learned.
void check_possible(std::span<const ImageSet> sets, const EvaluationOptions& options) {
  if (options.leave_one_out && sets.size() < 2)
    throw std::invalid_argument("leaving one object out needs at least two objects, there is one");
  if (options.scenes.count > 0 && std::ranges::all_of(sets, &ImageSet::cropped))
    throw std::invalid_argument(
        "scenes are composed of objects that are cut out of their views, and all views here are cropped: "
        "import them as scenes");
}

}  // namespace

cv::Mat damaged(const cv::Mat& picture, const TestDamage& damage, std::size_t index) {
  SeededRandom random(damage.seed * 1000003U + static_cast<std::uint32_t>(index));
  const Perturbation bounds{damage.shift / 128.0, damage.scale, damage.rotation_deg};
  // Drawn whether used or not: a kind of damage that is added leaves the others as they were.
  const Misalignment misalignment = bounds.draw(random);
  const double across = random.unit();
  const double down = random.unit();
  const bool displace = damage.shift > 0 || damage.scale > 0 || damage.rotation_deg > 0;
  cv::Mat result = displace ? displaced(picture, misalignment) : picture.clone();
  if (damage.occlusion > 0) hide_square(result, damage.occlusion, across, down);
  return result;
}

ViewSplit split_views(const ImageSet& set, std::size_t learn_every, std::size_t offset) {
  if (learn_every < 2 || offset >= learn_every)
    throw std::invalid_argument("learn every " + std::to_string(learn_every) + "-th view from view " +
                                std::to_string(offset) +
                                ": the first must be at least 2, the second below it");
  std::vector<double> values;
  for (const ViewRecord& view : set.views()) values.push_back(view.q.front());
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  ViewSplit split;
  for (std::size_t i = 0; i < set.views().size(); ++i) {
    const auto at = std::lower_bound(values.begin(), values.end(), set.views()[i].q.front()) - values.begin();
    (static_cast<std::size_t>(at) % learn_every == offset ? split.learned : split.tested).push_back(i);
  }
  return split;
}

EvaluationReport::PoseErrors summarize_errors(std::vector<double> errors) {
  EvaluationReport::PoseErrors result;
  if (errors.empty()) return result;
  std::sort(errors.begin(), errors.end());
  const std::size_t n = errors.size();
  result.mean = std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(n);
  result.median = n % 2 == 1 ? errors[n / 2] : 0.5 * (errors[n / 2 - 1] + errors[n / 2]);
  result.p90 = errors[std::min(n - 1, static_cast<std::size_t>(std::ceil(0.9 * static_cast<double>(n))) - 1)];
  const auto gross = std::count_if(errors.begin(), errors.end(), [](double e) { return e > gross_error; });
  result.gross_rate = static_cast<double>(gross) / static_cast<double>(n);
  return result;
}

std::vector<std::string> EvaluationReport::object_names() const {
  std::vector<std::string> names;
  for (const ObjectEvaluation& object : objects) names.push_back(object.object);
  return names;
}

EvaluationReport::PoseErrors EvaluationReport::pose_errors() const {
  std::vector<double> all;
  for (const ObjectEvaluation& object : objects)
    all.insert(all.end(), object.pose_errors.begin(), object.pose_errors.end());
  return summarize_errors(std::move(all));
}

EvaluationReport evaluate(std::span<const ImageSet> sets, const EvaluationOptions& options,
                          const Progress& progress, std::stop_token stop) {
  check_possible(sets, options);
  EvaluationReport report;
  std::vector<TrainingSet> training;
  std::vector<SetView> tests;
  for (std::size_t s = 0; s < sets.size(); ++s) {
    ViewSplit split = split_views(sets[s], options.learn_every, options.offset);
    for (const std::size_t view : split.tested) tests.push_back({s, view});
    training.push_back({&sets[s], std::move(split.learned)});
  }
  if (tests.empty()) throw std::invalid_argument("no view is left to test on; there are too few views");
  LearningOptions learning = options.learning;
  learning.bad_views = BadViews::refuse;  // objects are counted as their sets are: none may be missing
  const auto model =
      std::make_shared<const Model>(learn(training, learning, &report.learning, progress, stop));
  for (std::size_t s = 0; s < sets.size(); ++s) {
    ObjectEvaluation object;
    object.object = sets[s].object();
    object.learned_views = training[s].views.size();
    object.pose_observable = model->objects[s].pose_observable;
    report.objects.push_back(std::move(object));
  }

  const Task task{sets, tests, options, progress, std::move(stop)};
  const auto index = std::make_shared<const RecognitionIndex>(model, options.recognizer);
  show_known(index, task, report);
  report.smallest_rate = model->decision.smallest_rate();
  for (std::size_t o = 0; o < model->objects.size(); ++o) report.model_bytes += model->memory(o);
  report.model_bytes /= model->objects.size();
  if (options.leave_one_out) show_unknown(*model, task, report);
  count_records(report);
  if (options.scenes.count > 0) report.scenes = show_scenes(index, task);
  return report;
}

}  // namespace eigenpose
