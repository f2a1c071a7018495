#pragma once

/// The views a model is learned from: cut out, normalised, kept in memory or on disk, sorted by pose.

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
#include "core/dataset/left_out.h"
#include "core/image/normalization.h"
#include "core/manifold/manifold.h"
#include "core/subspace/appearance_source.h"

namespace eigenpose {

class TrainingArchive;  // training_archive.h

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
  /// Where the coefficients of its manifold stand: see LearnedGrid.
  std::vector<SampleAxis> axes;
  std::size_t first = 0;  ///< its first view in the store
  std::size_t count = 0;  ///< n₁·…·n_m where the views fill the grid of `axes`, any number where not
  /// Size of the region that each view was cut out of, pixels; empty where pictures came ready-cut.
  std::vector<cv::Size> extents;
  bool cropped = false;  ///< its pictures came ready-cut: it has no extents, or zeros where others have some
  /// m × count: the pose of each view, where they are no grid. 0 × 0 where they fill the grid of `axes`, the
  /// last axis running fastest.
  Eigen::MatrixXd poses = {};
};

/// How views are made and kept.
struct ViewStoreOptions {
  NormalizationOptions normalization;
  unsigned threads = 0;  ///< 0: all cores
  /// Bytes that pictures may take in memory; where they need more, they go to a scratch file and are read
  /// from there in tiles. 0 means no limit.
  std::size_t memory_limit = 0;
  std::filesystem::path scratch_folder = {};  ///< empty: the system's folder for temporary files
  BadViews bad_views = BadViews::leave_out;
};

/// All views: M normalised pictures, in memory or on disk, and the appearances that the image type makes of
/// them. As an AppearanceSource it feeds the solvers. Const calls are thread-safe.
///
/// Pictures are bytes, range pictures 16 bits a pixel. Where the appearance is the picture, inner products
/// are exact integers; other types are made anew at each reading.
class TrainingViews final : public AppearanceSource {
 public:
  /// Reads, cuts out and normalises every view of `sets`, on all cores. A view that cannot be used (missing,
  /// truncated, of another size than most of its object, nothing to be seen in it, at the pose of another) is
  /// left out; so is an object whose other views are too few, or make no manifold.
  /// @throws FileError or Error naming the first of these with BadViews::refuse; Error when no object is
  /// left, or kept views are normalised in another way; Interrupted.
  TrainingViews(std::span<const TrainingSet> sets, const ViewStoreOptions& options, const Progress& progress,
                const std::stop_token& stop);
  ~TrainingViews() override;

  [[nodiscard]] std::span<const ObjectViews> objects() const { return objects_; }
  /// For each object the index of its set among those the store was made from.
  [[nodiscard]] std::span<const std::size_t> sets() const { return set_of_object_; }
  /// What could not be used, in the order of the sets.
  [[nodiscard]] std::span<const LeftOut> left_out() const { return left_out_; }
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
  struct Intake;

  void allocate(std::size_t views, const ViewStoreOptions& options);
  void take_kept(const TrainingSet& set, std::size_t first);
  void normalize(std::vector<Intake>& intakes, const ViewStoreOptions& options, const Progress& progress,
                 const std::stop_token& stop);
  void settle(Intake& intake, BadViews bad_views);
  void leave_out(LeftOut what, BadViews bad_views);
  void move_views(const Intake& intake, std::span<const std::size_t> order, std::size_t first);
  void read_pictures(std::size_t first, std::span<std::uint8_t> bytes) const;
  void write_pictures(std::size_t first, std::span<const std::uint8_t> bytes);

  NormalizationOptions options_;
  std::size_t length_ = 0;         ///< components of an appearance
  std::size_t picture_bytes_ = 0;  ///< of one picture
  std::vector<ObjectViews> objects_;
  std::vector<std::size_t> set_of_object_;
  std::vector<LeftOut> left_out_;
  std::vector<std::uint8_t> pictures_;    ///< all, unless they are on disk
  std::unique_ptr<ScratchFile> on_disk_;  ///< else
  std::vector<float> energies_;           ///< of each view's appearance
};

/// Converts the pixels of `picture` to float. @pre numbers.size() == pixels × bands.
void picture_numbers(const cv::Mat& picture, std::span<float> numbers);

/// Cuts the one object out of a learned view and normalises it.
/// @param picture picture_length(options) numbers. @param extent where to put the size of the region, or
/// nullptr. @return its energy. @throws Error saying what is wrong with the picture (nothing stands out, it
/// touches the border).
float normalize_learned_view(const cv::Mat& image, bool cropped, Segmenter& segmenter, Normalizer& normalizer,
                             std::span<float> picture, cv::Size* extent = nullptr);

}  // namespace eigenpose
