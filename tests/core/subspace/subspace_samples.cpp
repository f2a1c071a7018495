#include "tests/core/subspace/subspace_samples.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "core/base/linear_algebra.h"

namespace eigenpose::test {

double largest_angle_deg(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b) {
  if (a.cols() != b.cols() || a.rows() != b.rows()) return 90.0;
  const Eigen::MatrixXd u = orthonormal_span(a.cast<double>(), 1e-12);
  const Eigen::MatrixXd v = orthonormal_span(b.cast<double>(), 1e-12);
  if (u.cols() != v.cols()) return 90.0;
  const Eigen::MatrixXd outside = v - u * (u.transpose() * v);
  const Eigen::MatrixXd square = outside.transpose() * outside;
  const double sine = std::sqrt(std::max(0.0, symmetric_eigen(square).values(0)));
  return std::asin(std::min(1.0, sine)) * 180.0 / std::numbers::pi;
}

std::vector<std::uint8_t> smooth_views(std::size_t count, std::size_t length, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  constexpr int kWaves = 30;
  std::vector<double> frequency(kWaves), phase(kWaves), turn(kWaves);
  for (int w = 0; w < kWaves; ++w) {
    frequency[static_cast<std::size_t>(w)] = 40.0 * uniform(random);
    phase[static_cast<std::size_t>(w)] = 2.0 * std::numbers::pi * uniform(random);
    turn[static_cast<std::size_t>(w)] = std::floor(1.0 + 12.0 * uniform(random));
  }
  std::vector<std::uint8_t> views(count * length);
  for (std::size_t j = 0; j < count; ++j) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(j) / static_cast<double>(count);
    for (std::size_t k = 0; k < length; ++k) {
      const double x = static_cast<double>(k) / static_cast<double>(length);
      double value = 90.0 + 12.0 * uniform(random);
      for (std::size_t w = 0; w < kWaves; ++w) {
        value += 60.0 / static_cast<double>(w + 1) *
                 std::cos(frequency[w] * 6.28 * x + turn[w] * angle + phase[w]);
      }
      views[j * length + k] = static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
    }
  }
  return views;
}

Eigen::MatrixXf views_of_rank(Eigen::Index length, Eigen::Index count, Eigen::Index rank, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  // Centring takes one dimension: r + 1 pictures make scatter of rank r.
  Eigen::MatrixXd pictures(length, rank + 1);
  Eigen::MatrixXd weights(rank + 1, count);
  for (double& x : pictures.reshaped()) x = uniform(random);
  for (Eigen::Index j = 0; j < count; ++j) {
    // Scaling to unit energy bends the plane that sums to one, so the weights stay free and the pictures
    // carry the rank.
    for (Eigen::Index r = 0; r <= rank; ++r) weights(r, j) = uniform(random) / static_cast<double>(r + 1);
  }
  Eigen::MatrixXd views = pictures * weights;
  views.colwise().normalize();
  return views.cast<float>();
}

Eigen::MatrixXf turned_views(Eigen::Index length, Eigen::Index count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
  Eigen::VectorXf picture(length);
  for (float& x : picture) x = uniform(random);
  picture.normalize();
  const Eigen::Index step = length / count;
  Eigen::MatrixXf views(length, count);
  for (Eigen::Index j = 0; j < count; ++j) {
    for (Eigen::Index k = 0; k < length; ++k) views(k, j) = picture[(k + j * step) % length];
  }
  return views;
}

}  // namespace eigenpose::test
