#pragma once

/// Sets of views with known spectra, and the yardstick between subspaces.

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace eigenpose::test {

/// The largest principal angle between the spans of two sets of orthonormal columns, degrees; 90 where their
/// numbers of columns differ. From sines, so that small angles are exact.
double largest_angle_deg(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b);

/// `count` views of `length` bytes: a smooth curve of pictures with some noise, all different.
std::vector<std::uint8_t> smooth_views(std::size_t count, std::size_t length, unsigned seed);

/// N × M unit-energy columns whose scatter has exactly the rank r: random combinations of r random
/// non-negative pictures.
Eigen::MatrixXf views_of_rank(Eigen::Index length, Eigen::Index count, Eigen::Index rank, unsigned seed);

/// N × M unit-energy columns, every one a turn of one picture by one pixel: the Gram matrix is circulant, and
/// all its eigenvalues but one or two come in pairs. @pre count ≤ length, and length divisible by count.
Eigen::MatrixXf turned_views(Eigen::Index length, Eigen::Index count, unsigned seed);

}  // namespace eigenpose::test
