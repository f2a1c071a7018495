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

/// Rows [first, last) of the lower triangle, as second differences: a rectangle of equal values is four
/// numbers, and of neighbouring rectangles most of these meet.
class Band {
 public:
  Band(std::size_t first, std::size_t last)
      : first_(first),
        last_(last),
        steps_(Steps::Zero(static_cast<Index>(last - first + 1), static_cast<Index>(last + 1))) {}

  /// Adds a grid of rectangles: value(r, c) for views [row_ends[r], row_ends[r+1]) × [column_ends[c],
  /// column_ends[c+1]).
  void add(const std::vector<std::size_t>& row_ends, const std::vector<std::size_t>& column_ends,
           const std::vector<double>& values) {
    const std::size_t rows = row_ends.size() - 1;
    const std::size_t columns = column_ends.size() - 1;
    for (std::size_t r = 0; r <= rows; ++r) {
      const double* here = r < rows ? values.data() + r * kTile : nullptr;
      const double* above = r > 0 ? values.data() + (r - 1) * kTile : nullptr;
      double* steps = &steps_(static_cast<Index>(std::clamp(row_ends[r], first_, last_) - first_), 0);
      double before = 0.0;
      for (std::size_t c = 0; c < columns; ++c) {
        const double now = (here != nullptr ? here[c] : 0.0) - (above != nullptr ? above[c] : 0.0);
        steps[std::min(column_ends[c], last_)] += now - before;
        before = now;
      }
      steps[std::min(column_ends[columns], last_)] -= before;
    }
  }

  void write(MatrixXd& gram) {
    const auto rows = static_cast<Index>(last_ - first_);
    for (Index i = 0; i < rows; ++i) {
      if (i > 0) steps_.row(i) += steps_.row(i - 1);
      const Index row = static_cast<Index>(first_) + i;
      double value = 0.0;
      for (Index j = 0; j <= row; ++j) {
        value += steps_(i, j);
        gram(row, j) = value;
        gram(j, row) = value;
      }
    }
  }

 private:
  using Steps = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  std::size_t first_, last_;
  Steps steps_;
};

/// Where superblocks [first, first + n) begin, and where the last one ends.
std::vector<std::size_t> ends_of(const CodedPosition& position, std::size_t first, std::size_t n,
                                 std::size_t views) {
  std::vector<std::size_t> ends(n + 1);
  for (std::size_t s = 0; s < n; ++s) ends[s] = position.superblocks[first + s].first_view;
  ends[n] = position.end_of(first + n - 1, views);
  return ends;
}

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
    const std::vector<std::size_t> row_ends = ends_of(position, i, rows, views);
    for (std::size_t j = 0; j < end; j += kTile) {
      const std::size_t columns = std::min(kTile, end - j);
      const std::size_t width = std::min(left_width, pack(position, j, columns, stride, right));
      if (width == 0) continue;
      std::fill(values.begin(), values.end(), 0.0);
      kernels.dots(left.data(), stride, rows, right.data(), stride, columns, width, values.data(), kTile);
      band.add(row_ends, ends_of(position, j, columns, views), values);
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
