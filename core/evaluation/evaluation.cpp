#include "core/evaluation/evaluation.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>
#include <numbers>
#include <numeric>
#include <random>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/image/occlusion.h"

namespace eigenpose {
namespace {

constexpr double gross_error = 45.0;

/// What came of it.
struct Answer {
  std::string said;  ///< empty: nothing found
  Verdict verdict = Verdict::unknown;
  double pose_error = 0.0;
};

/// One worker's recogniser and what it spent.
struct Worker {
  Worker(const std::shared_ptr<const Model>& model, const RecognizerOptions& options)
      : recognizer(model, options) {}
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

Answer recognize_one(Worker& worker, const ImageSet& set, std::size_t view, const TestDamage& damage,
                     std::size_t index) {
  const TimePoint began = std::chrono::steady_clock::now();
  cv::Mat image = set.load(view);
  if (damage.any()) image = damaged(image, damage, index);
  worker.load_time += std::chrono::steady_clock::now() - began;
  RecognitionTimes times;
  const auto outcomes = worker.recognizer.recognize(image, &times);
  add(worker.spent, times);
  const auto largest =
      std::max_element(outcomes.begin(), outcomes.end(),
                       [](const Outcome& a, const Outcome& b) { return a.box.area() < b.box.area(); });
  if (largest == outcomes.end() || !largest->best) return {};
  Answer answer{largest->best->object, largest->verdict, 0.0};
  if (answer.said == set.object())
    answer.pose_error =
        std::abs(set.workspace()[0].difference(largest->best->q.front(), set.views()[view].q.front()));
  return answer;
}

void count(EvaluationReport& report, ObjectEvaluation& object, const Answer& answer) {
  ++object.test_views;
  ++report.test_views;
  if (answer.said != object.object) {
    if (answer.said.empty()) ++object.missed;
    ++report.confusions[{object.object, answer.said.empty() ? "(nothing)" : answer.said}];
    return;
  }
  ++object.right;
  ++report.right;
  object.pose_errors.push_back(answer.pose_error);
  if (answer.verdict == Verdict::ambiguous) {
    ++object.ambiguous;
    ++report.ambiguous;
  } else if (answer.verdict != Verdict::recognized) {
    ++object.rejected;
    ++report.rejected;
  }
}

/// The model without one of its objects, whose views have no part in the thresholds either.
std::shared_ptr<const Model> without_object(const Model& model, std::size_t object,
                                            const LearningReport& learning,
                                            const MatchCalibrationOptions& options) {
  auto rest = std::make_shared<Model>(model);
  const auto at = static_cast<std::ptrdiff_t>(object);
  rest->objects.erase(rest->objects.begin() + at);
  if (model.parts) {
    auto parts = std::make_shared<PartsModel>(*model.parts);
    const MatchThresholds thresholds = match_thresholds(learning.match, options, object);
    parts->sure_ratio = thresholds.sure_ratio;
    parts->covered_evidence = occlusion_threshold(learning.covered, options.stranger_rate, object);
    for (std::size_t o = 0; o < learning.match.size(); ++o) {
      PartsCalibration& own = parts->calibration[o];
      own.rejection_distance = thresholds.rejection_distance[o];
      own.sure_distance = thresholds.sure_distance[o];
    }
    parts->objects.erase(parts->objects.begin() + at);
    parts->poses.erase(parts->poses.begin() + at);
    parts->calibration.erase(parts->calibration.begin() + at);
    if (!parts->extents.empty()) parts->extents.erase(parts->extents.begin() + at);
    rest->parts = std::move(parts);
  }
  return rest;
}

/// Shows every test view to a model without its object.
void show_strangers(const std::shared_ptr<const Model>& model, std::span<const ImageSet> sets,
                    std::span<const SetView> tests, const EvaluationOptions& options,
                    EvaluationReport& report, const Progress& progress, const std::stop_token& stop) {
  if (sets.size() < 2)
    throw std::invalid_argument("leaving one object out needs at least two objects, there is one");
  std::vector<std::size_t> accepted(sets.size(), 0);
  std::vector<std::size_t> shown(sets.size(), 0);
  std::atomic<std::size_t> done = 0;
  parallel_for(sets.size(), options.threads, [&](std::size_t s) {
    Worker worker(without_object(*model, s, report.learning, options.learning.match), options.recognizer);
    for (std::size_t i = 0; i < tests.size(); ++i) {
      if (tests[i].set != s) continue;
      if (stop.stop_requested()) throw Interrupted();
      const Answer answer = recognize_one(worker, sets[s], tests[i].view, options.damage, i);
      ++shown[s];
      if (answer.verdict == Verdict::recognized || answer.verdict == Verdict::ambiguous) ++accepted[s];
    }
    if (progress) progress({"showing strangers", ++done, sets.size()});
  });
  report.strangers = std::accumulate(shown.begin(), shown.end(), std::size_t{0});
  report.false_accepts = std::accumulate(accepted.begin(), accepted.end(), std::size_t{0});
}

SceneReport show_scenes(const std::shared_ptr<const Model>& model, std::span<const ImageSet> sets,
                        std::span<const SetView> tests, const EvaluationOptions& options,
                        const Progress& progress, const std::stop_token& stop) {
  SceneReport report;
  std::mutex mutex;  // guards report and progress
  const unsigned threads = resolved_threads(options.threads);
  parallel_for(threads, threads, [&](std::size_t t) {
    SceneComposer composer(sets, tests, options.scenes, model->normalization.segmentation);
    Recognizer recognizer(model, options.recognizer);
    for (std::size_t i = t; i < options.scenes.count; i += threads) {
      if (stop.stop_requested()) throw Interrupted();
      const ComposedScene scene = composer.compose(i);
      if (scene.objects.empty()) continue;
      const auto outcomes = recognizer.recognize(scene.picture);
      const std::lock_guard lock(mutex);
      count_scene(scene, sets, outcomes, report);
      if (progress) progress({"composing scenes", report.scenes, options.scenes.count});
    }
  });
  return report;
}

}  // namespace

cv::Mat damaged(const cv::Mat& picture, const TestDamage& damage, std::size_t index) {
  // std::uniform_real_distribution differs between libraries; the generator does not.
  std::mt19937 random(damage.seed * 1000003U + static_cast<unsigned>(index));
  const auto each_way = [&] { return static_cast<double>(random()) / 2147483648.0 - 1.0; };
  const double dx = damage.shift * each_way() * picture.cols / 128.0;
  const double dy = damage.shift * each_way() * picture.cols / 128.0;
  const double scale = 1.0 + damage.scale * each_way();
  const double turn = damage.rotation_deg * each_way() * std::numbers::pi / 180.0;
  const double across = 0.5 * (each_way() + 1.0);
  const double down = 0.5 * (each_way() + 1.0);
  cv::Mat result;
  if (damage.shift > 0 || damage.scale > 0 || damage.rotation_deg > 0) {
    const double cosine = scale * std::cos(turn);
    const double sine = scale * std::sin(turn);
    const double x = 0.5 * picture.cols - 0.5;
    const double y = 0.5 * picture.rows - 0.5;
    const cv::Matx23d map(cosine, -sine, x + dx - cosine * x + sine * y, sine, cosine,
                          y + dy - sine * x - cosine * y);
    cv::warpAffine(picture, result, map, picture.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  } else {
    result = picture.clone();
  }
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

double EvaluationReport::recognition_rate() const {
  return test_views == 0 ? 0.0 : static_cast<double>(right) / static_cast<double>(test_views);
}

EvaluationReport::PoseErrors EvaluationReport::pose_errors() const {
  std::vector<double> all;
  for (const ObjectEvaluation& object : objects)
    all.insert(all.end(), object.pose_errors.begin(), object.pose_errors.end());
  return summarize_errors(std::move(all));
}

EvaluationReport evaluate(std::span<const ImageSet> sets, const EvaluationOptions& options,
                          const Progress& progress, std::stop_token stop) {
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

  const unsigned threads = resolved_threads(options.threads);
  std::vector<Worker> workers;
  for (unsigned t = 0; t < threads; ++t) workers.emplace_back(model, options.recognizer);
  std::vector<Answer> answers(tests.size());
  std::mutex progress_mutex;
  std::size_t done = 0;  // guarded by progress_mutex
  parallel_for(threads, threads, [&](std::size_t t) {
    for (std::size_t i = t; i < tests.size(); i += threads) {
      if (stop.stop_requested()) throw Interrupted();
      answers[i] = recognize_one(workers[t], sets[tests[i].set], tests[i].view, options.damage, i);
      const std::lock_guard lock(progress_mutex);
      if (progress) progress({"recognising", ++done, tests.size()});
    }
  });
  for (std::size_t i = 0; i < tests.size(); ++i) count(report, report.objects[tests[i].set], answers[i]);
  for (const Worker& worker : workers) {
    add(report.times, worker.spent);
    report.load_time += worker.load_time;
  }
  if (model->parts) report.smallest_rate = model->parts->smallest_rate;
  for (std::size_t o = 0; o < model->objects.size(); ++o) report.model_bytes += model->memory(o);
  report.model_bytes /= model->objects.size();
  if (options.leave_one_out) show_strangers(model, sets, tests, options, report, progress, stop);
  if (options.scenes.count > 0) report.scenes = show_scenes(model, sets, tests, options, progress, stop);
  return report;
}

}  // namespace eigenpose
