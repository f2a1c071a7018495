#include "core/windows/windows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>

#include "core/base/linear_algebra.h"
#include "core/base/parallel.h"
#include "core/base/statistics.h"
#include "core/simd/dense_products.h"

namespace eigenpose {
namespace {

constexpr float soft_mass = 0.2F;      // a window with less gradient than this fades out
constexpr float soft_energy = 0.2F;    // likewise for brightness
constexpr float chroma_weight = 4.0F;  // colour against brightness

/// The gradient mass of every window, row by row: that of its cells, each summed once.
void gradient_masses(const OrientationGrid& map, std::span<float> masses) {
  constexpr int cells = OrientationGrid::side;
  constexpr int n = WindowGrid::window;
  std::array<float, std::size_t{cells} * (cells - n + 1)> across;  // of n cells side by side
  for (int r = 0; r < cells; ++r) {
    std::array<float, cells> cell{};
    for (int c = 0; c < cells; ++c)
      cell[static_cast<std::size_t>(c)] =
          std::accumulate(map.orientation_at(r, c), map.orientation_at(r, c) + OrientationGrid::bins, 0.0F);
    for (int c = 0; c < WindowGrid::side; ++c)
      across[static_cast<std::size_t>(r * WindowGrid::side + c)] =
          std::accumulate(cell.begin() + c, cell.begin() + c + n, 0.0F);
  }
  for (int p = 0; p < WindowGrid::positions; ++p) {
    float sum = 0.0F;
    for (int r = 0; r < n; ++r) sum += across[static_cast<std::size_t>(p + r * WindowGrid::side)];
    masses[static_cast<std::size_t>(p)] = sum;
  }
}

}  // namespace

float window_vector(const OrientationGrid& map, int row, int column, float* out) {
  constexpr int n = WindowGrid::window;
  constexpr int cells = n * n;
  float mass = 0.0F;
  float* orientation = out;
  for (int r = 0; r < n; ++r) {
    const float* source = map.orientation_at(row + r, column);
    for (int i = 0; i < n * OrientationGrid::bins; ++i) {
      mass += source[i];
      orientation[r * n * OrientationGrid::bins + i] = source[i];
    }
  }
  const float scale = 1.0F / (mass + soft_mass);
  for (int i = 0; i < cells * OrientationGrid::bins; ++i) {
    orientation[i] = std::sqrt(orientation[i] * scale);
  }

  const int bands = map.bands;
  const float per_band = 1.0F / static_cast<float>(bands);
  float energy = 0.0F;
  float* level = out + cells * OrientationGrid::bins;
  float* chroma = level + cells;
  const float weight = chroma_weight / std::sqrt(static_cast<float>(bands));
  for (int r = 0; r < n; ++r) {
    for (int c = 0; c < n; ++c) {
      const float* source = map.brightness_at(row + r, column + c);
      float sum = 0.0F;
      for (int b = 0; b < bands; ++b) {
        sum += source[b];
        energy += source[b] * source[b];
      }
      const int cell = r * n + c;
      level[cell] = sum * per_band;
      if (bands > 1) {
        for (int b = 0; b < bands; ++b) {
          chroma[cell * bands + b] = weight * (source[b] - level[cell]);
        }
      }
    }
  }
  const float divisor = 1.0F / std::sqrt(energy * per_band + soft_energy * soft_energy);
  const int rest = window_length(bands) - cells * OrientationGrid::bins;
  for (int i = 0; i < rest; ++i) {
    level[i] *= divisor;
  }
  return mass;
}

WindowSpace WindowSpace::learn(const std::vector<OrientationGrid>& maps, unsigned threads,
                               std::size_t limit) {
  if (maps.empty()) {
    throw std::invalid_argument("a window eigenspace needs at least one cell map, got none");
  }
  const int length = window_length(maps.front().bands);
  // Two passes over the windows keep memory small: masses first, then the scatter of the chosen ones.
  std::vector<float> scratch(static_cast<std::size_t>(length));
  std::vector<float> masses(maps.size() * WindowGrid::positions);
  parallel_for(maps.size(), threads, [&](std::size_t m) {
    gradient_masses(maps[m], std::span(masses).subspan(m * WindowGrid::positions, WindowGrid::positions));
  });
  const double sum = std::accumulate(masses.begin(), masses.end(), 0.0);
  std::vector<float> sorted = masses;
  const float least_mass = order_statistic(sorted, sorted.size() * 3 / 10);
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    if (masses[i] >= least_mass) {
      chosen.push_back(i);
    }
  }
  const std::size_t count = std::min(limit, chosen.size());
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(length);
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(length, length);
  constexpr Eigen::Index batch = 256;
  Eigen::MatrixXd block(length, batch);
  Eigen::Index filled = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t index = chosen[i * chosen.size() / count];
    const auto position = static_cast<int>(index % WindowGrid::positions);
    window_vector(maps[index / WindowGrid::positions], position / WindowGrid::side,
                  position % WindowGrid::side, scratch.data());
    block.col(filled++) = Eigen::Map<const Eigen::VectorXf>(scratch.data(), length).cast<double>();
    if (filled == batch || i + 1 == count) {
      const auto part = block.leftCols(filled);
      mean += part.rowwise().sum();
      scatter.selfadjointView<Eigen::Lower>().rankUpdate(part);
      filled = 0;
    }
  }
  mean /= static_cast<double>(count);
  scatter.selfadjointView<Eigen::Lower>().rankUpdate(mean, -static_cast<double>(count));
  const SymmetricEigen found = symmetric_eigen(scatter);
  Eigen::MatrixXf basis(length, WindowGrid::components);
  for (int k = 0; k < WindowGrid::components; ++k) {
    Eigen::VectorXd vector = found.vectors.col(k);
    Eigen::Index largest = 0;
    vector.cwiseAbs().maxCoeff(&largest);
    basis.col(k) = (vector(largest) < 0.0 ? -vector : vector).cast<float>();
  }
  return from_parts(mean.cast<float>(), std::move(basis),
                    static_cast<float>(sum / static_cast<double>(masses.size())));
}

