#pragma once

/// Pattern rejection: which manifolds a point is *certainly not* near, in a handful of dot products.
///
/// A composite rejector in the sense of Baker and Nayar: a tree of components. A component is a unit
/// direction v, the axis being cut into cells; a class is one segment or patch W of a manifold, its extent on
/// v the interval [min v·f, max v·f] (from the Bernstein coefficients of v·f), widened by the rejection
/// distance T on both sides. The point's cell says which component comes next, one built for the classes
/// whose widened interval reaches that cell.
///
/// Guarantee by construction: if ‖x − f(u)‖ ≤ T then |v·x − v·f(u)| ≤ ‖v‖·T = T (Cauchy–Schwarz), so the
/// class of f(u) reaches every cell that x can fall into. A manifold within T is never rejected; searching
/// the survivors gives the answer of searching everything.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/search/patch_set.h"
#include "core/search/search.h"

namespace eigenpose {

struct RejectorOptions {
  /// T: a manifold within this distance of the point survives. > 0.
  double distance = 0.1;
  /// A set of this many classes or fewer is not divided further.
  std::size_t small_set = 8;
  /// Cells per component.
  std::size_t cells = 8;
  /// Components on the way from the root at most.
  std::size_t max_depth = 10;
  /// A patch that reaches several cells is listed in each: all lists together are at most this many times the
  /// number of patches.
  double max_growth = 12.0;
  /// A component is used only if a point of the set keeps at most this share of the classes on average.
  double worthwhile = 0.75;
};

/// The composite rejector. Immutable; const calls are thread-safe and allocate nothing.
class PatternRejector {
 public:
  /// @param patches is kept by reference. @throws std::invalid_argument for a distance that is not positive
  /// and finite, or fewer than 2 cells.
  PatternRejector(const PatchSet& patches, const RejectorOptions& options);

  /// Patches that a manifold point within the distance may belong to; all others are rejected.
  /// @param point K numbers.
  [[nodiscard]] std::span<const std::uint32_t> survivors(const double* point) const;

  [[nodiscard]] const RejectorOptions& options() const { return options_; }
  [[nodiscard]] std::size_t components() const { return nodes_.size(); }
  [[nodiscard]] std::size_t memory() const;

 private:
  struct Interval {
    double low;
    double high;
  };
  struct Node {
    std::size_t direction = 0;    ///< into directions_, K numbers; unused by a leaf
    double low = 0.0;             ///< no class reaches below
    double high = 0.0;            ///< or above
    std::size_t first_cut = 0;    ///< into cuts_: inner ends of the cells, ascending
    std::size_t cuts = 0;         ///< 0 for a leaf
    std::size_t first_child = 0;  ///< into children_, cuts + 1 of them
    std::size_t first_class = 0;  ///< into classes_, for a leaf
    std::size_t class_count = 0;
  };
  /// One way to divide a set of classes.
  struct Division {
    double share = 1.0;    ///< of the classes that a point of the set keeps on average
    double reached = 0.0;  ///< entries of the cells' lists together
    Eigen::VectorXd direction;
    std::vector<double> cuts;       ///< inner ends of the cells, ascending
    std::vector<Interval> extents;  ///< of each class along the direction
  };
  [[nodiscard]] Division divide_along(const Eigen::VectorXd& direction,
                                      std::span<const std::uint32_t> classes) const;
  /// The division that keeps fewest classes; nothing where none is worthwhile or fits the budget.
  [[nodiscard]] std::optional<Division> best_division(std::span<const std::uint32_t> classes,
                                                      double budget) const;
  std::size_t add_leaf(std::size_t number, std::span<const std::uint32_t> classes);
  /// @param budget how many entries the lists below may have together. @returns the number of the node.
  std::size_t divide(std::vector<std::uint32_t> classes, std::size_t depth, double budget);
  [[nodiscard]] Interval extent(std::uint32_t patch, const Eigen::VectorXd& direction) const;

  const PatchSet& patches_;
  RejectorOptions options_;
  std::vector<Eigen::MatrixXd> nets_;  ///< Bézier points while building
  Eigen::MatrixXd centres_;            ///< K × patches while building
  std::vector<Node> nodes_;
  std::vector<double> directions_;
  std::vector<double> cuts_;
  std::vector<std::size_t> children_;
  std::vector<std::uint32_t> classes_;
};

/// Rejection, then the exact closest point on what survives. Answers within the rejection distance are those
/// of the tree; what lies beyond is not looked for, whatever the caller's bound.
class RejectionSearch final : public ManifoldSearch {
 public:
  RejectionSearch(std::span<const Manifold> manifolds, const RejectorOptions& options);
  RejectionSearch(const RejectionSearch&) = delete;
  RejectionSearch& operator=(const RejectionSearch&) = delete;

  [[nodiscard]] std::size_t nearest_into(
      const Eigen::Ref<const Eigen::VectorXf>& point, std::span<ClosestPoint> results,
      double bound = std::numeric_limits<double>::infinity()) const override;
  [[nodiscard]] std::string_view name() const override { return "rejection"; }
  [[nodiscard]] std::size_t memory() const override { return patches_.memory() + rejector_.memory(); }
  [[nodiscard]] const PatternRejector& rejector() const { return rejector_; }
  /// Patches of all manifolds together.
  [[nodiscard]] std::size_t patches() const { return patches_.size(); }

 private:
  PatchSet patches_;
  PatternRejector rejector_;
};

}  // namespace eigenpose
