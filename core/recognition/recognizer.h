#pragma once

/// From a frame to outcomes: regions → appearance → projection → nearest manifold → accept or reject.

#include <memory>
#include <span>
#include <vector>

#include "core/base/clock.h"
#include "core/image/frame.h"
#include "core/image/region.h"
#include "core/model/model.h"
#include "core/recognition/limits.h"
#include "core/recognition/outcome.h"
#include "core/recognition/recognition_index.h"

namespace eigenpose {

/// Where the time of one recognition went.
struct RecognitionTimes {
  Duration segment{};
  Duration normalize{};
  Duration project{};
  Duration search{};
  Duration total{};
};

/// Recognises objects with one model. Holds scratch memory alone: one thread at a time; make one for each
/// thread, all of one index.
class Recognizer {
 public:
  /// @throws std::invalid_argument without an index.
  explicit Recognizer(std::shared_ptr<const RecognitionIndex> index);
  /// Makes an index of its own. @throws as RecognitionIndex.
  explicit Recognizer(std::shared_ptr<const Model> model, const RecognizerOptions& options = {});
  ~Recognizer();
  Recognizer(Recognizer&&) noexcept;
  Recognizer& operator=(Recognizer&&) noexcept;

  [[nodiscard]] const Model& model() const;

  /// One outcome for each region of the picture, left to right; none for an empty table. The span is valid
  /// until the next call. @param times if given, is set. @throws std::invalid_argument for a picture whose
  /// type or size the model cannot take.
  std::span<const Outcome> recognize(const cv::Mat& image, const RecognitionLimits& limits,
                                     RecognitionTimes* times = nullptr);
  /// The same without limits.
  std::span<const Outcome> recognize(const cv::Mat& image, RecognitionTimes* times = nullptr) {
    return recognize(image, RecognitionLimits{}, times);
  }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace eigenpose
