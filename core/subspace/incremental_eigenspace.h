#pragma once

/// An eigenspace that objects join and leave, without going back to the images of the others.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/subspace/appearance_source.h"
#include "core/subspace/eigenspace.h"
#include "core/subspace/solver.h"

namespace eigenpose {

/// Objects with their views, and the inner products of all views.
///
/// What is kept, and why: the matrix of all M × M inner products (8M² bytes), so that no product is computed
/// twice; and the normalised appearances themselves (N·M bytes where the views are 8-bit, 4·N·M otherwise),
/// because a new view's products with the old ones and the eigenvectors over pixels both need them. Keeping a
/// truncated basis instead would be smaller, but its error is the discarded singular value over the
/// eigenvalue gap, which no useful truncation keeps small. Image files are never needed again: 3600 colour
/// views of 64 × 64 take 44 MB and 104 MB.
///
/// What it costs: adding m views M·m·N multiplications (learning anew: (M+m)²N/2), removing none. Then
/// `solve` solves for K vectors and back-projects, as learning anew does.
///
/// Tolerance: none. `solve` gives bit for bit what the gram solver gives for the same views in the same
/// order, because every inner product depends on its two views alone.
///
/// One thread at a time.
class IncrementalEigenspace {
 public:
  /// @param length N of every view. @param bytes all sources have 8-bit views; otherwise all are read as
  /// floats.
  /// @param threads for the products; 0 means all cores.
  IncrementalEigenspace(std::size_t length, bool bytes, unsigned threads = 0);
  IncrementalEigenspace(IncrementalEigenspace&&) noexcept;
  IncrementalEigenspace& operator=(IncrementalEigenspace&&) noexcept;
  ~IncrementalEigenspace();

  /// Reads all views of `source` once and appends them. @throws std::invalid_argument when the name is taken,
  /// the length is another, or a source without 8-bit views joins a set of them; what the source throws. Then
  /// nothing has changed.
  void add(const std::string& name, const AppearanceSource& source, const Progress& progress = {},
           std::stop_token stop = {});
  /// Forgets an object. @throws std::invalid_argument when there is none of that name.
  void remove(std::string_view name);

  [[nodiscard]] std::vector<std::string> names() const;  ///< in the order of their views
  [[nodiscard]] std::size_t count() const;               ///< M
  [[nodiscard]] std::size_t memory() const;              ///< bytes kept
  /// The views of all objects, object after object, in the order they joined. Lives as long as this object.
  [[nodiscard]] const AppearanceSource& views() const;
  /// Inner products of `views()`, unscaled where they are bytes: M × M.
  [[nodiscard]] const Eigen::MatrixXd& products() const { return products_; }

  /// The eigenspace of all views there are; `options.solver` and `memory_limit` do not count here. Needs 8M²
  /// bytes more while it works. @throws as `solve_eigenspace`.
  [[nodiscard]] Eigenspace solve(const SolverOptions& options, SolverReport* report = nullptr,
                                 const Progress& progress = {}, std::stop_token stop = {}) const;

 private:
  class Views;
  std::unique_ptr<Views> views_;
  unsigned threads_;
  Eigen::MatrixXd products_;
};

}  // namespace eigenpose
