#pragma once

/// Views simplified for the spatial-temporal adaptive solver (STA): blocks of pixels as a few cosine
/// coefficients, and one block for a run of views in which it hardly changes.

#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/subspace/appearance_source.h"
#include "core/subspace/solver.h"

namespace eigenpose {

/// Coefficients are kept as whole numbers of this step. A block of a unit-energy view has coefficients of at
/// most 1, the difference of two blocks at most 2: it fits 16 bits, and products of differences are exact
/// integers. The rounding is part of what the code changes in a view: for 4000 coefficients about 1e-3.
inline constexpr double sta_step = 1.0 / 16383.0;

/// One block of pixels over a run of views: from `first_view` to the next superblock's first one.
struct Superblock {
  std::size_t first_view = 0;
  std::size_t offset = 0;  ///< of its coefficients
  std::size_t width = 0;   ///< how many, in zig-zag order from the mean on
};

/// All superblocks of one block position.
struct CodedPosition {
  std::vector<Superblock> superblocks;
  std::vector<std::int16_t> coefficients;  ///< in steps

  /// Views [first, last) of superblock s, of `views` in all.
  [[nodiscard]] std::size_t end_of(std::size_t s, std::size_t views) const {
    return s + 1 < superblocks.size() ? superblocks[s + 1].first_view : views;
  }
};

/// Orthonormal cosine transforms (DCT-II) of the blocks of an appearance. Blocks that reach over the border
/// are filled with zeros, so inner products stay (Parseval).
class BlockTransform {
 public:
  /// @param side of a block, pixels; less where the picture is smaller.
  BlockTransform(const AppearanceShape& shape, std::size_t side);

  [[nodiscard]] std::size_t positions() const { return blocks_down_ * blocks_across_ * shape_.bands; }
  [[nodiscard]] std::size_t size() const { return zigzag_.size(); }  ///< coefficients of a block
  /// Coefficients in zig-zag order of the block at `position` of a view. Their errors together are below 1e-6
  /// of the block's norm. @return false for a black block, whose coefficients are all 0.
  bool forward(const float* view, std::size_t position, float* coefficients) const;
  /// Adds the block with the given coefficients to a view.
  void add_inverse(const double* coefficients, std::size_t position, double* view) const;
  [[nodiscard]] const AppearanceShape& shape() const { return shape_; }

 private:
  struct Corner {
    std::size_t row, column, band;
  };
  [[nodiscard]] Corner corner(std::size_t position) const;

  AppearanceShape shape_;
  std::size_t height_, width_;
  std::size_t blocks_down_, blocks_across_;
  Eigen::MatrixXd down_, across_;  ///< one row a frequency
  Eigen::MatrixXf fast_down_, fast_across_;
  std::vector<std::size_t> zigzag_;  ///< place in the block, row by row, of every coefficient
};

/// A whole set, simplified.
struct StaCode {
  std::vector<CodedPosition> positions;
  Eigen::VectorXd changes;  ///< ‖Δⱼ‖² of every unit-energy view, rounded up
  Eigen::VectorXd mean;     ///< of the true unit-energy views
  std::size_t kept = 0;     ///< coefficients in superblocks

  [[nodiscard]] std::size_t bytes() const;  ///< memory of the coefficients and superblocks
};

/// What coding may use.
struct StaLimits {
  unsigned threads = 0;
  std::size_t tile_memory = 0;   ///< for views read at once, bytes; 0 means no limit
  std::size_t memory_limit = 0;  ///< for the code, bytes; 0 means none
};

/// Codes all views of `source`, reading them once. Spatial: per block small coefficients go while
/// their energy stays within spatial² / blocks. Temporal: a run goes on while the block differs from the
/// run's first by an energy within temporal² / blocks. So ‖Δⱼ‖ ≤ spatial + temporal, but for the rounding to
/// steps.
/// @throws std::invalid_argument for a black view or where the code exceeds its memory limit; Interrupted.
StaCode sta_code(const AppearanceSource& source, const BlockTransform& transform, const StaOptions& options,
                 const StaLimits& limits, const Progress& progress = {}, std::stop_token stop = {});

/// The Gram matrix of the coded views, exact up to one rounding: M × M, full. It depends on nothing but the
/// code.
///
/// Every product of two superblocks counts for the rectangle of view pairs that both cover. Such a rectangle
/// is four numbers to a running sum over rows and columns, and where superblocks follow each other these four
/// collapse to one: a coded view is the sum of the differences up to it, so the Gram matrix is the running
/// sum of the products of differences. Cost: Σ_p S_p²·width/2 multiplications for S_p superblocks at position
/// p.
Eigen::MatrixXd sta_gram(const StaCode& code, std::size_t views, std::size_t block_size, unsigned threads,
                         const Progress& progress = {}, std::stop_token stop = {});

/// X̂ · weights with X̂ the coded views: N × C from M × C.
Eigen::MatrixXd sta_back_project(const StaCode& code, const BlockTransform& transform,
                                 const Eigen::MatrixXd& weights, unsigned threads);

}  // namespace eigenpose
