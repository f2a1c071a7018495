#pragma once

/// Finding the eigenspace: several exact solvers behind one interface, chosen by size unless named.

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "core/base/clock.h"
#include "core/base/progress.h"
#include "core/subspace/appearance_source.h"
#include "core/subspace/eigenspace.h"

namespace eigenpose {

struct KnownProducts;  // gram.h

/// How far the spatial-temporal adaptive solver may simplify the views. Its error bound follows from what it
/// did.
struct StaOptions {
  std::size_t block = 8;  ///< side of the blocks of pixels, 2…16
  /// Largest part of a unit-energy view that leaving out small coefficients may change, 0…1 (0 keeps all, as
  /// 16-bit numbers).
  double spatial = 0.05;
  /// The same for standing in an earlier view's block for a similar one.
  double temporal = 0.05;
};

/// What the spatial-temporal adaptive solver did, and the proven bounds that follow.
struct StaReport {
  double largest_change = 0.0;       ///< δ: the most that a unit-energy view was changed, ‖Δⱼ‖
  double product_error_bound = 0.0;  ///< every inner product is within 2δ + δ² of the true one
  /// Every eigenvalue is within this of the true one: 2√(λ₁D) + D with D = Σ‖Δⱼ‖² (Weyl's inequality for
  /// singular values).
  double eigenvalue_error_bound = 0.0;
  /// Bounds the sine of the largest angle to the true subspace: √D / (σ_K − σ_{K+1} − √D), 1 where that says
  /// nothing (Wedin).
  double angle_sine_bound = 1.0;
  double coefficient_share = 0.0;  ///< of the N·M numbers, those kept in superblocks
  double superblock_ratio = 0.0;   ///< superblocks over blocks of all views
};

/// How the joined solver divides the views, and what it may leave out.
struct JoinedOptions {
  std::size_t block = 256;  ///< most views that one eigenspace is solved of at first, at least 2
  /// Largest share of the scatter that eigenspaces may leave out before they are joined, 0…1 (0 keeps all).
  double left_out = 0.01;
};

/// What the joined solver did, and the proven bounds that follow. What it leaves out of the scatter, R, is
/// positive semidefinite: eigenvalues and energy are never told too large.
struct JoinedReport {
  std::size_t blocks = 0;      ///< eigenspaces that were solved
  std::size_t directions = 0;  ///< most of them together at a time: the largest eigen-solve is of so many
  double eigenvalue_error_bound = 0.0;  ///< no eigenvalue is farther below the true one: ‖R‖ (Weyl)
  /// Bounds the sine of the largest angle to the true subspace: ‖R‖ / (λ_K − λ_{K+1}), 1 where that says
  /// nothing (Davis and Kahan).
  double angle_sine_bound = 1.0;
};

struct SolverOptions {
  /// - "gram": eigenvectors of the M × M Gram matrix, exact integers where the views are 8-bit. 8M² bytes.
  /// - "krylov": block Krylov on products with the views; no matrix. Refuses an answer it is not sure of.
  /// - "conjugate-gradient": one eigenvector after the other, deflated (appendix A); for comparison.
  /// - "sta": spatial-temporal adaptive: approximate, with proven bounds in the report. Wants `shape()` of
  /// the source.
  /// - "joined": an eigenspace of each block of views, made orthogonal together (orthogonalization.h). Holds
  /// the directions that count, never all views; reads each once. Leaves out a little, with proven bounds in
  /// the report. Wants `groups()` of the source.
  /// - "auto": gram up to some thousand views where it fits into memory, else krylov.
  std::string solver = "auto";
  /// K. At most M−1; fewer are returned where the appearances span fewer dimensions (the report says so).
  std::size_t components = 20;
  /// If set (0…1], K is the smallest number that keeps this share of the scatter, and `components` its upper
  /// limit.
  std::optional<double> energy = std::nullopt;
  /// Threads for the products; 0 means all cores. The result does not depend on it.
  unsigned threads = 0;
  /// Memory for all that the solver holds at once (tiles of views that are not in memory already, Gram
  /// matrix, vectors, the result), bytes; 0 means no limit. Each thread needs about 0.6 MB more.
  std::size_t memory_limit = 0;
  StaOptions sta = {};        ///< for the solver "sta" alone
  JoinedOptions joined = {};  ///< for the solver "joined" alone
  /// Inner products that need not be computed again; the gram solver alone asks. They outlive the call.
  const KnownProducts* known = nullptr;
  /// If set, is shown all inner products, before the gram solver goes on to change them. Other solvers have
  /// none.
  std::function<void(const Eigen::MatrixXd& products)> keep_products = {};
};

struct SolverReport {
  std::string solver;          ///< the one that ran
  std::size_t components = 0;  ///< K reached
  double energy = 0.0;         ///< share of the scatter kept
  /// What is truly kept, and what the best K dimensions keep, is within this of `energy`: 0 of exact solvers.
  /// Joined: min(tr R, K ‖R‖) over the scatter. Sta: by Mirsky's inequality, the roots of kept and whole
  /// scatter are within √D.
  double energy_bound = 0.0;
  /// ‖Q E − E Λ‖ / (λ_K − λ_{K+1}): bounds the sine of the largest angle between found and true subspace.
  /// Where the two eigenvalues are equal the cut is one of many (the note says so), and it is ‖Q E − E Λ‖ /
  /// λ_K.
  double residual_over_gap = 0.0;
  bool exact_integers = false;  ///< the Gram matrix was computed in integers
  Duration gram_time{};
  Duration solve_time{};
  Duration back_projection_time{};
  std::optional<StaReport> sta;        ///< of the solver "sta" alone
  std::optional<JoinedReport> joined;  ///< of the solver "joined" alone
  std::string note;                    ///< anything a person should know, e.g. a smaller rank than asked for
};

/// The eigenspace of all views of `source`.
/// @throws std::invalid_argument (fewer than two views, unknown solver, no memory for the one named), Error
/// when the result would be inaccurate, Interrupted.
Eigenspace solve_eigenspace(const AppearanceSource& source, const SolverOptions& options,
                            SolverReport* report = nullptr, const Progress& progress = {},
                            std::stop_token stop = {});

}  // namespace eigenpose
