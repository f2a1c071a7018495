#include "core/subspace/sta_code.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/parallel.h"
#include "core/subspace/tile_products.h"
#include "core/subspace/view_reader.h"
#include "core/subspace/work_meter.h"

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// A block, without the heap: at most 16 × 16.
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 16, 16>;

using SmallBlock = std::array<double, 256>;  ///< row by row

/// down · pixels · acrossᵀ. @tparam Width of the block where it is known, so that loops unroll; otherwise 0.
template <std::size_t Width>
void cosines(const SmallBlock& pixels, const MatrixXd& down, const MatrixXd& across,
             SmallBlock& frequencies) {
  const std::size_t width = Width > 0 ? Width : static_cast<std::size_t>(across.rows());
  const Index height = down.rows();
  std::array<double, Width == 0 ? 16 : Width> row;
  for (Index u = 0; u < height; ++u) {
    for (std::size_t x = 0; x < width; ++x) row[x] = 0.0;
    for (Index y = 0; y < height; ++y)
      for (std::size_t x = 0; x < width; ++x)
        row[x] += down(u, y) * pixels[static_cast<std::size_t>(y) * width + x];
    double* out = frequencies.data() + static_cast<std::size_t>(u) * width;
    for (std::size_t c = 0; c < width; ++c) out[c] = 0.0;
    for (std::size_t x = 0; x < width; ++x) {
      const double* column = across.data() + x * width;
      for (std::size_t c = 0; c < width; ++c) out[c] += row[x] * column[c];
    }
  }
}

/// Orthonormal DCT-II of n numbers, one row a frequency.
MatrixXd cosine_matrix(std::size_t n) {
  MatrixXd matrix(static_cast<Index>(n), static_cast<Index>(n));
  for (Index u = 0; u < matrix.rows(); ++u) {
    const double scale = std::sqrt((u == 0 ? 1.0 : 2.0) / static_cast<double>(n));
    for (Index x = 0; x < matrix.cols(); ++x) {
      matrix(u, x) = scale * std::cos(std::numbers::pi * (2.0 * static_cast<double>(x) + 1.0) *
                                      static_cast<double>(u) / (2.0 * static_cast<double>(n)));
    }
  }
  return matrix;
}

/// Sets small coefficients to zero while their energy stays within `budget`: octave of energy by octave, the
/// smallest first; of the last octave those of high frequency first. @return how many reach to the last one
/// kept.
std::size_t drop_small(std::vector<double>& coefficients, double budget) {
  std::array<double, 256> octaves{};
  std::array<std::uint8_t, 256> octave_of{};
  for (std::size_t i = 0; i < coefficients.size(); ++i) {
    const double energy = coefficients[i] * coefficients[i];
    octave_of[i] = static_cast<std::uint8_t>(std::bit_cast<std::uint32_t>(static_cast<float>(energy)) >> 23U);
    octaves[octave_of[i]] += energy;
  }
  std::size_t open = 0;  // the first octave that does not go as a whole
  double dropped = 0.0;
  while (open < octaves.size() && dropped + octaves[open] <= budget) dropped += octaves[open++];
  for (std::size_t i = coefficients.size(); i-- > 0;) {
    if (octave_of[i] > open) continue;
    const double energy = coefficients[i] * coefficients[i];
    if (octave_of[i] == open) {
      if (dropped + energy > budget) continue;
      dropped += energy;
    }
    coefficients[i] = 0.0;
  }
  std::size_t width = coefficients.size();
  while (width > 0 && coefficients[width - 1] == 0.0) --width;
  return width;
}

/// Appends the block of view `j` to its position, as a new superblock or as part of the last one. @return
/// what that changes in the view: ‖block − its stand-in‖².
double append_block(CodedPosition& position, std::size_t j, const std::vector<double>& block,
                    double spatial_budget, double temporal_budget, std::vector<double>& coded) {
  coded = block;
  const std::size_t width = drop_small(coded, spatial_budget);
  const auto distance = [&](const std::vector<double>& from) {
    const Superblock& last = position.superblocks.back();
    double sum = 0.0;
    for (std::size_t c = 0; c < from.size(); ++c) {
      const double difference = from[c] - (c < last.width ? position.coefficients[last.offset + c] : 0.0);
      sum += difference * difference;
    }
    return sum;
  };
  if (position.superblocks.empty() || distance(coded) > temporal_budget) {
    position.superblocks.push_back({j, position.coefficients.size(), width});
    for (std::size_t c = 0; c < width; ++c) position.coefficients.push_back(static_cast<float>(coded[c]));
  }
  return distance(block);
}

}  // namespace

