#include "daemon/cli/evaluation_report.h"

#include <cstdio>
#include <string>

namespace eigenpose::cli {
namespace {

using nlohmann::ordered_json;

double milliseconds(Duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

double micro_per_view(Duration duration, std::size_t views) {
  return 1e3 * milliseconds(duration) / static_cast<double>(views);
}

ordered_json or_null(const std::optional<double>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json scenes_json(const SceneReport& scenes) {
  const auto pose = summarize_errors(scenes.pose_errors);
  return {{"scenes", scenes.scenes},
          {"objects", scenes.objects},
          {"found_rate", rate_of(scenes.found, scenes.objects)},
          {"right_rate", rate_of(scenes.right, scenes.objects)},
          {"recognized_rate", rate_of(scenes.recognized, scenes.objects)},
          {"extra_boxes", scenes.extra},
          {"pose_error_mean_deg", pose.mean},
          {"pose_error_median_deg", pose.median},
          {"pose_gross_rate", pose.gross_rate}};
}

ordered_json objects_json(const EvaluationReport& report) {
  ordered_json objects = ordered_json::array();
  for (const ObjectEvaluation& object : report.objects) {
    const auto errors = summarize_errors(object.pose_errors);
    const AnswerCounts& counts = object.counts;
    objects.push_back({{"object", object.object},
                       {"learned_views", object.learned_views},
                       {"test_views", counts.known},
                       {"answered_right", counts.answered_right},
                       {"answered_wrong", counts.answered_wrong},
                       {"withheld", counts.withheld},
                       {"unknown_views", counts.unknown},
                       {"falsely_accepted", counts.falsely_accepted},
                       {"right", counts.best_right},
                       {"rejected", counts.rejected},
                       {"ambiguous", counts.ambiguous},
                       {"nothing_found", counts.missed},
                       {"pose_observable", object.pose_observable},
                       {"pose_error_mean_deg", errors.mean},
                       {"pose_error_median_deg", errors.median},
                       {"pose_error_p90_deg", errors.p90},
                       {"pose_gross_rate", errors.gross_rate}});
  }
  return objects;
}

/// Of the best object of a view; none: "(nothing)".
std::string said_name(const EvaluationReport& report, const std::optional<std::size_t>& said) {
  return said ? report.objects[*said].object : "(nothing)";
}

ordered_json confusions_json(const EvaluationReport& report) {
  ordered_json confusions = ordered_json::array();
  for (const auto& [pair, views] : count_confusions(report.records))
    confusions.push_back({{"object", report.objects[pair.first].object},
                          {"said", said_name(report, pair.second)},
                          {"views", views}});
  return confusions;
}

void add_learning_json(const EvaluationReport& report, ordered_json& result) {
  result["smallest_rejection_rate"] = report.smallest_rate;
  result["model_bytes_per_object"] = report.model_bytes;
  result["learned_views"] = report.learning.views;
  result["solver"] = report.learning.solver.solver;
  result["components"] = report.learning.solver.components;
  result["energy_kept"] = report.learning.solver.energy;
}

void add_times_json(const EvaluationReport& report, ordered_json& result) {
  result["times_ms"] = {{"normalize", milliseconds(report.learning.normalize_time)},
                        {"eigenspace", milliseconds(report.learning.eigenspace_time)},
                        {"manifolds", milliseconds(report.learning.manifold_time)},
                        {"calibration", milliseconds(report.learning.calibration_time)},
                        {"learning", milliseconds(report.learning.total_time)}};
  const std::size_t n = report.counts.known;
  result["times_us_per_view"] = {{"load", micro_per_view(report.load_time, n)},
                                 {"segment", micro_per_view(report.times.segment, n)},
                                 {"normalize", micro_per_view(report.times.normalize, n)},
                                 {"project", micro_per_view(report.times.project, n)},
                                 {"search", micro_per_view(report.times.search, n)},
                                 {"recognition", micro_per_view(report.times.total, n)}};
}

void print_answers(const EvaluationReport& report, const std::optional<Reliability>& confidence) {
  const AnswerCounts& counts = report.counts;
  std::printf("answered right    %6.2f %% of %zu views of known objects\n",
              100.0 * counts.answered_right_rate(), counts.known);
  std::printf("answered wrong    %6.2f %%\n", 100.0 * counts.answered_wrong_rate());
  std::printf("withheld          %6.2f %%\n", 100.0 * counts.withheld_rate());
  if (const auto rate = counts.false_acceptance_rate())
    std::printf("falsely accepted  %6.2f %% of %zu views of unknown objects\n", 100.0 * *rate,
                counts.unknown);
  else
    std::printf("falsely accepted   unknown; --leave-one-out shows unknown objects too\n");
  if (confidence)
    std::printf("confidence        %6.2f %% expected calibration error over %zu regions\n",
                100.0 * confidence->expected_calibration_error, confidence->regions);
  std::printf("\n");
}

void print_objects(const EvaluationReport& report) {
  std::printf("%-16s %8s %6s %7s %9s %10s %10s %8s\n", "object", "learned", "tests", "right", "unknown*",
              "ambiguous*", "pose mean", "median");
  for (const ObjectEvaluation& object : report.objects) {
    const auto errors = summarize_errors(object.pose_errors);
    std::printf("%-16s %8zu %6zu %7zu %9zu %10zu %9.2f° %7.2f°%s\n", object.object.c_str(),
                object.learned_views, object.counts.known, object.counts.best_right, object.counts.rejected,
                object.counts.ambiguous, errors.mean, errors.median,
                object.pose_observable ? "" : "  pose not observable");
  }
  std::printf("* of the right ones: would be reported as unknown or ambiguous\n\n");
  for (const auto& [pair, views] : count_confusions(report.records))
    std::printf("confused: %s taken for %s in %zu view(s)\n", report.objects[pair.first].object.c_str(),
                said_name(report, pair.second).c_str(), views);
}

void print_scenes(const SceneReport& scenes) {
  const auto errors = summarize_errors(scenes.pose_errors);
  const auto of_all = [&](std::size_t count) { return 100.0 * rate_of(count, scenes.objects); };
  std::printf(
      "scenes      %zu with %zu objects: %.2f %% found, %.2f %% the right object, %.2f %% recognised; %zu "
      "false detections\n"
      "            pose error mean %.2f°, median %.2f°\n",
      scenes.scenes, scenes.objects, of_all(scenes.found), of_all(scenes.right), of_all(scenes.recognized),
      scenes.extra, errors.mean, errors.median);
}

void print_times(const EvaluationReport& report) {
  std::printf("learning    %.0f ms: normalise %.0f, eigenspace %.0f, manifolds %.0f, calibration %.0f\n",
              milliseconds(report.learning.total_time), milliseconds(report.learning.normalize_time),
              milliseconds(report.learning.eigenspace_time), milliseconds(report.learning.manifold_time),
              milliseconds(report.learning.calibration_time));
  const std::size_t views = report.counts.known;
  std::printf(
      "a view      %.0f µs: segment %.0f, normalise %.0f, project %.0f, search %.0f (reading the file: "
      "%.0f)\n",
      micro_per_view(report.times.total, views), micro_per_view(report.times.segment, views),
      micro_per_view(report.times.normalize, views), micro_per_view(report.times.project, views),
      micro_per_view(report.times.search, views), micro_per_view(report.load_time, views));
}

}  // namespace

nlohmann::ordered_json evaluation_json(const EvaluationReport& report,
                                       const std::optional<Reliability>& confidence) {
  const AnswerCounts& counts = report.counts;
  const auto pose = report.pose_errors();
  ordered_json result = {{"answered_right_rate", counts.answered_right_rate()},
                         {"answered_wrong_rate", counts.answered_wrong_rate()},
                         {"withheld_rate", counts.withheld_rate()},
                         {"false_acceptance_rate", or_null(counts.false_acceptance_rate())}};
  if (confidence) result["expected_calibration_error"] = confidence->expected_calibration_error;
  result["recognition_rate"] = counts.recognition_rate();
  result["pose_error_mean_deg"] = pose.mean;
  result["pose_error_median_deg"] = pose.median;
  result["pose_error_p90_deg"] = pose.p90;
  result["pose_gross_rate"] = pose.gross_rate;
  result["rejected_rate"] = counts.rejected_rate();
  result["ambiguous_rate"] = counts.ambiguous_rate();
  result["test_views"] = counts.known;
  result["unknown_views"] = counts.unknown;
  result["scenes"] = report.scenes ? scenes_json(*report.scenes) : ordered_json(nullptr);
  add_learning_json(report, result);
  result["objects"] = objects_json(report);
  result["confusions"] = confusions_json(report);
  add_times_json(report, result);
  return result;
}

void print_evaluation(const EvaluationReport& report, const std::optional<Reliability>& confidence) {
  print_answers(report, confidence);
  print_objects(report);
  const AnswerCounts& counts = report.counts;
  const auto pose = report.pose_errors();
  std::printf("recognised  %.2f %% of %zu test views (%zu objects, %zu views learned)\n",
              100.0 * counts.recognition_rate(), counts.known, report.objects.size(), report.learning.views);
  std::printf("pose error  mean %.2f°, median %.2f°, 90 %% below %.2f°, above 45°: %.2f %%\n", pose.mean,
              pose.median, pose.p90, 100.0 * pose.gross_rate);
  std::printf("rejected    %.2f %% unknown, %.2f %% ambiguous\n", 100.0 * counts.rejected_rate(),
              100.0 * counts.ambiguous_rate());
  if (report.scenes) print_scenes(*report.scenes);
  std::printf("eigenspace  %zu dimensions by %s, %.1f %% of the scatter\n", report.learning.solver.components,
              report.learning.solver.solver.c_str(), 100.0 * report.learning.solver.energy);
  print_times(report);
}

}  // namespace eigenpose::cli
