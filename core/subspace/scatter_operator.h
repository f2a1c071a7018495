#pragma once

/// The scatter of a set of appearances as an operator, never formed: only its products with vectors.

#include <cstddef>
#include <stop_token>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/subspace/appearance_source.h"
#include "core/subspace/view_reader.h"

namespace eigenpose {

/// Q = P Pᵀ over pixels (N × N) or Q̃ = Pᵀ P over views (M × M), with P the centred appearances. The nonzero
/// eigenvalues are the same. One thread at a time; the source must outlive it.
class ScatterOperator {
 public:
  enum class Space { pixels, views };

  /// Reads the views once, for norms and mean. @param tile_memory bytes for views of a source that is not
  /// resident; 0 means no limit. @throws std::invalid_argument for a view without energy or too little
  /// memory, Interrupted.
  ScatterOperator(const AppearanceSource& source, Space space, unsigned threads, std::size_t tile_memory,
                  Progress progress = {}, std::stop_token stop = {});

  [[nodiscard]] Eigen::Index size() const;  ///< N or M
  [[nodiscard]] double total_scatter() const { return total_scatter_; }
  [[nodiscard]] const Eigen::VectorXd& mean() const { return mean_; }    ///< N
  [[nodiscard]] const Eigen::VectorXd& norms() const { return norms_; }  ///< M; ones for floats
  /// How many times all views were read so far.
  [[nodiscard]] std::size_t passes() const { return passes_; }

  /// y = Q x for `size()` × b blocks. Over pixels the views are read once, over views twice; cost 2·N·M·b
  /// multiplications. @throws Interrupted, what the source throws.
  void apply(const Eigen::MatrixXd& x, Eigen::MatrixXd& y);

 private:
  template <typename Work>
  void for_each_block(const Work& work);

  const AppearanceSource& source_;
  Space space_;
  unsigned threads_;
  Progress progress_;
  std::stop_token stop_;
  ViewReader reader_;
  std::size_t strip_ = 0;
  std::size_t passes_ = 0;
  Eigen::VectorXd norms_;
  Eigen::VectorXd mean_;
  double total_scatter_ = 0.0;
};

}  // namespace eigenpose
