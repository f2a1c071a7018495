#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/base/linear_algebra.h"
#include "core/subspace/solvers.h"
#include "core/subspace/view_reader.h"

namespace eigenpose::detail {

Eigen::MatrixXd centred_appearances(const AppearanceSource& source, std::size_t first, std::size_t n,
                                    Eigen::VectorXd& mean) {
  Eigen::MatrixXd views(static_cast<Eigen::Index>(source.length()), static_cast<Eigen::Index>(n));
  ViewReader reader(source);
  for (Eigen::Index j = 0; j < views.cols(); ++j) {
    const std::size_t number = first + static_cast<std::size_t>(j);
    reader.read(number, 1).widen(0, 0, source.length(), views.col(j).data());
    if (!source.has_bytes()) continue;
    const double norm = views.col(j).norm();
    if (norm == 0.0) {
      throw std::invalid_argument("view " + std::to_string(number) +
                                  " is black: it has no energy to scale; leave it out");
    }
    views.col(j) /= norm;
  }
  mean = views.rowwise().mean();
  views.colwise() -= mean;
  return views;
}

EigenPairs full_eigenpairs(const Eigen::MatrixXd& matrix, Eigen::Index wanted, double noise) {
  const auto [values, vectors] = symmetric_eigen(matrix);
  Eigen::Index rank = 0;
  while (rank < std::min(wanted, values.size()) && values[rank] > noise) ++rank;
  EigenPairs pairs;
  pairs.values = values.head(rank);
  pairs.vectors = vectors.leftCols(rank);
  pairs.residuals = (matrix * pairs.vectors - pairs.vectors * pairs.values.asDiagonal()).colwise().norm();
  pairs.next_value = rank < values.size() ? std::max(values[rank], 0.0) : 0.0;
  return pairs;
}

}  // namespace eigenpose::detail
