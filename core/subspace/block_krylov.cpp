#include "core/subspace/block_krylov.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/error.h"
#include "core/base/linear_algebra.h"
#include "core/base/random.h"

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
/// Values closer than this share of themselves may be copies of one eigenvalue: only costs a check when
/// wrong.
constexpr double kCluster = 1e-5;

/// The growing basis V, its image W = Q V, and VᵀW.
class KrylovBasis {
 public:
  KrylovBasis(Index size, const SymmetricProduct& product, const KrylovOptions& options)
      : product_(product), size_(size), capacity_(std::min(size, options.max_vectors)), random_(20) {
    basis_.resize(size, capacity_);
    image_.resize(size, capacity_);
    projected_ = MatrixXd::Zero(capacity_, capacity_);
  }

  [[nodiscard]] Index used() const { return used_; }
  [[nodiscard]] Index room() const { return capacity_ - used_; }
  [[nodiscard]] bool complete() const { return used_ == size_; }
  /// Another block of the given size needs a restart.
  [[nodiscard]] bool full(Index block) const { return capacity_ < size_ && room() < block; }
  [[nodiscard]] std::size_t products() const { return products_; }
  [[nodiscard]] Index random_vectors() const { return random_vectors_; }

  /// Adds the directions of `block` that are new to the basis. Where none is left the Krylov space is
  /// exhausted: random vectors take over. @return false when the basis spans everything.
  bool add(MatrixXd block) {
    Index fresh = orthonormalize(block);
    if (fresh == 0) {
      if (complete()) return false;
      block = random_block(std::min<Index>(std::max<Index>(block.cols(), 1), room()));
      fresh = orthonormalize(block);
      random_vectors_ += fresh;
      if (fresh == 0) return false;
    }
    append(block.leftCols(fresh));
    return true;
  }

  bool add_random(Index count) {
    MatrixXd block = random_block(std::min(count, room()));
    const Index fresh = orthonormalize(block);
    random_vectors_ += fresh;
    if (fresh > 0) append(block.leftCols(fresh));
    return fresh > 0;
  }

  /// The part of Q·(last block) that the basis does not hold: where the Krylov space grows.
  [[nodiscard]] MatrixXd continuation() const {
    MatrixXd block = image_.middleCols(used_ - last_, last_);
    block -= basis_.leftCols(used_) * (basis_.leftCols(used_).transpose() * block).eval();
    return block;
  }

  /// Ritz values (descending) and coefficients of the Ritz vectors.
  void ritz(VectorXd& values, MatrixXd& coefficients) const {
    SymmetricEigen found = symmetric_eigen(projected_.topLeftCorner(used_, used_));
    values = std::move(found.values);
    coefficients = std::move(found.vectors);
  }
  [[nodiscard]] MatrixXd vectors(const MatrixXd& coefficients) const {
    return basis_.leftCols(used_) * coefficients;
  }
  [[nodiscard]] MatrixXd images(const MatrixXd& coefficients) const {
    return image_.leftCols(used_) * coefficients;
  }

  /// Keeps only the given Ritz vectors (thick restart).
  void restart(const VectorXd& values, const MatrixXd& coefficients) {
    const Index kept = coefficients.cols();
    basis_.leftCols(kept) = vectors(coefficients);
    image_.leftCols(kept) = images(coefficients);
    projected_.topLeftCorner(kept, kept) = values.head(kept).asDiagonal();
    used_ = kept;
    last_ = 0;
  }

 private:
  MatrixXd random_block(Index columns) {
    MatrixXd block(size_, columns);
    for (double& x : block.reshaped()) x = random_.normal();
    return block;
  }

  /// Orthonormalises against the basis and within; moves the columns that survive to the front. @return their
  /// number.
  Index orthonormalize(MatrixXd& block) {
    const VectorXd before = block.colwise().norm();
    const double scale = before.size() > 0 ? before.maxCoeff() : 0.0;
    block -= basis_.leftCols(used_) * (basis_.leftCols(used_).transpose() * block).eval();
    Index kept = 0;
    for (Index j = 0; j < block.cols() && kept < room(); ++j) {
      VectorXd column = block.col(j);
      for (int pass = 0; pass < 2; ++pass) {
        column -= block.leftCols(kept) * (block.leftCols(kept).transpose() * column).eval();
      }
      double norm = column.norm();
      // What is left after such cancellation is rounding, not a direction.
      if (norm <= 1e3 * kEpsilon * scale) continue;
      column /= norm;
      column -= basis_.leftCols(used_) * (basis_.leftCols(used_).transpose() * column).eval();
      column -= block.leftCols(kept) * (block.leftCols(kept).transpose() * column).eval();
      norm = column.norm();
      if (norm < 0.5) continue;
      block.col(kept++) = column / norm;
    }
    return kept;
  }

