#pragma once

/// The oracle of the searches: every segment of every manifold, by methods that the searches do not use.
///
/// Curves of degree 1 and 2: D′ is a polynomial of degree at most 3 whose roots are written down in closed
/// form. Everything else: every patch sampled densely, then damped Newton from the best samples of different
/// patches. In double throughout; its time grows with everything.

#include "core/search/search.h"

namespace eigenpose {

class ExhaustiveSearch final : public ManifoldSearch {
 public:
  explicit ExhaustiveSearch(std::span<const Manifold> manifolds);

  [[nodiscard]] std::size_t nearest_into(
      const Eigen::Ref<const Eigen::VectorXf>& point, std::span<ClosestPoint> results,
      double bound = std::numeric_limits<double>::infinity()) const override;
  [[nodiscard]] std::string_view name() const override { return "exhaustive"; }
  [[nodiscard]] std::size_t memory() const override;

 private:
  /// A manifold cut into samples, or into closed-form segments.
  struct Scan {
    bool closed_form = false;
    std::vector<double>
        starts;  ///< closed form: where each segment begins, in its DOF, and its width, alternating
    Eigen::MatrixXd terms;    ///< closed form: 3 columns a segment, f = c₀ + c₁u + c₂u²
    Eigen::MatrixXd samples;  ///< otherwise: K × samples
    std::vector<double> q;    ///< otherwise: m numbers a sample
    std::vector<std::size_t> patch;
  };
  static void cut_segments(const Manifold& manifold, std::size_t axis, Scan& scan);
  static void cut_samples(const Manifold& manifold, std::size_t active_axes, Scan& scan);
  [[nodiscard]] ClosestPoint closest_by_roots(std::size_t manifold, const Eigen::VectorXd& point) const;
  [[nodiscard]] ClosestPoint closest_by_samples(std::size_t manifold, const Eigen::VectorXd& point) const;

  std::vector<Scan> scans_;
};

}  // namespace eigenpose
