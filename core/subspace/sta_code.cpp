#include "core/subspace/sta_code.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/work_meter.h"
#include "core/subspace/tile_products.h"
#include "core/subspace/view_reader.h"

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// A block, without the heap: at most 16 × 16.
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 16, 16>;

using FloatBlock = std::array<float, 256>;  ///< row by row

/// down · pixels · acrossᵀ. @tparam Width of the block where it is known, so that loops unroll; otherwise 0.
template <std::size_t Width>
void cosines(const FloatBlock& pixels, const Eigen::MatrixXf& down, const Eigen::MatrixXf& across,
             FloatBlock& frequencies) {
  const std::size_t width = Width > 0 ? Width : static_cast<std::size_t>(across.rows());
  const Index height = down.rows();
  std::array<float, Width == 0 ? 16 : Width> row;
  for (Index u = 0; u < height; ++u) {
    for (std::size_t x = 0; x < width; ++x) row[x] = 0.0F;
    for (Index y = 0; y < height; ++y)
      for (std::size_t x = 0; x < width; ++x)
        row[x] += down(u, y) * pixels[static_cast<std::size_t>(y) * width + x];
    float* out = frequencies.data() + static_cast<std::size_t>(u) * width;
    for (std::size_t c = 0; c < width; ++c) out[c] = 0.0F;
    for (std::size_t x = 0; x < width; ++x) {
      const float* column = across.data() + x * width;
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

constexpr std::size_t kLanes = 8;  ///< sums side by side, so that the compiler can use vectors

/// ‖a − b‖².
float squared_distance(std::span<const float> a, const float* b) {
  std::array<float, kLanes> sums{};
  const std::size_t whole = a.size() - a.size() % kLanes;
  for (std::size_t i = 0; i < whole; i += kLanes)
    for (std::size_t l = 0; l < kLanes; ++l) sums[l] += (a[i + l] - b[i + l]) * (a[i + l] - b[i + l]);
  float sum = std::accumulate(sums.begin(), sums.end(), 0.0F);
  for (std::size_t i = whole; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

/// Sets small coefficients to zero while their energy stays within `budget`: first all below the largest of a
/// few thresholds that holds, then, from high frequencies on, each that still fits. @return how many reach to
/// the last one kept.
std::size_t drop_small(std::span<float> coefficients, float budget) {
  std::array<float, kLanes> thresholds{budget};
  std::array<float, kLanes> sums{};
  for (std::size_t l = 1; l < kLanes; ++l) thresholds[l] = 0.5F * thresholds[l - 1];
  for (const float x : coefficients)
    for (std::size_t l = 0; l < kLanes; ++l) sums[l] += x * x <= thresholds[l] ? x * x : 0.0F;
  std::size_t chosen = 0;
  while (chosen < kLanes && sums[chosen] > budget) ++chosen;
  const float threshold = chosen < kLanes ? thresholds[chosen] : -1.0F;
  float rest = chosen < kLanes ? budget - sums[chosen] : budget;
  std::size_t width = 0;
  for (std::size_t i = coefficients.size(); i-- > 0;) {
    const float energy = coefficients[i] * coefficients[i];
    if (energy > threshold) {
      if (energy > rest) {
        width = std::max(width, i + 1);
        continue;
      }
      rest -= energy;
    }
    coefficients[i] = 0.0F;
  }
  return width;
}

/// One position while views are coded.
struct Coder {
  CodedPosition& position;
  std::span<float> last;  ///< coefficients of the last superblock
};

/// Appends a block of view `j` to its position, as a new superblock or as part of the last one. @return what
/// that changes in the view: ‖block − its stand-in‖².
float append_block(const Coder& coder, std::size_t j, std::span<const float> block, float spatial_budget,
                   float temporal_budget, std::span<float> coded) {
  auto& superblocks = coder.position.superblocks;
  std::copy(block.begin(), block.end(), coded.begin());
  const std::size_t width = drop_small(coded, spatial_budget);
  if (superblocks.empty() || squared_distance(coded, coder.last.data()) > temporal_budget) {
    auto& coefficients = coder.position.coefficients;
    superblocks.push_back({j, coefficients.size(), width});
    std::fill(coder.last.begin(), coder.last.end(), 0.0F);
    for (std::size_t c = 0; c < width; ++c) {
      const auto steps = static_cast<std::int16_t>(std::lrint(coded[c] / static_cast<float>(sta_step)));
      coefficients.push_back(steps);
      coder.last[c] = static_cast<float>(sta_step) * static_cast<float>(steps);
    }
  }
  return squared_distance(block, coder.last.data());
}

/// The change of a view from the sum over its blocks, and the rounding of floats on the way: of transforms
/// and scales below 2⁻¹⁹ of a unit-energy view, of sums below 2⁻¹⁷ of themselves.
double rounded_up(double squared_change) {
  const double change = std::sqrt(squared_change) * (1.0 + std::ldexp(1.0, -17)) + std::ldexp(1.0, -19);
  return change * change;
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
      fast_down_(down_.cast<float>()),
      fast_across_(across_.cast<float>()),
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

bool BlockTransform::forward(const float* view, std::size_t position, float* coefficients) const {
  const Corner at = corner(position);
  FloatBlock pixels;
  const std::size_t rows = std::min(height_, shape_.rows - at.row);
  const std::size_t columns = std::min(width_, shape_.columns - at.column);
  if (rows < height_ || columns < width_) std::fill_n(pixels.begin(), size(), 0.0F);
  for (std::size_t y = 0; y < rows; ++y) {
    const float* row = view + ((at.row + y) * shape_.columns + at.column) * shape_.bands + at.band;
    if (shape_.bands == 1 && columns == 8)  // a copy of known length is a few instructions
      std::copy_n(row, 8, pixels.begin() + static_cast<std::ptrdiff_t>(y * width_));
    else
      for (std::size_t x = 0; x < columns; ++x) pixels[y * width_ + x] = row[x * shape_.bands];
  }
  std::uint32_t any = 0;
  for (std::size_t i = 0; i < size(); ++i) any |= std::bit_cast<std::uint32_t>(pixels[i]);
  if (any == 0) {
    std::fill_n(coefficients, size(), 0.0F);
    return false;
  }
  FloatBlock frequencies;
  if (width_ == 8)
    cosines<8>(pixels, fast_down_, fast_across_, frequencies);
  else
    cosines<0>(pixels, fast_down_, fast_across_, frequencies);
  for (std::size_t c = 0; c < zigzag_.size(); ++c) coefficients[c] = frequencies[zigzag_[c]];
  return true;
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
           position.coefficients.capacity() * sizeof(std::int16_t);
  }
  return sum;
}

namespace {

/// Views of a strip as unit-energy floats.
struct UnitStrip {
  Eigen::MatrixXf views;  ///< N × n
  MatrixXd scales;        ///< n × 1, what each was multiplied by
};

/// Takes the views of a block. @param first number of its first view. @throws std::invalid_argument for a
/// black view.
void scale_strip(const ViewBlock& block, std::size_t first, unsigned threads, UnitStrip& strip) {
  strip.views.resize(static_cast<Index>(block.length), static_cast<Index>(block.count));
  strip.scales.resize(static_cast<Index>(block.count), 1);
  parallel_for(block.count, threads, [&](std::size_t v) {
    auto view = strip.views.col(static_cast<Index>(v));
    if (block.bytes != nullptr)
      std::copy_n(block.bytes + v * block.length, block.length, view.data());
    else
      std::copy_n(block.floats + v * block.length, block.length, view.data());
    const double norm = block.bytes != nullptr ? std::sqrt(view.cast<double>().squaredNorm()) : 1.0;
    if (!(norm > 0.0)) {
      throw std::invalid_argument("view " + std::to_string(first + v) +
                                  " is black: it has no energy to scale; leave it out");
    }
    view *= static_cast<float>(1.0 / norm);
    strip.scales(static_cast<Index>(v), 0) = 1.0 / norm;
  });
}

/// How a strip of views is coded.
struct StripTask {
  const BlockTransform& transform;
  const Eigen::MatrixXf& views;  ///< N × n
  std::size_t first;             ///< number of the strip's first view
  float spatial_budget;          ///< energies that coding may change in a block
  float temporal_budget;
};

/// Codes one position. @param changes gets ‖block − its stand-in‖² of each view.
void code_position(const StripTask& task, std::size_t position, const Coder& coder,
                   Eigen::Ref<Eigen::VectorXf> changes) {
  FloatBlock coefficients, coded;
  const std::size_t size = task.transform.size();
  for (Index v = 0; v < task.views.cols(); ++v) {
    const bool seen = task.transform.forward(task.views.col(v).data(), position, coefficients.data());
    const bool black_before =
        !coder.position.superblocks.empty() && coder.position.superblocks.back().width == 0;
    changes[v] = !seen && black_before
                     ? 0.0F
                     : append_block(coder, task.first + static_cast<std::size_t>(v),
                                    std::span(coefficients).first(size), task.spatial_budget,
                                    task.temporal_budget, std::span(coded).first(size));
  }
}

}  // namespace

StaCode sta_code(const AppearanceSource& source, const BlockTransform& transform, const StaOptions& options,
                 const StaLimits& limits, const Progress& progress, std::stop_token stop) {
  constexpr std::size_t kStrip = 64;  // views transformed at once: as floats they take 4·N bytes each
  const std::size_t count = source.count();
  StaCode code;
  code.positions.resize(transform.positions());
  code.changes = Eigen::VectorXd::Zero(static_cast<Index>(count));
  MatrixXd sum = MatrixXd::Zero(static_cast<Index>(source.length()), 1);
  const double blocks = static_cast<double>(transform.positions());
  const auto spatial_budget = static_cast<float>(options.spatial * options.spatial / blocks);
  const auto temporal_budget = static_cast<float>(options.temporal * options.temporal / blocks);
  const std::size_t size = transform.size();
  std::vector<float> last(transform.positions() * size);

  ViewReader reader(source);
  const std::size_t strip = std::min(kStrip, reader.views_in(limits.tile_memory));
  WorkMeter meter(progress, std::move(stop), "coding blocks", count);
  UnitStrip unit;
  for (std::size_t first = 0; first < count; first += strip) {
    const ViewBlock block = reader.read(first, std::min(strip, count - first));
    scale_strip(block, first, limits.threads, unit);
    add_weighted_views(block, unit.scales, 0, limits.threads, sum);
    const auto n = static_cast<Index>(block.count);
    Eigen::MatrixXf changes(n, static_cast<Index>(transform.positions()));
    const StripTask task{transform, unit.views, first, spatial_budget, temporal_budget};
    parallel_for(transform.positions(), limits.threads, [&](std::size_t p) {
      code_position(task, p, {code.positions[p], std::span(last).subspan(p * size, size)},
                    changes.col(static_cast<Index>(p)));
    });
    code.changes.segment(static_cast<Index>(first), n) =
        changes.cast<double>().rowwise().sum().unaryExpr(&rounded_up);
    if (limits.memory_limit > 0 && code.bytes() > limits.memory_limit) {
      throw std::invalid_argument("the coded views do not fit into the memory limit, which leaves " +
                                  std::to_string(limits.memory_limit) +
                                  " bytes for them: raise it, or code more coarsely");
    }
    meter.finished(block.count);
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
            sta_step * static_cast<double>(position.coefficients[block.offset + c]) * weight;
      }
    }
    for (Index k = 0; k < weights.cols(); ++k)
      transform.add_inverse(sums.col(k).data(), p, out.col(k).data());
  });
  return out;
}

}  // namespace eigenpose