BlockTransform::BlockTransform(const AppearanceShape& shape, std::size_t side)
    : shape_(shape),
      height_(std::min(side, shape.rows)),
      width_(std::min(side, shape.columns)),
      blocks_down_((shape.rows + height_ - 1) / height_),
      blocks_across_((shape.columns + width_ - 1) / width_),
      down_(cosine_matrix(height_)),
      across_(cosine_matrix(width_)),
      zigzag_(height_ * width_) {
  std::iota(zigzag_.begin(), zigzag_.end(), std::size_t{0});
  std::stable_sort(zigzag_.begin(), zigzag_.end(), [&](std::size_t a, std::size_t b) {
    return a / width_ + a % width_ < b / width_ + b % width_;
  });
}

BlockTransform::Corner BlockTransform::corner(std::size_t position) const {
  const std::size_t band = position % shape_.bands;
  const std::size_t block = position / shape_.bands;
  return {block / blocks_across_ * height_, block % blocks_across_ * width_, band};
}

void BlockTransform::forward(const double* view, std::size_t position, double* coefficients) const {
  const Corner at = corner(position);
  SmallBlock pixels{};
  const std::size_t rows = std::min(height_, shape_.rows - at.row);
  const std::size_t columns = std::min(width_, shape_.columns - at.column);
  for (std::size_t y = 0; y < rows; ++y) {
    const double* row = view + ((at.row + y) * shape_.columns + at.column) * shape_.bands + at.band;
    for (std::size_t x = 0; x < columns; ++x) pixels[y * width_ + x] = row[x * shape_.bands];
  }
  SmallBlock frequencies;
  if (width_ == 8)
    cosines<8>(pixels, down_, across_, frequencies);
  else
    cosines<0>(pixels, down_, across_, frequencies);
  for (std::size_t c = 0; c < zigzag_.size(); ++c) coefficients[c] = frequencies[zigzag_[c]];
}

void BlockTransform::add_inverse(const double* coefficients, std::size_t position, double* view) const {
  SmallMatrix frequencies(down_.rows(), across_.rows());
  for (std::size_t c = 0; c < zigzag_.size(); ++c) {
    frequencies(static_cast<Index>(zigzag_[c] / width_), static_cast<Index>(zigzag_[c] % width_)) =
        coefficients[c];
  }
  const SmallMatrix columns = down_.transpose().lazyProduct(frequencies);
  const SmallMatrix pixels = columns.lazyProduct(across_);
  const Corner at = corner(position);
  for (std::size_t y = 0; y < std::min(height_, shape_.rows - at.row); ++y) {
    for (std::size_t x = 0; x < std::min(width_, shape_.columns - at.column); ++x) {
      view[((at.row + y) * shape_.columns + at.column + x) * shape_.bands + at.band] +=
          pixels(static_cast<Index>(y), static_cast<Index>(x));
    }
  }
}

std::size_t StaCode::bytes() const {
  std::size_t sum = 0;
  for (const CodedPosition& position : positions) {
    sum += position.superblocks.capacity() * sizeof(Superblock) +
           position.coefficients.capacity() * sizeof(float);
  }
  return sum;
}

