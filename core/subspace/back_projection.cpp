#include "core/subspace/back_projection.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/linear_algebra.h"
#include "core/base/work_meter.h"
#include "core/subspace/tile_products.h"
#include "core/subspace/view_reader.h"

namespace eigenpose {
namespace {

constexpr double kSignTolerance = 1e-4;  ///< share of the largest entry: see Eigenspace's invariants

}  // namespace

Eigen::MatrixXd back_project(const AppearanceSource& source, const Eigen::VectorXd& norms,
                             const Eigen::MatrixXd& weights, const BackProjectionOptions& options,
                             const Progress& progress, std::stop_token stop) {
  const std::size_t count = source.count();
  const Eigen::MatrixXd scaled = norms.cwiseInverse().asDiagonal() * weights;
  ViewReader reader(source);
  std::size_t strip = reader.views_in(options.tile_memory);
  if (!reader.resident() && strip > kViewDepth) strip -= strip % kViewDepth;
  if (reader.resident()) strip = 16 * kViewDepth;  // only to hear of stop requests now and then
  WorkMeter meter(progress, std::move(stop), "back-projection", count);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(source.length()), weights.cols());
  for (std::size_t first = 0; first < count; first += strip) {
    const std::size_t n = std::min(strip, count - first);
    add_weighted_views(reader.read(first, n), scaled, first, options.threads, out);
    meter.finished(n);
  }
  return out;
}

Eigenspace eigenspace_from_gram(const AppearanceSource& source, const Eigen::VectorXd& norms,
                                const GramEigenvectors& gram, const BackProjectionOptions& options,
                                const Progress& progress, std::stop_token stop) {
  const Eigen::Index components = gram.values.size();
  Eigen::MatrixXd weights(gram.vectors.rows(), components + 1);
  weights.leftCols(components) = gram.vectors * gram.values.cwiseSqrt().cwiseInverse().asDiagonal();
  weights.col(components).setConstant(1.0 / static_cast<double>(gram.vectors.rows()));
  Eigen::MatrixXd columns = back_project(source, norms, weights, options, progress, std::move(stop));
  const Eigen::VectorXd mean = columns.col(components);
  columns.conservativeResize(Eigen::NoChange, components);
  return finished_eigenspace(mean, std::move(columns), gram.values, gram.total_scatter);
}

Eigenspace finished_eigenspace(const Eigen::VectorXd& mean, Eigen::MatrixXd basis,
                               const Eigen::VectorXd& values, double total_scatter) {
  orthonormalize_columns(basis);
  for (Eigen::Index k = 0; k < basis.cols(); ++k) {
    // Where several entries are as large up to rounding, the first of them decides on every machine.
    const double large = basis.col(k).cwiseAbs().maxCoeff() * (1.0 - kSignTolerance);
    Eigen::Index first = 0;
    while (std::abs(basis(first, k)) < large) ++first;
    if (basis(first, k) < 0.0) basis.col(k) = -basis.col(k);
  }
  return {mean.cast<float>(), basis.cast<float>(), values, total_scatter};
}

}  // namespace eigenpose
