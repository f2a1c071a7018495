#include "core/subspace/orthogonalization.h"

#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/linear_algebra.h"
#include "core/subspace/back_projection.h"

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

}  // namespace eigenpose
