#include "core/recognition/evaluation.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <numeric>
#include <stdexcept>

#include "core/base/error.h"
#include "core/base/parallel.h"

namespace eigenpose {
namespace {

constexpr double gross_error = 45.0;

/// One view to be recognised.
struct Test {
  std::size_t set = 0;
  std::size_t view = 0;
};

/// What came of it.
struct Answer {
  std::string said;  ///< empty: nothing found
  Verdict verdict = Verdict::unknown;
  double pose_error = 0.0;
};

/// One worker's recogniser and what it spent.
struct Worker {
  explicit Worker(const std::shared_ptr<const Model>& model) : recognizer(model) {}
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

Answer recognize_one(Worker& worker, const ImageSet& set, std::size_t view) {
  const TimePoint began = std::chrono::steady_clock::now();
  const cv::Mat image = set.load(view);
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

}  // namespace

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
  std::vector<Test> tests;
  for (std::size_t s = 0; s < sets.size(); ++s) {
    ViewSplit split = split_views(sets[s], options.learn_every, options.offset);
    for (const std::size_t view : split.tested) tests.push_back({s, view});
    training.push_back({&sets[s], std::move(split.learned)});
  }
  if (tests.empty()) throw std::invalid_argument("no view is left to test on; there are too few views");
  const auto model =
      std::make_shared<const Model>(learn(training, options.learning, &report.learning, progress, stop));
  for (std::size_t s = 0; s < sets.size(); ++s) {
    ObjectEvaluation object;
    object.object = sets[s].object();
    object.learned_views = training[s].views.size();
    object.pose_observable = model->objects[s].pose_observable;
    report.objects.push_back(std::move(object));
  }

  const unsigned threads = resolved_threads(options.threads);
  std::vector<Worker> workers;
  for (unsigned t = 0; t < threads; ++t) workers.emplace_back(model);
  std::vector<Answer> answers(tests.size());
  std::mutex progress_mutex;
  std::size_t done = 0;  // guarded by progress_mutex
  parallel_for(threads, threads, [&](std::size_t t) {
    for (std::size_t i = t; i < tests.size(); i += threads) {
      if (stop.stop_requested()) throw Interrupted();
      answers[i] = recognize_one(workers[t], sets[tests[i].set], tests[i].view);
      const std::lock_guard lock(progress_mutex);
      if (progress) progress({"recognising", ++done, tests.size()});
    }
  });
  for (std::size_t i = 0; i < tests.size(); ++i) count(report, report.objects[tests[i].set], answers[i]);
  for (const Worker& worker : workers) {
    add(report.times, worker.spent);
    report.load_time += worker.load_time;
  }
  return report;
}

}  // namespace eigenpose