StaCode sta_code(const AppearanceSource& source, const BlockTransform& transform, const StaOptions& options,
                 unsigned threads, std::size_t tile_memory, std::size_t memory_limit,
                 const Progress& progress, std::stop_token stop) {
  constexpr std::size_t kStrip = 64;  // views transformed at once: as doubles they take 8·N bytes each
  const std::size_t count = source.count();
  const std::size_t length = source.length();
  StaCode code;
  code.positions.resize(transform.positions());
  code.changes = Eigen::VectorXd::Zero(static_cast<Index>(count));
  MatrixXd sum = MatrixXd::Zero(static_cast<Index>(length), 1);
  const double blocks = static_cast<double>(transform.positions());
  const double spatial_budget = options.spatial * options.spatial / blocks;
  const double temporal_budget = options.temporal * options.temporal / blocks;

  ViewReader reader(source);
  const std::size_t strip = std::min(kStrip, reader.views_in(tile_memory));
  WorkMeter meter(progress, std::move(stop), "coding blocks", count);
  MatrixXd views;
  for (std::size_t first = 0; first < count; first += strip) {
    const std::size_t n = std::min(strip, count - first);
    const ViewBlock block = reader.read(first, n);
    views.resize(static_cast<Index>(length), static_cast<Index>(n));
    MatrixXd weights(static_cast<Index>(n), 1);
    for (std::size_t v = 0; v < n; ++v) {
      auto view = views.col(static_cast<Index>(v));
      block.widen(v, 0, length, view.data());
      const double norm = block.bytes != nullptr ? view.norm() : 1.0;
      if (!(norm > 0.0)) {
        throw std::invalid_argument("view " + std::to_string(first + v) +
                                    " is black: it has no energy to scale; leave it out");
      }
      view /= norm;
      weights(static_cast<Index>(v), 0) = 1.0 / norm;
    }
    add_weighted_views(block, weights, 0, threads, sum);
    MatrixXd changes(static_cast<Index>(n), static_cast<Index>(transform.positions()));
    parallel_for(transform.positions(), threads, [&](std::size_t p) {
      std::vector<double> coefficients(transform.size()), coded(transform.size());
      for (std::size_t v = 0; v < n; ++v) {
        transform.forward(views.col(static_cast<Index>(v)).data(), p, coefficients.data());
        changes(static_cast<Index>(v), static_cast<Index>(p)) =
            append_block(code.positions[p], first + v, coefficients, spatial_budget, temporal_budget, coded);
      }
    });
    code.changes.segment(static_cast<Index>(first), static_cast<Index>(n)) = changes.rowwise().sum();
    if (memory_limit > 0 && code.bytes() > memory_limit) {
      throw std::invalid_argument("the coded views do not fit into the memory limit, which leaves " +
                                  std::to_string(memory_limit) +
                                  " bytes for them: raise it, or code more coarsely");
    }
    meter.finished(n);
  }
  code.mean = sum / static_cast<double>(count);
  for (const CodedPosition& position : code.positions) code.kept += position.coefficients.size();
  return code;
}

MatrixXd sta_back_project(const StaCode& code, const BlockTransform& transform, const MatrixXd& weights,
                          unsigned threads) {
  // Sums of weights over a run are differences of running sums.
  MatrixXd running = MatrixXd::Zero(weights.rows() + 1, weights.cols());
  for (Index j = 0; j < weights.rows(); ++j) running.row(j + 1) = running.row(j) + weights.row(j);
  const auto views = static_cast<std::size_t>(weights.rows());
  MatrixXd out = MatrixXd::Zero(static_cast<Index>(transform.shape().length()), weights.cols());
  parallel_for(code.positions.size(), threads, [&](std::size_t p) {
    const CodedPosition& position = code.positions[p];
    MatrixXd sums = MatrixXd::Zero(static_cast<Index>(transform.size()), weights.cols());
    for (std::size_t s = 0; s < position.superblocks.size(); ++s) {
      const Superblock& block = position.superblocks[s];
      const Eigen::RowVectorXd weight = running.row(static_cast<Index>(position.end_of(s, views))) -
                                        running.row(static_cast<Index>(block.first_view));
      for (std::size_t c = 0; c < block.width; ++c) {
        sums.row(static_cast<Index>(c)) +=
            static_cast<double>(position.coefficients[block.offset + c]) * weight;
      }
    }
    for (Index k = 0; k < weights.cols(); ++k)
      transform.add_inverse(sums.col(k).data(), p, out.col(k).data());
  });
  return out;
}

}  // namespace eigenpose
