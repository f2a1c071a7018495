#include "core/subspace/orthogonalization.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/linear_algebra.h"
#include "core/subspace/back_projection.h"
#include "core/subspace/solvers.h"
#include "core/subspace/tile_products.h"
#include "core/subspace/view_reader.h"

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Left singular vectors of the columns with σ ≥ tau.
LeftSingular span_of(const MatrixXd& columns, double tau) {
  if (!(tau > 0.0 && tau < 1.0)) {
    throw std::invalid_argument("tau = " + std::to_string(tau) + ": it is a singular value in (0, 1)");
  }
  return left_singular(columns, tau);
}

void check_rows(Index found, Index expected) {
  if (found != expected) {
    throw std::invalid_argument("the subspaces have vectors of " + std::to_string(expected) + " and of " +
                                std::to_string(found) + " numbers");
  }
}

ViewBlock block_of(const MatrixXd& columns) {
  return {nullptr, nullptr, static_cast<std::size_t>(columns.cols()),
          static_cast<std::size_t>(columns.rows()), columns.data()};
}

}  // namespace

OrthogonalizedBasis orthogonalize(std::span<const Eigen::MatrixXf> bases, double tau) {
  if (bases.empty()) throw std::invalid_argument("there is no subspace to make orthogonal");
  Index total = 0;
  for (const auto& basis : bases) {
    check_rows(basis.rows(), bases.front().rows());
    total += basis.cols();
  }
  MatrixXd columns(bases.front().rows(), total);
  Index at = 0;
  for (const auto& basis : bases) {
    columns.middleCols(at, basis.cols()) = basis.cast<double>();
    at += basis.cols();
  }
  const LeftSingular span = span_of(columns, tau);
  return {span.vectors.cast<float>(), span.values};
}

Eigenspace orthogonalize(std::span<const Eigenspace> spaces, double tau) {
  if (spaces.empty()) throw std::invalid_argument("there is no subspace to make orthogonal");
  const Index length = spaces.front().length();
  VectorXd mean = VectorXd::Zero(length);
  Index total = 0;
  for (const Eigenspace& space : spaces) {
    check_rows(space.length(), length);
    mean += space.mean.cast<double>() / static_cast<double>(spaces.size());
    total += space.components();
  }
  MatrixXd columns(length, total + static_cast<Index>(spaces.size()));
  Index at = 0;
  for (const Eigenspace& space : spaces) {
    columns.middleCols(at, space.components()) = space.basis.cast<double>();
    at += space.components();
  }
  for (const Eigenspace& space : spaces) {
    const VectorXd difference = space.mean.cast<double>() - mean;
    // Means that are equal up to float rounding have no direction.
    if (difference.norm() > 1e-6) columns.col(at++) = difference.normalized();
  }
  const MatrixXd basis = span_of(columns.leftCols(at), tau).vectors;
  MatrixXd scatter = MatrixXd::Zero(basis.cols(), basis.cols());
  double total_scatter = 0.0;
  for (const Eigenspace& space : spaces) {
    const MatrixXd inside = basis.transpose() * space.basis.cast<double>();
    scatter += inside * space.eigenvalues.asDiagonal() * inside.transpose();
    total_scatter += space.total_scatter;
  }
  const SymmetricEigen inner = symmetric_eigen(scatter);
  return finished_eigenspace(mean, basis * inner.vectors, inner.values.cwiseMax(0.0), total_scatter);
}

double ScatterFactor::rest() const {
  return std::max(0.0, total_scatter - factor.squaredNorm());
}

void join(ScatterFactor& all, const ScatterFactor& more) {
  if (all.views == 0) {
    all = more;
    return;
  }
  check_rows(more.mean.size(), all.mean.size());
  const auto before = static_cast<double>(all.views);
  const auto added = static_cast<double>(more.views);
  const double both = before + added;
  const VectorXd between = std::sqrt(before * added / both) * (more.mean - all.mean);
  const Index columns = all.factor.cols();
  all.factor.conservativeResize(Eigen::NoChange, columns + more.factor.cols() + 1);
  all.factor.middleCols(columns, more.factor.cols()) = more.factor;
  all.factor.rightCols(1) = between;
  all.mean += added / both * (more.mean - all.mean);
  all.views += more.views;
  all.total_scatter += more.total_scatter + between.squaredNorm();
  all.rest_bound += more.rest_bound;
}

MatrixXd ScatterFactor::products(unsigned threads) const {
  constexpr Index strip = 96;
  const Index columns = factor.cols();
  const ViewBlock block = block_of(factor);
  MatrixXd result(columns, columns);
  for (Index first = 0; first < columns; first += strip) {
    const Index n = std::min(strip, columns - first);
    const Index below = columns - first;
    const ViewBlock others = block.part(static_cast<std::size_t>(first), static_cast<std::size_t>(below));
    result.block(first, first, below, n) = view_products(others, factor.middleCols(first, n), threads);
  }
  result.triangularView<Eigen::StrictlyUpper>() = result.transpose();
  return result;
}

MatrixXd ScatterFactor::combined(const MatrixXd& weights, unsigned threads) const {
  MatrixXd columns = MatrixXd::Zero(factor.rows(), weights.cols());
  add_weighted_views(block_of(factor), weights, 0, threads, columns);
  return columns;
}

void orthogonalize(ScatterFactor& views, double spare, unsigned threads) {
  const SymmetricEigen found = symmetric_eigen(views.products(threads));
  const double noise = detail::rounding_of_scatter(views.views);
  Index kept = found.values.size();
  for (double gone = 0.0; kept > 0; --kept) {
    gone += std::max(0.0, found.values[kept - 1]);
    if (gone > spare && found.values[kept - 1] > noise) break;
  }
  if (kept < found.values.size()) views.rest_bound += std::max(0.0, found.values[kept]);
  views.factor = views.combined(found.vectors.leftCols(kept), threads);
}

}  // namespace eigenpose
