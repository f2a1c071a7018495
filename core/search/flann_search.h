#pragma once

/// FLANN's exact single kd-tree over samples of the manifolds, then the exact closest point on every patch
/// that can matter: the established method, made exact by the certificate of sample_cloud.h.

#include "core/search/search.h"

namespace eigenpose {

class FlannSearch final : public ManifoldSearch {
 public:
  explicit FlannSearch(std::span<const Manifold> manifolds);
  ~FlannSearch() override;
  FlannSearch(const FlannSearch&) = delete;
  FlannSearch& operator=(const FlannSearch&) = delete;

  [[nodiscard]] std::size_t nearest_into(
      const Eigen::Ref<const Eigen::VectorXf>& point, std::span<ClosestPoint> results,
      double bound = std::numeric_limits<double>::infinity()) const override;
  [[nodiscard]] std::string_view name() const override { return "flann"; }
  [[nodiscard]] std::size_t memory() const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace eigenpose
