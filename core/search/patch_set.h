#pragma once

/// All segments (m = 1) or patches (m ≥ 2) of a list of manifolds, and the exact closest point on each.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/manifold/manifold.h"
#include "core/search/bernstein.h"

namespace eigenpose {

/// The closest point on one patch: which, where in it, and how far.
struct PatchPoint {
  std::uint32_t manifold = 0;
  std::uint32_t patch = 0;
  std::array<double, max_manifold_dofs> u{};  ///< one per axis of the manifold, in [0, 1]; 0 on constant axes
  double squared_distance = 0.0;
};

/// On m ≥ 2 DOFs the distance of an answer is within this of the true one. On one DOF it is exact up to
/// rounding.
inline constexpr double patch_distance_tolerance = 1e-7;

/// The pieces of all manifolds, numbered manifold by manifold, segment by segment (last axis fastest).
///
/// On one patch f is a polynomial of degree p per axis, so D(u) = ‖point − f(u)‖² is one of degree 2p. With C
/// the middle coefficient, e = point − C and f − C = Σ_k w_k(u)(c_k − C):
///     D(u) = ‖e‖² − 2 Σ_k w_k(u) e·(c_k − C) + ‖f(u) − C‖²
/// The last term does not depend on the point: its Bernstein coefficients are stored. Per query remain
/// (p+1)^m − 1 dot products; everything after that is scalar. Subtracting C first keeps the rounding error at
/// 1e-16 times the squared size of patch and distance, not of the coordinates.
class PatchSet {
 public:
  /// @param manifolds are kept by reference. @throws std::invalid_argument for an empty list or unequal K.
  explicit PatchSet(std::span<const Manifold> manifolds);

  [[nodiscard]] std::size_t size() const { return manifold_of_.size(); }
  [[nodiscard]] std::size_t dimensions() const { return dimensions_; }  ///< K
  [[nodiscard]] std::span<const Manifold> manifolds() const { return manifolds_; }
  [[nodiscard]] std::uint32_t manifold_of(std::size_t patch) const { return manifold_of_[patch]; }
  [[nodiscard]] std::size_t memory() const;

  /// Degrees along the axes that are not constant.
  [[nodiscard]] const bernstein::Shape& shape(std::size_t patch) const {
    return families_[manifold_of_[patch]].shape;
  }
  /// K × Π(p+1) Bézier points, last axis fastest, of the axes that are not constant.
  [[nodiscard]] Eigen::MatrixXd bezier(std::size_t patch) const;

  /// The closest point of the patch, if its squared distance is at most `cut`; on m ≥ 2 DOFs also not where
  /// the manifold certainly comes nearer in a neighbouring patch. @param point K numbers.
  [[nodiscard]] bool closest(std::size_t patch, const double* point, double cut, PatchPoint& result) const;

  /// The DOF values of a place, canonical; entries beyond m are 0.
  [[nodiscard]] std::array<double, max_manifold_dofs> position(const PatchPoint& point) const;
  /// ‖point − f‖ at a place, computed from f itself.
  [[nodiscard]] double distance(const PatchPoint& place, const double* point) const;

 private:
  /// What the patches of one manifold have in common.
  struct Family {
    bernstein::Shape shape;                             ///< of f, axes that are not constant
    bernstein::Shape squared;                           ///< of D: twice the degree
    std::array<std::size_t, max_manifold_dofs> axis{};  ///< number in the manifold of each axis of `shape`
    std::size_t first_patch = 0;
    std::size_t first_column = 0;  ///< into columns_
    std::size_t first_norm = 0;    ///< into norms_
    std::size_t points = 1;        ///< Π(p+1)
    std::size_t middle = 0;        ///< which of the points is C
    std::size_t norms = 1;         ///< Π(2p+1)
  };
  /// Segment along each axis of the manifold.
  using Segments = std::array<std::size_t, max_manifold_dofs>;
  [[nodiscard]] Segments segments_of(std::size_t patch) const;
  void add_family(const Manifold& manifold);
  void add_patch(const Manifold& manifold, std::size_t patch);
  bool closest_on_quadratic_curve(const Family& family, std::size_t local, const double* point, double cut,
                                  PatchPoint& result) const;
  /// With C the middle of a patch's coefficients and e = point − C: `products` gets eᵀ(c − C) of each
  /// coefficient c. @param columns of the patch's coefficients. @return eᵀe.
  double products_with_net(const Manifold& manifold, const std::uint32_t* columns, const Family& family,
                           const double* point, double* products) const;
  /// From values at spline coefficients to Bézier points to degree 2p, one axis at a time, in `net`.
  static void elevate(const Manifold& manifold, const Family& family, const Segments& segments, double* net,
                      double* work);
  /// Which faces of a patch have a smooth neighbour.
  static bernstein::Joints joints_of(const Manifold& manifold, const Family& family,
                                     const Segments& segments);

  std::span<const Manifold> manifolds_;
  std::size_t dimensions_ = 0;
  std::vector<Family> families_;            ///< one per manifold
  std::vector<std::uint32_t> manifold_of_;  ///< one per patch
  std::vector<std::uint32_t> columns_;      ///< coefficient columns of each patch, last axis fastest
  std::vector<double> norms_;               ///< Bernstein coefficients of ‖f − C‖²
};

}  // namespace eigenpose
