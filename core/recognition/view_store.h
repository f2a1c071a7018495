#pragma once

/// The views a model is learned from: cut out, normalised, kept as bytes, sorted into each object's grid of
/// poses.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/image/image_set.h"
#include "core/image/normalization.h"
#include "core/manifold/manifold.h"
#include "core/subspace/appearance_source.h"

namespace eigenpose {

/// Which views of an image set are learned.
struct TrainingSet {
  const ImageSet* images = nullptr;
  std::vector<std::size_t> views;  ///< indices into images->views(); empty means all
};

/// The views of one object inside a ViewStore.
struct ObjectViews {
  std::string object;
  Workspace workspace;
  /// The grid of poses: views stand in it with the last axis running fastest.
  std::vector<SampleAxis> axes;
  std::size_t first = 0;  ///< its first view in the store
  std::size_t count = 0;  ///< n₁·…·n_m
};

/// All views, M of N bytes. As an AppearanceSource it feeds the solvers. Const calls are thread-safe.
class ViewStore final : public AppearanceSource {
 public:
  /// Reads, cuts out and normalises every view of `sets`, on all cores.
  /// @throws FileError naming the view (missing, truncated, another size than the first, nothing to be seen
  /// in it); Error when an object has too few views or its poses are no grid; Interrupted.
  ViewStore(std::span<const TrainingSet> sets, const NormalizationOptions& options, unsigned threads,
            const Progress& progress, std::stop_token stop);

  [[nodiscard]] std::span<const ObjectViews> objects() const { return objects_; }
  [[nodiscard]] const NormalizationOptions& normalization() const { return options_; }

  [[nodiscard]] std::size_t count() const override { return energies_.size(); }
  [[nodiscard]] std::size_t length() const override { return length_; }
  [[nodiscard]] bool has_bytes() const override { return true; }
  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override;
  void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const override;
  [[nodiscard]] const std::uint8_t* resident_bytes() const override { return bytes_.data(); }

  /// View i, N bytes.
  [[nodiscard]] std::span<const std::uint8_t> bytes(std::size_t i) const {
    return {bytes_.data() + i * length_, length_};
  }

 private:
  NormalizationOptions options_;
  std::size_t length_ = 0;
  std::vector<ObjectViews> objects_;
  std::vector<std::uint8_t> bytes_;
  std::vector<float> energies_;  ///< ‖bytes‖ of each view
};

/// Cuts the one object out of a learned view and normalises it.
/// @return its energy. @throws Error saying what is wrong with the picture (nothing stands out, it touches
/// the border).
float normalize_learned_view(const cv::Mat& image, bool cropped, Segmenter& segmenter, Normalizer& normalizer,
                             std::span<float> appearance);

}  // namespace eigenpose
