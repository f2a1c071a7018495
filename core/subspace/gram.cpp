#include "core/subspace/gram.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/work_meter.h"
#include "core/simd/gram_products.h"
#include "core/subspace/view_reader.h"

namespace eigenpose {
namespace {

/// Views in a tile: two packed panels of a k-block stay in the second-level cache. A multiple of 3 and of 4.
constexpr std::size_t kTile = 96;
constexpr std::size_t kByteBlock = 1024;  ///< numbers in a k-block of 16-bit words; a multiple of 16
constexpr std::size_t kFloatBlock = 256;  ///< numbers in a k-block of doubles

std::size_t round_up(std::size_t value, std::size_t step) {
  return (value + step - 1) / step * step;
}

/// A stretch of numbers of every view of a block, as 16-bit words, the rest of the tile zero.
void pack_words(const ViewBlock& block, std::size_t offset, std::size_t length,
                std::vector<std::int16_t>& packed) {
  const std::size_t padded = round_up(length, 16);
  for (std::size_t v = 0; v < kTile; ++v) {
    std::int16_t* row = packed.data() + v * kByteBlock;
    const std::size_t used = v < block.count ? length : 0;
    if (used > 0) widen_bytes(block.bytes + v * block.length + offset, used, row);
    std::fill(row + used, row + padded, std::int16_t{0});
  }
}

void byte_tile(const ViewBlock& a, const ViewBlock& b, Eigen::Ref<Eigen::MatrixXd> out) {
  std::vector<std::int16_t> left(kTile * kByteBlock);
  std::vector<std::int16_t> right(kTile * kByteBlock);
  std::vector<std::int64_t> sums(kTile * kTile, 0);
  for (std::size_t k = 0; k < a.length; k += kByteBlock) {
    const std::size_t n = std::min(kByteBlock, a.length - k);
    pack_words(a, k, n, left);
    pack_words(b, k, n, right);
    // Zero rows and words up to whole steps of the kernel cost less than its edges.
    add_inner_products(Rows<std::int16_t>{left.data(), kByteBlock, round_up(a.count, 3)},
                       Rows<std::int16_t>{right.data(), kByteBlock, round_up(b.count, 4)}, round_up(n, 16),
                       Sums<std::int64_t>{sums.data(), kTile});
  }
  for (std::size_t j = 0; j < b.count; ++j) {
    for (std::size_t i = 0; i < a.count; ++i) {
      out(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          static_cast<double>(sums[i * kTile + j]);
    }
  }
}

void float_tile(const ViewBlock& a, const ViewBlock& b, Eigen::Ref<Eigen::MatrixXd> out) {
  std::vector<double> left(kTile * kFloatBlock);
  std::vector<double> right(kTile * kFloatBlock);
  std::vector<double> sums(kTile * kTile, 0.0);
  for (std::size_t k = 0; k < a.length; k += kFloatBlock) {
    const std::size_t n = std::min(kFloatBlock, a.length - k);
    for (std::size_t v = 0; v < a.count; ++v) a.widen(v, k, n, left.data() + v * kFloatBlock);
    for (std::size_t v = 0; v < b.count; ++v) b.widen(v, k, n, right.data() + v * kFloatBlock);
    add_inner_products(Rows<double>{left.data(), kFloatBlock, a.count},
                       Rows<double>{right.data(), kFloatBlock, b.count}, n, Sums<double>{sums.data(), kTile});
  }
  for (std::size_t j = 0; j < b.count; ++j) {
    for (std::size_t i = 0; i < a.count; ++i) {
      out(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = sums[i * kTile + j];
    }
  }
}

/// Copies the lower triangle to the upper one, in squares that fit the cache.
void mirror_lower(Eigen::MatrixXd& matrix, unsigned threads) {
  const auto size = static_cast<std::size_t>(matrix.rows());
  parallel_for((size + kTile - 1) / kTile, threads, [&](std::size_t tile) {
    const auto j0 = static_cast<Eigen::Index>(tile * kTile);
    const Eigen::Index width = std::min<Eigen::Index>(kTile, matrix.rows() - j0);
    for (Eigen::Index i0 = 0; i0 <= j0; i0 += kTile) {
      const Eigen::Index height = std::min<Eigen::Index>(kTile, matrix.rows() - i0);
      for (Eigen::Index j = j0; j < j0 + width; ++j) {
        for (Eigen::Index i = i0; i < std::min(i0 + height, j); ++i) matrix(i, j) = matrix(j, i);
      }
    }
  });
}

struct TilePair {
  std::size_t row, column;  ///< in tiles
};

/// Neighbouring views, and where they stand in their source.
struct Stretch {
  ViewBlock views;
  std::size_t first = 0;
};

/// Fills a tile with known products. @return false, where one of its views is not known.
bool copy_known(const KnownProducts& known, std::size_t first_row, std::size_t first_column,
                Eigen::Ref<Eigen::MatrixXd> tile) {
  const auto is_known = [&](std::size_t first, Eigen::Index n) {
    const auto begin = known.rows.begin() + static_cast<std::ptrdiff_t>(first);
    return std::all_of(begin, begin + n, [](Eigen::Index row) { return row >= 0; });
  };
  if (!is_known(first_row, tile.rows()) || !is_known(first_column, tile.cols())) return false;
  for (Eigen::Index j = 0; j < tile.cols(); ++j) {
    const Eigen::Index column = known.rows[first_column + static_cast<std::size_t>(j)];
    for (Eigen::Index i = 0; i < tile.rows(); ++i)
      tile(i, j) = known.products(known.rows[first_row + static_cast<std::size_t>(i)], column);
  }
  return true;
}

/// @throws std::invalid_argument.
void check_known(const KnownProducts& known, std::size_t count) {
  const Eigen::Index rows = known.products.rows();
  const bool inside = std::all_of(known.rows.begin(), known.rows.end(),
                                  [&](Eigen::Index row) { return row >= -1 && row < rows; });
  if (known.rows.size() != count || known.products.cols() != rows || !inside)
    throw std::invalid_argument("known products of " + std::to_string(known.rows.size()) + " views in " +
                                std::to_string(rows) + " rows do not fit a source of " +
                                std::to_string(count) + " views");
}

/// Which tiles are computed.
enum class Tiles { all, lower_triangle };

/// The products of two stretches of views in tiles; `meter` counts one unit a tile.
void tiled_products(const Stretch& rows, const Stretch& columns, Tiles wanted, const GramOptions& options,
                    Eigen::Ref<Eigen::MatrixXd> out, WorkMeter& meter) {
  const ViewBlock& a = rows.views;
  const ViewBlock& b = columns.views;
  std::vector<TilePair> tiles;
  for (std::size_t column = 0; column * kTile < b.count; ++column) {
    for (std::size_t row = wanted == Tiles::lower_triangle ? column : 0; row * kTile < a.count; ++row)
      tiles.push_back({row, column});
  }
  parallel_for(tiles.size(), options.threads, [&](std::size_t t) {
    const std::size_t i = tiles[t].row * kTile;
    const std::size_t j = tiles[t].column * kTile;
    const ViewBlock left = a.part(i, std::min(kTile, a.count - i));
    const ViewBlock right = b.part(j, std::min(kTile, b.count - j));
    auto target = out.block(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j),
                            static_cast<Eigen::Index>(left.count), static_cast<Eigen::Index>(right.count));
    if (options.known != nullptr && copy_known(*options.known, rows.first + i, columns.first + j, target)) {
      meter.finished(1);
      return;
    }
    if (left.bytes != nullptr) {
      byte_tile(left, right, target);
    } else {
      float_tile(left, right, target);
    }
    meter.finished(1);
  });
}

std::size_t tiles_in(std::size_t views) {
  return (views + kTile - 1) / kTile;
}

}  // namespace

Eigen::MatrixXd gram_matrix(const AppearanceSource& source, const GramOptions& options,
                            const Progress& progress, std::stop_token stop) {
  const std::size_t count = source.count();
  if (options.known != nullptr) check_known(*options.known, count);
  ViewReader band_reader(source);
  ViewReader stream_reader(source);
  // One band of views stays in memory while all later ones stream past it in strips; then the next band.
  const std::size_t budget = band_reader.views_in(options.tile_memory);
  if (budget < 2 && count > 1) {
    throw std::invalid_argument(
        "the memory limit leaves room for one view at a time, two are needed: raise it");
  }
  const std::size_t strip = budget == count ? count : std::min(std::max<std::size_t>(budget / 4, 1), kTile);
  const std::size_t band = budget == count ? count : budget - strip;

  std::size_t total = 0;
  for (std::size_t first = 0; first < count; first += band) {
    const std::size_t n = std::min(band, count - first);
    total += tiles_in(n) * (tiles_in(n) + 1) / 2;
    for (std::size_t next = first + n; next < count; next += strip) {
      total += tiles_in(n) * tiles_in(std::min(strip, count - next));
    }
  }

  Eigen::MatrixXd gram(static_cast<Eigen::Index>(count), static_cast<Eigen::Index>(count));
  WorkMeter meter(progress, std::move(stop), "inner products", total);
  for (std::size_t first = 0; first < count; first += band) {
    const std::size_t n = std::min(band, count - first);
    const auto column = static_cast<Eigen::Index>(first);
    const auto width = static_cast<Eigen::Index>(n);
    const Stretch held{band_reader.read(first, n), first};
    tiled_products(held, held, Tiles::lower_triangle, options, gram.block(column, column, width, width),
                   meter);
    for (std::size_t next = first + n; next < count; next += strip) {
      const std::size_t rows = std::min(strip, count - next);
      tiled_products(
          {stream_reader.read(next, rows), next}, held, Tiles::all, options,
          gram.block(static_cast<Eigen::Index>(next), column, static_cast<Eigen::Index>(rows), width), meter);
    }
  }
  mirror_lower(gram, options.threads);
  return gram;
}

Eigen::VectorXd view_norms(const Eigen::MatrixXd& gram, bool bytes) {
  Eigen::VectorXd norms = gram.diagonal().array().sqrt();
  for (Eigen::Index j = 0; j < norms.size(); ++j) {
    if (std::isfinite(norms[j]) && norms[j] > 0.0) continue;
    throw std::invalid_argument("view " + std::to_string(j) +
                                " has no energy, or a number in it is not finite: leave it out");
  }
  if (!bytes) norms.setOnes();
  return norms;
}

double normalize_and_center(Eigen::MatrixXd& gram, const Eigen::VectorXd& norms, unsigned threads) {
  const Eigen::Index count = gram.rows();
  Eigen::VectorXd means(count);
  const auto columns = static_cast<std::size_t>(count);
  parallel_for(columns, threads, [&](std::size_t column) {
    const auto j = static_cast<Eigen::Index>(column);
    double sum = 0.0;
    for (Eigen::Index i = 0; i < count; ++i) {
      gram(i, j) /= norms[i] * norms[j];
      sum += gram(i, j);
    }
    means[j] = sum / static_cast<double>(count);
  });
  const double mean = means.mean();
  parallel_for(columns, threads, [&](std::size_t column) {
    const auto j = static_cast<Eigen::Index>(column);
    // Adding the two means first keeps the matrix symmetric to the last bit.
    for (Eigen::Index i = 0; i < count; ++i) gram(i, j) = gram(i, j) - (means[i] + means[j]) + mean;
  });
  return gram.trace();
}

}  // namespace eigenpose
