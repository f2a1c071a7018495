#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/subspace/kernels.h"
#include "core/subspace/sta_code.h"
#include "core/subspace/work_meter.h"

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr std::size_t kBand = 96;  ///< rows of the Gram matrix that one job computes
constexpr std::size_t kTile = 48;  ///< superblocks multiplied at once

/// Superblocks [first, first + n) of a position as rows of `stride` doubles. @return the widest one.
std::size_t pack(const CodedPosition& position, std::size_t first, std::size_t n, std::size_t stride,
                 std::vector<double>& rows) {
  std::size_t widest = 0;
  for (std::size_t s = 0; s < n; ++s) {
    const Superblock& block = position.superblocks[first + s];
    double* row = rows.data() + s * stride;
    std::copy_n(position.coefficients.data() + block.offset, block.width, row);
    std::fill(row + block.width, row + stride, 0.0);
    widest = std::max(widest, block.width);
  }
  return widest;
}

/// Rows [first, last) of the lower triangle, as differences along both axes: a rectangle of equal values is
/// four numbers.
class Band {
 public:
  Band(std::size_t first, std::size_t last)
      : first_(first),
        last_(last),
        steps_(MatrixXd::Zero(static_cast<Index>(last - first + 1), static_cast<Index>(last + 1))) {}

  void add(std::size_t row, std::size_t row_end, std::size_t column, std::size_t column_end, double value) {
    const auto top = static_cast<Index>(std::max(row, first_) - first_);
    const auto bottom = static_cast<Index>(std::min(row_end, last_) - first_);
    const auto left = static_cast<Index>(column);
    const auto right = static_cast<Index>(std::min(column_end, last_));
    steps_(top, left) += value;
    steps_(bottom, left) -= value;
    steps_(top, right) -= value;
    steps_(bottom, right) += value;
  }

  void write(MatrixXd& gram) {
    const auto rows = static_cast<Index>(last_ - first_);
    for (Index j = 0; j < static_cast<Index>(last_); ++j) {
      if (j > 0) steps_.col(j) += steps_.col(j - 1);
      double value = 0.0;
      for (Index i = 0; i < rows; ++i) {
        value += steps_(i, j);
        const Index row = static_cast<Index>(first_) + i;
        if (j > row) continue;
        gram(row, j) = value;
        gram(j, row) = value;
      }
    }
  }

 private:
  std::size_t first_, last_;
  MatrixXd steps_;
};

void add_position(const CodedPosition& position, std::size_t views, std::size_t first, std::size_t last,
                  std::size_t stride, Band& band) {
  const Kernels& kernels = best_kernels();
  const auto& blocks = position.superblocks;
  const auto after = [&](std::size_t view) {
    return static_cast<std::size_t>(
        std::upper_bound(blocks.begin(), blocks.end(), view,
                         [](std::size_t v, const Superblock& b) { return v < b.first_view; }) -
        blocks.begin());
  };
  const std::size_t begin = after(first) - 1;
  const std::size_t end = after(last - 1);
  std::vector<double> left(kTile * stride), right(kTile * stride), values(kTile * kTile);
  for (std::size_t i = begin; i < end; i += kTile) {
    const std::size_t rows = std::min(kTile, end - i);
    const std::size_t left_width = pack(position, i, rows, stride, left);
    if (left_width == 0) continue;
    for (std::size_t j = 0; j < end; j += kTile) {
      const std::size_t columns = std::min(kTile, end - j);
      const std::size_t width = std::min(left_width, pack(position, j, columns, stride, right));
      if (width == 0) continue;
      std::fill(values.begin(), values.end(), 0.0);
      kernels.dots(left.data(), stride, rows, right.data(), stride, columns, width, values.data(), kTile);
      for (std::size_t r = 0; r < rows; ++r) {
        for (std::size_t c = 0; c < columns; ++c) {
          band.add(blocks[i + r].first_view, position.end_of(i + r, views), blocks[j + c].first_view,
                   position.end_of(j + c, views), values[r * kTile + c]);
        }
      }
    }
  }
}

}  // namespace

MatrixXd sta_gram(const StaCode& code, std::size_t views, std::size_t block_size, unsigned threads,
                  const Progress& progress, std::stop_token stop) {
  MatrixXd gram(static_cast<Index>(views), static_cast<Index>(views));
  const std::size_t jobs = (views + kBand - 1) / kBand;
  WorkMeter meter(progress, std::move(stop), "inner products", jobs);
  parallel_for(jobs, threads, [&](std::size_t job) {
    // The last band is the longest: it goes first, so that no thread ends alone with it.
    const std::size_t first = (jobs - 1 - job) * kBand;
    const std::size_t last = std::min(first + kBand, views);
    Band band(first, last);
    for (const CodedPosition& position : code.positions)
      add_position(position, views, first, last, block_size, band);
    band.write(gram);
    meter.finished(1);
  });
  return gram;
}

}  // namespace eigenpose
