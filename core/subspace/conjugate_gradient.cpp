#include "core/subspace/conjugate_gradient.h"

#include <algorithm>
#include <cmath>

#include "core/base/error.h"
#include "core/base/linear_algebra.h"
#include "core/base/random.h"

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The search for one eigenvector after the other.
class Search {
 public:
  Search(Index size, const SymmetricProduct& product, const ConjugateGradientOptions& options, Index count)
      : product_(product), options_(options), vectors_(size, count), images_(size, count), values_(count) {}

  [[nodiscard]] Index found() const { return found_; }
  [[nodiscard]] std::size_t products() const { return products_; }
  [[nodiscard]] auto vectors() const { return vectors_.leftCols(found_); }
  [[nodiscard]] auto images() const { return images_.leftCols(found_); }

  /// Searches the next eigenvector. @return its eigenvalue.
  double next(const std::stop_token& stop) {
    VectorXd e = start();
    VectorXd image = times(e);
    VectorXd direction, previous_gradient;
    double value = e.dot(deflated(image, e));
    for (std::size_t iteration = 0; iteration < options_.max_iterations; ++iteration) {
      if (stop.stop_requested()) throw Interrupted("interrupted while solving for eigenvectors");
      VectorXd gradient = deflated(image, e) - value * e;
      orthogonalize(gradient);
      const double largest = found_ > 0 ? values_[0] : value;
      if (gradient.norm() <= options_.tolerance * largest) break;
      if (previous_gradient.size() == 0) {
        direction = gradient;
      } else {
        const double beta = gradient.dot(gradient - previous_gradient) / previous_gradient.squaredNorm();
        direction = gradient + std::max(0.0, beta) * direction;
      }
      previous_gradient = gradient;
      VectorXd step = direction;
      orthogonalize(step);
      step -= e * e.dot(step);
      const double length = step.norm();
      if (length <= 0.0) break;
      step /= length;
      const VectorXd step_image = times(step);
      // e and step are orthonormal: the 2 × 2 problem has a closed form.
      const double a = value;
      const double b = step.dot(deflated(image, e));
      const double c = step.dot(deflated(step_image, step));
      const double angle = 0.5 * std::atan2(2.0 * b, a - c);
      const VectorXd moved = std::cos(angle) * e + std::sin(angle) * step;
      image = (std::cos(angle) * image + std::sin(angle) * step_image).eval();
      const double norm = moved.norm();
      e = moved / norm;
      image /= norm;
      // The direction stays tangent to the sphere at the new point.
      direction -= e * e.dot(direction);
      // Rounding drifts in the updated image: a fresh product now and then.
      if (iteration % 32 == 31) image = times(e);
      value = e.dot(deflated(image, e));
    }
    vectors_.col(found_) = e;
    images_.col(found_) = image;
    values_[found_] = value;
    ++found_;
    return value;
  }

 private:
  VectorXd times(const VectorXd& x) {
    MatrixXd y(x.size(), 1);
    product_(x, y);
    ++products_;
    return y.col(0);
  }

  /// Q x − Σ λᵢ eᵢ (eᵢᵀ x), given Q x.
  [[nodiscard]] VectorXd deflated(const VectorXd& image, const VectorXd& x) const {
    const VectorXd along = values_.head(found_).cwiseProduct(vectors().transpose() * x);
    return image - vectors() * along;
  }

  void orthogonalize(VectorXd& x) const {
    for (int pass = 0; pass < 2; ++pass) x -= vectors() * (vectors().transpose() * x).eval();
  }

  VectorXd start() {
    VectorXd e(vectors_.rows());
    for (double& x : e) x = random_.normal();
    orthogonalize(e);
    return e.normalized();
  }

  const SymmetricProduct& product_;
  const ConjugateGradientOptions& options_;
  SeededRandom random_{20};
  MatrixXd vectors_;
  MatrixXd images_;
  VectorXd values_;
  Index found_ = 0;
  std::size_t products_ = 0;
};

}  // namespace

EigenPairs conjugate_gradient_eigenpairs(Index size, const SymmetricProduct& product,
                                         const ConjugateGradientOptions& options,
                                         const std::stop_token& stop) {
  const Index count = std::min(size, options.wanted + 1);
  Search search(size, product, options, count);
  while (search.found() < count && search.next(stop) > options.noise) {
  }
  const MatrixXd projected = search.vectors().transpose() * search.images();
  const auto [values, coefficients] = symmetric_eigen(0.5 * (projected + projected.transpose()));
  const MatrixXd vectors = search.vectors() * coefficients;
  const VectorXd residuals =
      (search.images() * coefficients - vectors * values.asDiagonal()).colwise().norm().transpose();

  EigenPairs result;
  result.products = search.products();
  Index rank = 0;
  while (rank < std::min(options.wanted, values.size()) && values[rank] > options.noise) ++rank;
  result.values = values.head(rank);
  result.vectors = vectors.leftCols(rank);
  result.residuals = residuals.head(rank);
  if (rank < values.size()) {
    result.next_value = std::max(values[rank], 0.0);
    result.next_residual = residuals[rank];
  }
  result.converged = rank == 0 || residuals.head(rank).maxCoeff() <= options.tolerance * values[0];
  return result;
}

}  // namespace eigenpose