WindowSpace WindowSpace::from_parts(Eigen::VectorXf mean, Eigen::MatrixXf basis, float mean_mass) {
  if (basis.rows() != mean.size() || basis.cols() != WindowGrid::components) {
    throw std::invalid_argument("a window eigenspace of length " + std::to_string(mean.size()) +
                                " needs a basis of " + std::to_string(mean.size()) + "×" +
                                std::to_string(WindowGrid::components) + ", not " +
                                std::to_string(basis.rows()) + "×" + std::to_string(basis.cols()));
  }
  WindowSpace space;
  space.mean_ = std::move(mean);
  space.basis_ = std::move(basis);
  space.offset_ = space.basis_.transpose() * space.mean_;
  space.mean_mass_ = std::max(mean_mass, 1e-6F);
  return space;
}

void WindowSpace::project(const OrientationGrid& map, int stride, Eigen::MatrixXf& out,
                          std::vector<float>* masses) const {
  const int per_side = (WindowGrid::side - 1) / stride + 1;
  const int count = per_side * per_side;
  constexpr int longest = window_length(3);
  constexpr int together = 6;
  float vectors[longest * together];
  out.resize(WindowGrid::components, count);
  if (masses != nullptr) {
    masses->resize(static_cast<std::size_t>(count));
  }
  for (int first = 0; first < count; first += together) {
    const int n = std::min(together, count - first);
    for (int k = 0; k < n; ++k) {
      const int i = first + k;
      const float mass =
          window_vector(map, i / per_side * stride, i % per_side * stride, vectors + k * length());
      if (masses != nullptr) {
        (*masses)[static_cast<std::size_t>(i)] = mass;
      }
    }
    if (n == together) {
      multiply_transposed_six(basis_.data(), length(), WindowGrid::components, vectors, out.col(first).data(),
                              WindowGrid::components);
    } else {
      for (int k = 0; k < n; ++k)
        multiply_transposed(basis_.data(), length(), WindowGrid::components, vectors + k * length(),
                            out.col(first + k).data());
    }
  }
  out.colwise() -= offset_;
}

}  // namespace eigenpose
