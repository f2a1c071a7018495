#pragma once

/// What was learned from, kept on disk: so that objects join and leave a model without the images of the
/// others.
///
/// A sealed HDF5 file (sealed_file.h):
///
///     /                attribute created: of the model that was learned with it
///     /options         attributes solver, components, energy, …; normalization: as in a model
///     /objects/0000…   attributes name, cropped; pictures (bytes, view after view);
///                      energies (n); extents (n×2); left_out_errors (n) of the alignment
///                      eigenspace; axes/0… as in a model; poses (n×m) where the views
///                      are no grid
///     /calibration     what calibration measured (calibration_file.h); only of models with parts
///     /products        inner products of all views, M × M; only where the gram solver made them
///
/// With the products and the record of the calibration, an update measures what concerns the objects that
/// join, and what they change.
///
/// For 3600 grey views of 64 × 64: 15 MB of pictures and 104 MB of products.

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/atomic_file.h"
#include "core/base/scratch_file.h"
#include "core/dataset/image_set.h"
#include "core/learning/calibration/calibration_record.h"
#include "core/learning/learning.h"
#include "core/learning/training_views.h"
#include "core/subspace/gram.h"

namespace eigenpose {

/// Views as a file keeps them. Pictures stay on disk until they are read. Const calls are thread-safe.
class TrainingArchive {
 public:
  /// Checks the whole file. @throws FileError saying what is wrong and what to do.
  explicit TrainingArchive(std::filesystem::path file);
  TrainingArchive(const TrainingArchive&) = delete;
  TrainingArchive& operator=(const TrainingArchive&) = delete;
  ~TrainingArchive();

  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  /// The model was learned from these views: of the same objects, at the same time.
  [[nodiscard]] bool belong_to(const Model& model) const;
  /// How they were learned: normalisation, solver with components and energy, degree, object spaces, parts,
  /// the rates of false rejections (one for all thresholds) and false acceptances, and the name of the image
  /// sets. Everything else is as a LearningOptions begins.
  [[nodiscard]] const LearningOptions& options() const { return options_; }
  [[nodiscard]] std::span<const ObjectViews> objects() const { return objects_; }
  /// The pictures of object o, view after view, and the energy of each view's appearance.
  /// @throws FileError when there are not that many.
  void read(std::size_t o, std::span<std::uint8_t> pictures, std::span<float> energies) const;
  /// Of the alignment eigenspace of object o, AlignmentEigenspace::left_out_errors; none where the model has
  /// no parts.
  /// @throws FileError.
  [[nodiscard]] std::vector<double> left_out_errors(std::size_t o) const;
  /// Inner products of all views, object after object; 0 × 0 where there are none. @throws FileError.
  [[nodiscard]] Eigen::MatrixXd products() const;
  /// What calibration measured; empty where nothing was kept. @throws FileError.
  [[nodiscard]] CalibrationRecord calibration() const;

 private:
  struct File;

  std::filesystem::path file_;
  std::unique_ptr<File> open_;
  std::string created_;
  LearningOptions options_;
  std::vector<ObjectViews> objects_;
};

/// Writes the views that are learned.
class TrainingArchiveWriter {
 public:
  /// @param views outlives the writer.
  TrainingArchiveWriter(const std::filesystem::path& file, const TrainingViews& views,
                        const LearningOptions& options, std::string created);
  /// Puts the inner products aside, on disk. @throws FileError.
  void keep(const Eigen::MatrixXd& products);
  /// Writes and verifies. @param parts of the model, or null. @return the file, which appears, or replaces
  /// the former one, when it is committed. At most once. @throws FileError.
  [[nodiscard]] std::unique_ptr<AtomicFile> finish(const CalibrationRecord& calibration,
                                                   const PartsModel* parts);

 private:
  std::unique_ptr<AtomicFile> file_;
  const TrainingViews& views_;
  LearningOptions options_;
  std::string created_;
  Eigen::Index products_ = 0;               ///< rows of the inner products
  std::unique_ptr<ScratchFile> put_aside_;  ///< they themselves
};

/// Saves a model and the views that were kept with it (LearningReport::kept_views). After a crash at any
/// point, and after any failure, `open_kept_views` finds the views of the model that then stands in
/// `model_file`. @throws FileError saying which of the two is not there.
void save_with_views(const Model& model, const std::filesystem::path& model_file, AtomicFile& views);

/// The views that `model` was learned from: in `file`, or staged beside it (AtomicFile::staged_name) where
/// saving was interrupted. @return null where neither belongs to the model.
/// @throws FileError where no such file is there, or it is damaged.
std::unique_ptr<TrainingArchive> open_kept_views(const std::filesystem::path& file, const Model& model);

/// The kept objects without those that leave, and the image sets that join, in the order of
/// `open_image_sets`: the model learned from them with the kept options is the one that is learned anew from
/// all their image sets.
/// @throws ConfigError for an object to remove that is not there, or one that joins under a name that is
/// taken.
std::vector<TrainingSet> updated_sets(const TrainingArchive& kept, std::span<const std::string> leaving,
                                      std::span<const ImageSet> joining);

/// The kept products of views that stand in `views`, which was made from `sets`. No rows where there are
/// none.
KnownProducts known_products(std::span<const TrainingSet> sets, const TrainingViews& views);

/// What of the kept calibration is good for these sets. Empty where there is none, and where too much
/// changed.
CalibrationRecord known_calibration(std::span<const TrainingSet> sets, const TrainingViews& views);

}  // namespace eigenpose