  void append(const MatrixXd& block) {
    MatrixXd image(size_, block.cols());
    product_(block, image);
    ++products_;
    const Index first = used_;
    last_ = block.cols();
    used_ += last_;
    basis_.middleCols(first, last_) = block;
    image_.middleCols(first, last_) = image;
    const MatrixXd cross = basis_.leftCols(used_).transpose() * image;
    projected_.block(0, first, used_, last_) = cross;
    projected_.block(first, 0, last_, used_) = cross.transpose();
    const MatrixXd corner = cross.bottomRows(last_);
    projected_.block(first, first, last_, last_) = 0.5 * (corner + corner.transpose());
  }

  const SymmetricProduct& product_;
  Index size_;
  Index capacity_;
  Index used_ = 0;
  Index last_ = 0;  ///< vectors in the last block
  Index random_vectors_ = 0;
  std::size_t products_ = 0;
  SeededRandom random_;
  MatrixXd basis_;
  MatrixXd image_;
  MatrixXd projected_;
};

/// The longest run of values that may be copies of one, among those above `noise`.
Index largest_cluster(const VectorXd& values, Index count, double noise) {
  Index longest = 0;
  Index run = 0;
  for (Index i = 0; i < count && values[i] > noise; ++i) {
    run = i > 0 && values[i - 1] - values[i] <= kCluster * values[i - 1] ? run + 1 : 1;
    longest = std::max(longest, run);
  }
  return longest;
}

EigenPairs assess(const KrylovBasis& basis, const KrylovOptions& options, const VectorXd& values,
                  const MatrixXd& coefficients) {
  EigenPairs result;
  Index rank = 0;
  while (rank < std::min(options.wanted, values.size()) && values[rank] > options.noise) ++rank;
  const Index checked = std::min(rank + 1, values.size());
  const MatrixXd vectors = basis.vectors(coefficients.leftCols(checked));
  const MatrixXd residuals =
      basis.images(coefficients.leftCols(checked)) - vectors * values.head(checked).asDiagonal();
  result.values = values.head(rank);
  result.vectors = vectors.leftCols(rank);
  result.residuals = residuals.leftCols(rank).colwise().norm();
  result.products = basis.products();
  if (checked > rank) {
    result.next_value = std::max(values[rank], 0.0);
    result.next_residual = residuals.col(rank).norm();
  }
  result.converged = basis.complete();
  if (rank == 0 || result.converged) return result;

  // Rounding leaves residuals of this size however long one iterates.
  const double floor = 16.0 * kEpsilon * std::sqrt(static_cast<double>(basis.used())) * values[0];
  // A next value that is still rising would overstate the gap.
  const double gap = values[rank - 1] - result.next_value;
  const bool gap_settled = tied_cut(result, rank) || result.next_residual <= std::max(0.2 * gap, floor);
  result.converged = gap_settled && (residual_over_gap(result, rank) <= options.tolerance ||
                                     result.residuals.norm() <= floor);
  return result;
}

}  // namespace

EigenPairs leading_eigenpairs(Index size, const SymmetricProduct& product, const KrylovOptions& given,
                              const std::stop_token& stop) {
  KrylovOptions options = given;
  options.wanted = std::min(options.wanted, size);
  options.block = std::clamp<Index>(options.block, 1, size);
  options.max_vectors = std::max(options.max_vectors, options.wanted + 1 + 3 * options.block);
  KrylovBasis basis(size, product, options);
  basis.add_random(options.block);

  const Index kept = std::min(size, options.wanted + 1 + options.block);
  Index next_check = std::min(size, 2 * kept);
  VectorXd values;
  MatrixXd coefficients;
  while (true) {
    if (stop.stop_requested()) throw Interrupted("interrupted while solving for eigenvectors");
    const bool full = basis.full(options.block);
    if (full || basis.complete() || basis.used() >= next_check || basis.products() >= options.max_products) {
      basis.ritz(values, coefficients);
      EigenPairs result = assess(basis, options, values, coefficients);
      const bool spent = basis.products() >= options.max_products;
      const bool may_miss = !basis.complete() &&
                            largest_cluster(values, std::min(options.wanted + 1, values.size()),
                                            options.noise) >= basis.random_vectors() &&
                            basis.random_vectors() <= options.wanted;
      if ((result.converged && !may_miss) || spent || basis.complete()) {
        result.converged = result.converged && !may_miss;
        return result;
      }
      MatrixXd more = basis.continuation();
      if (full) basis.restart(values, coefficients.leftCols(kept));
      if (result.converged) {
        basis.add_random(options.block);
      } else {
        basis.add(std::move(more));
      }
      next_check = std::max(basis.used() + 2 * options.block, basis.used() + basis.used() / 6);
      continue;
    }
    basis.add(basis.continuation());
  }
}

}  // namespace eigenpose
