#pragma once

/// Measuring recognition: learn some views, show the others, count.

#include <cstddef>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "core/dataset/image_set.h"
#include "core/evaluation/composed_scenes.h"
#include "core/evaluation/region_record.h"
#include "core/learning/learning.h"
#include "core/recognition/recognizer.h"

namespace eigenpose {

/// What is done to test pictures before they are recognised. Every picture has its own draw, from the seed
/// and its number.
struct TestDamage {
  double shift = 0.0;         ///< each way in x and in y, pixels of a picture 128 wide
  double scale = 0.0;         ///< each way: 0.03 is ±3 %
  double rotation_deg = 0.0;  ///< each way, in the picture's plane
  double occlusion = 0.0;     ///< share of the picture covered by a black square at a random place; below 1
  unsigned seed = 1;

  [[nodiscard]] bool any() const { return shift > 0 || scale > 0 || rotation_deg > 0 || occlusion > 0; }
};

/// The damaged picture of test number `index`.
cv::Mat damaged(const cv::Mat& picture, const TestDamage& damage, std::size_t index);

struct EvaluationOptions {
  /// Learn every k-th value of the first DOF, counted from `offset` in ascending order; test on the rest. At
  /// least 2.
  std::size_t learn_every = 2;
  std::size_t offset = 0;  ///< below learn_every
  LearningOptions learning;
  RecognizerOptions recognizer;
  TestDamage damage;
  /// Also show the test views of every object, damaged as the others are, to a model that does not hold it:
  /// an unknown object. The object is taken out of the learned model, and its views out of what thresholds
  /// are set from; eigenspaces stay as learned with all.
  bool leave_one_out = false;
  /// Also show scenes composed of test views.
  SceneOptions scenes;
  unsigned threads = 0;
};

/// What happened with the test views of one object.
struct ObjectEvaluation {
  std::string object;
  std::size_t learned_views = 0;
  bool pose_observable = true;
  AnswerCounts counts;
  std::vector<double> pose_errors;  ///< |error| of the first DOF in its unit, where the best object is right
};

struct EvaluationReport {
  std::vector<ObjectEvaluation> objects;
  /// One for each test view, object after object; then, with `leave_one_out`, the same views again as unknown
  /// objects. Indices of objects are those of `objects`.
  std::vector<RegionRecord> records;
  AnswerCounts counts;  ///< of all records
  LearningReport learning;
  RecognitionTimes times;  ///< summed over known test views, of all threads
  Duration load_time{};    ///< reading and decoding them, summed
  std::optional<SceneReport> scenes;
  double smallest_rate = 1.0;   ///< of wrong rejections, that the learned views can support
  std::size_t model_bytes = 0;  ///< Model::memory, mean of an object

  /// Share of known test views whose best object is the true one, whatever the verdict; 0…1.
  [[nodiscard]] double recognition_rate() const { return counts.recognition_rate(); }
  /// In the order of `objects`.
  [[nodiscard]] std::vector<std::string> object_names() const;
  /// Mean, median, 90th percentile, and the share above 45 (degrees, where the DOF is an angle), over views
  /// whose best object is right.
  struct PoseErrors {
    double mean = 0.0;
    double median = 0.0;
    double p90 = 0.0;
    double gross_rate = 0.0;
  };
  [[nodiscard]] PoseErrors pose_errors() const;
};

/// Learns and tests.
/// @throws what `learn` throws; std::invalid_argument for options out of range or when nothing is left to
/// test.
EvaluationReport evaluate(std::span<const ImageSet> sets, const EvaluationOptions& options,
                          const Progress& progress = {}, std::stop_token stop = {});

/// Splits the views of a set into learned and tested ones as EvaluationOptions says.
struct ViewSplit {
  std::vector<std::size_t> learned;
  std::vector<std::size_t> tested;
};
ViewSplit split_views(const ImageSet& set, std::size_t learn_every, std::size_t offset);

/// Statistics of a list of absolute errors.
EvaluationReport::PoseErrors summarize_errors(std::vector<double> errors);

}  // namespace eigenpose
