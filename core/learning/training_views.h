#pragma once

/// The views a model is learned from: cut out, normalised, kept in memory or on disk, sorted into each
/// object's grid of poses.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/scratch_file.h"
#include "core/dataset/image_set.h"
#include "core/image/normalization.h"
#include "core/manifold/manifold.h"
#include "core/subspace/appearance_source.h"

namespace eigenpose {

class TrainingArchive;  // kept_views.h

/// What is learned of one object: views of an image set, or those that a former learning kept.
struct TrainingSet {
  const ImageSet* images = nullptr;
  std::vector<std::size_t> views;         ///< indices into images->views(); empty means all
  const TrainingArchive* kept = nullptr;  ///< else, all views of its object number `kept_object`
  std::size_t kept_object = 0;

  [[nodiscard]] const std::string& object() const;
  /// See ImageSet::cropped.
  [[nodiscard]] bool cropped() const;
};

/// The views of one object inside a TrainingViews.
struct ObjectViews {
  std::string object;
  Workspace workspace;
  /// The grid of poses: views stand in it with the last axis running fastest.
  std::vector<SampleAxis> axes;
  std::size_t first = 0;  ///< its first view in the store
  std::size_t count = 0;  ///< n₁·…·n_m
  /// Size of the region that each view was cut out of, pixels; empty where pictures came ready-cut.
  std::vector<cv::Size> extents;
  bool cropped = false;  ///< its pictures came ready-cut: it has no extents, or zeros where others have some
};

/// How views are made and kept.
struct ViewStoreOptions {
  NormalizationOptions normalization;
  unsigned threads = 0;  ///< 0: all cores
  /// Bytes that pictures may take in memory; where they need more, they go to a scratch file and are read
  /// from there in tiles. 0 means no limit.
  std::size_t memory_limit = 0;
  std::filesystem::path scratch_folder = {};  ///< empty: the system's folder for temporary files
};

/// All views: M normalised pictures, in memory or on disk, and the appearances that the image type makes of
/// them. As an AppearanceSource it feeds the solvers. Const calls are thread-safe.
///
/// Pictures are bytes, range pictures 16 bits a pixel. Where the appearance is the picture, inner products
/// are exact integers; other types are made anew at each reading.
class TrainingViews final : public AppearanceSource {
 public:
  /// Reads, cuts out and normalises every view of `sets`, on all cores.
  /// @throws FileError naming the view (missing, truncated, another size than the first, nothing to be seen
  /// in it); Error when an object has too few views, its poses are no grid, or kept views are normalised in
  /// another way; Interrupted.
  TrainingViews(std::span<const TrainingSet> sets, const ViewStoreOptions& options, const Progress& progress,
                std::stop_token stop);
  ~TrainingViews() override;

  [[nodiscard]] std::span<const ObjectViews> objects() const { return objects_; }
  [[nodiscard]] const NormalizationOptions& normalization() const { return options_; }
  /// Bytes of pictures that stand in memory.
  [[nodiscard]] std::size_t resident() const { return pictures_.size(); }

  [[nodiscard]] std::size_t count() const override { return energies_.size(); }
  [[nodiscard]] std::size_t length() const override { return length_; }
  [[nodiscard]] AppearanceShape shape() const override;
  /// One group an object.
  [[nodiscard]] std::vector<std::size_t> groups() const override;
  [[nodiscard]] bool has_bytes() const override;
  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override;
  void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const override;
  [[nodiscard]] const std::uint8_t* resident_bytes() const override;

  /// The normalised picture of view i: CV_8UC1, CV_8UC3 or, of range, CV_16UC1.
  [[nodiscard]] cv::Mat picture(std::size_t i) const;
  /// The bytes of n pictures, view after view.
  [[nodiscard]] std::vector<std::uint8_t> pictures(std::size_t first, std::size_t n) const;
  /// The norm of view i's appearance before it was scaled.
  [[nodiscard]] float energy(std::size_t i) const { return energies_[i]; }

 private:
  void read_pictures(std::size_t first, std::span<std::uint8_t> bytes) const;
  void write_pictures(std::size_t first, std::span<const std::uint8_t> bytes);

  NormalizationOptions options_;
  std::size_t length_ = 0;         ///< numbers of an appearance
  std::size_t picture_bytes_ = 0;  ///< of one picture
  std::vector<ObjectViews> objects_;
  std::vector<std::uint8_t> pictures_;    ///< all, unless they are on disk
  std::unique_ptr<ScratchFile> on_disk_;  ///< else
  std::vector<float> energies_;           ///< of each view's appearance
};

/// The numbers of a picture as floats. @pre as many.
void picture_numbers(const cv::Mat& picture, std::span<float> numbers);

/// Cuts the one object out of a learned view and normalises it.
/// @param picture picture_length(options) numbers. @param extent where to put the size of the region, or
/// nullptr. @return its energy. @throws Error saying what is wrong with the picture (nothing stands out, it
/// touches the border).
float normalize_learned_view(const cv::Mat& image, bool cropped, Segmenter& segmenter, Normalizer& normalizer,
                             std::span<float> picture, cv::Size* extent = nullptr);

}  // namespace eigenpose
