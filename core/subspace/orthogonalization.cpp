#include "core/subspace/orthogonalization.h"

#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "core/subspace/back_projection.h"

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Span {
  MatrixXd basis;
  VectorXd singular_values;
};

/// Left singular vectors of tall columns with σ ≥ tau. QR first: the SVD is then of a small triangle, and
/// small singular values keep their digits, which the product of the columns would lose.
Span span_of(const MatrixXd& columns, double tau) {
  if (!(tau > 0.0 && tau < 1.0)) {
    throw std::invalid_argument("tau = " + std::to_string(tau) + ": it is a singular value in (0, 1)");
  }
  const Index thin = std::min(columns.rows(), columns.cols());
  const Eigen::HouseholderQR<MatrixXd> qr(columns);
  const MatrixXd triangle = qr.matrixQR().topRows(thin).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<MatrixXd> svd(triangle, Eigen::ComputeThinU);
  Index kept = 0;
  while (kept < thin && svd.singularValues()[kept] >= tau) ++kept;
  MatrixXd padded = MatrixXd::Zero(columns.rows(), kept);
  padded.topRows(thin) = svd.matrixU().leftCols(kept);
  return {qr.householderQ() * padded, svd.singularValues()};
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
  const Span span = span_of(columns, tau);
  return {span.basis.cast<float>(), span.singular_values};
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
  const MatrixXd basis = span_of(columns.leftCols(at), tau).basis;
  MatrixXd scatter = MatrixXd::Zero(basis.cols(), basis.cols());
  double total_scatter = 0.0;
  for (const Eigenspace& space : spaces) {
    const MatrixXd inside = basis.transpose() * space.basis.cast<double>();
    scatter += inside * space.eigenvalues.asDiagonal() * inside.transpose();
    total_scatter += space.total_scatter;
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(scatter);
  const VectorXd values = solver.eigenvalues().reverse().cwiseMax(0.0);
  return finished_eigenspace(mean, basis * solver.eigenvectors().rowwise().reverse(), values, total_scatter);
}

}  // namespace eigenpose
