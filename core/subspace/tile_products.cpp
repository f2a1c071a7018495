#include "core/subspace/tile_products.h"

#include <algorithm>
#include <vector>

#include "core/base/parallel.h"
#include "core/simd/gram_products.h"

namespace eigenpose {
namespace {

constexpr std::size_t kPixels = 128;  ///< pixels that one job of add_weighted_views works on; a multiple of 8
constexpr std::size_t kJobViews = 24;  ///< views that one job of view_products works on; a multiple of 3
constexpr std::size_t kStretch = 512;  ///< numbers of a view packed at once there

}  // namespace

void add_weighted_views(const ViewBlock& block, const Eigen::MatrixXd& weights, std::size_t first,
                        unsigned threads, Eigen::MatrixXd& out) {
  const auto rows = static_cast<std::size_t>(weights.cols());
  const auto stride = static_cast<std::size_t>(weights.rows());
  parallel_for((block.length + kPixels - 1) / kPixels, threads, [&](std::size_t job) {
    const std::size_t pixel = job * kPixels;
    const std::size_t n = std::min(kPixels, block.length - pixel);
    std::vector<double> packed(kViewDepth * kPixels, 0.0);
    std::vector<double> sums(rows * kPixels, 0.0);
    // The running sums continue, so that strips do not show in the result.
    for (std::size_t r = 0; r < rows; ++r) {
      std::copy_n(out.data() + r * block.length + pixel, n, sums.data() + r * kPixels);
    }
    for (std::size_t view = 0; view < block.count; view += kViewDepth) {
      const std::size_t depth = std::min(kViewDepth, block.count - view);
      for (std::size_t v = 0; v < depth; ++v) block.widen(view + v, pixel, n, packed.data() + v * kPixels);
      add_combinations({weights.data() + first + view, stride, rows}, {packed.data(), kPixels, depth},
                       kPixels, {sums.data(), kPixels});
    }
    for (std::size_t r = 0; r < rows; ++r) {
      std::copy_n(sums.data() + r * kPixels, n, out.data() + r * block.length + pixel);
    }
  });
}

Eigen::MatrixXd view_products(const ViewBlock& block, const Eigen::MatrixXd& vectors, unsigned threads) {
  const auto columns = static_cast<std::size_t>(vectors.cols());
  Eigen::MatrixXd out(static_cast<Eigen::Index>(block.count), vectors.cols());
  parallel_for((block.count + kJobViews - 1) / kJobViews, threads, [&](std::size_t job) {
    const std::size_t first = job * kJobViews;
    const std::size_t n = std::min(kJobViews, block.count - first);
    std::vector<double> packed(kJobViews * kStretch);
    Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(vectors.cols(), static_cast<Eigen::Index>(n));
    for (std::size_t k = 0; k < block.length; k += kStretch) {
      const std::size_t width = std::min(kStretch, block.length - k);
      for (std::size_t v = 0; v < n; ++v) block.widen(first + v, k, width, packed.data() + v * kStretch);
      add_inner_products(Rows<double>{packed.data(), kStretch, n},
                         Rows<double>{vectors.data() + k, block.length, columns}, width,
                         Sums<double>{sums.data(), columns});
    }
    out.middleRows(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(n)) = sums.transpose();
  });
  return out;
}

}  // namespace eigenpose
