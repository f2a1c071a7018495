#pragma once

/// From coefficients over views to vectors over pixels, and the last touches on an eigenspace.

#include <cstddef>
#include <stop_token>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/subspace/appearance_source.h"
#include "core/subspace/eigenspace.h"

namespace eigenpose {

struct BackProjectionOptions {
  unsigned threads = 0;
  std::size_t tile_memory = 0;  ///< bytes for views read from a source that is not resident; 0 means no limit
};

/// X · weights in double, N × C, with X the appearances (unit energy) and `weights` M × C. Reads the views
/// once.
/// @param norms as `view_norms` gives them. Memory: 8·N·C bytes beside the views. @throws Interrupted.
Eigen::MatrixXd back_project(const AppearanceSource& source, const Eigen::VectorXd& norms,
                             const Eigen::MatrixXd& weights, const BackProjectionOptions& options,
                             const Progress& progress = {}, std::stop_token stop = {});

/// Leading eigenpairs of a centred Gram matrix.
struct GramEigenvectors {
  Eigen::VectorXd values;      ///< K, descending, positive
  Eigen::MatrixXd vectors;     ///< M × K, orthonormal, each orthogonal to (1,…,1)
  double total_scatter = 0.0;  ///< trace of the centred Gram matrix
};

/// The eigenspace from the eigenvectors ẽ of the centred Gram matrix: e = λ^(−1/2) X ẽ (eq. 22) and the mean.
/// @param norms as `view_norms` gives them. @throws Interrupted.
Eigenspace eigenspace_from_gram(const AppearanceSource& source, const Eigen::VectorXd& norms,
                                const GramEigenvectors& gram, const BackProjectionOptions& options,
                                const Progress& progress = {}, std::stop_token stop = {});

/// The eigenspace from nearly orthonormal columns: orthonormalised in double, signs fixed, rounded to float.
Eigenspace finished_eigenspace(const Eigen::VectorXd& mean, Eigen::MatrixXd basis,
                               const Eigen::VectorXd& values, double total_scatter);

}  // namespace eigenpose
