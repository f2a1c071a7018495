#pragma once

/// Nene and Nayar's closest point search in sorted projections, with a certificate of exactness.
///
/// Build: for every dimension the samples are sorted; the backward map gives the sample of a rank, the
/// forward map the rank of a sample. O(dn log n) time, 2dn integers and dn floats. Query: a cube of half-side
/// ε around the point is an interval of ranks in every dimension, found by two binary searches. The samples
/// of the smallest interval are the candidates; they are trimmed by integer comparisons in the next smallest
/// intervals, then measured.
///
/// The cube contains the ball of radius ε: every sample within ε is among the candidates. With ε the best
/// distance plus the largest reach of a sample (sample_cloud.h), the answer is exact on the continuous
/// manifolds; until then ε grows.
///
/// S. A. Nene, S. K. Nayar: A simple algorithm for nearest neighbor search in high dimensions, PAMI 19(9),
/// 1997.

#include "core/search/sample_cloud.h"
#include "core/search/search.h"

namespace eigenpose {

class SlabSearch final : public ManifoldSearch {
 public:
  explicit SlabSearch(std::span<const Manifold> manifolds);

  [[nodiscard]] std::size_t nearest_into(
      const Eigen::Ref<const Eigen::VectorXf>& point, std::span<ClosestPoint> results,
      double bound = std::numeric_limits<double>::infinity()) const override;
  [[nodiscard]] std::string_view name() const override { return "slab"; }
  [[nodiscard]] std::size_t memory() const override;

 private:
  void collect(const float* point, double radius, struct SlabMemory& memory) const;

  PatchSet patches_;
  SampleCloud cloud_;
  std::vector<float> sorted_;            ///< coordinates in order: dimension × rank
  std::vector<std::uint32_t> backward_;  ///< dimension × rank: sample
  std::vector<std::uint32_t> forward_;   ///< dimension × sample: rank
  double first_radius_ = 0.0;            ///< twice the largest reach: what a view on a manifold needs
};

}  // namespace eigenpose
