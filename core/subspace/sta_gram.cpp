#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/work_meter.h"
#include "core/simd/gram_products.h"
#include "core/subspace/sta_code.h"

namespace eigenpose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr std::size_t kBand = 192;  ///< views whose products with all earlier ones are one job
/// Superblocks multiplied at once. Few, because the widest of them sets the cost.
constexpr std::size_t kRows = 12;     ///< a multiple of 3
constexpr std::size_t kColumns = 24;  ///< a multiple of 4
constexpr std::size_t kWords = 16;    ///< the kernel takes so many at a time

/// Superblocks of one position, each less the one before it, as rows of words.
class Differences {
 public:
  /// @param size coefficients of a block.
  explicit Differences(std::size_t size) : stride_((size + kWords - 1) / kWords * kWords) {}

  void take(const CodedPosition& position, std::size_t count) {
    words_.assign((count + kColumns) * stride_, 0);  // tiles of whole kernel steps reach over the end
    widths_.resize(count);
    views_.resize(count);
    for (std::size_t s = 0; s < count; ++s) {
      const Superblock& block = position.superblocks[s];
      const std::int16_t* from = position.coefficients.data() + block.offset;
      std::int16_t* row = words_.data() + s * stride_;
      std::copy_n(from, block.width, row);
      widths_[s] = block.width;
      views_[s] = static_cast<Index>(block.first_view);
      if (s == 0) continue;
      const Superblock& before = position.superblocks[s - 1];
      const std::int16_t* less = position.coefficients.data() + before.offset;
      for (std::size_t c = 0; c < before.width; ++c) row[c] = static_cast<std::int16_t>(row[c] - less[c]);
      widths_[s] = std::max(block.width, before.width);
    }
  }
  [[nodiscard]] std::size_t stride() const { return stride_; }
  [[nodiscard]] const std::int16_t* row(std::size_t s) const { return words_.data() + s * stride_; }
  /// The view where it begins.
  [[nodiscard]] const Index* view(std::size_t s) const { return views_.data() + s; }
  /// Of the widest of n, in whole steps of the kernel.
  [[nodiscard]] std::size_t width(std::size_t first, std::size_t n) const {
    const auto begin = widths_.begin() + static_cast<std::ptrdiff_t>(first);
    const std::size_t widest = *std::max_element(begin, begin + static_cast<std::ptrdiff_t>(n));
    return (widest + kWords - 1) / kWords * kWords;
  }

 private:
  std::size_t stride_;
  std::vector<std::int16_t> words_;
  std::vector<std::size_t> widths_;
  std::vector<Index> views_;
};

/// Adds the products of the differences that begin in views [first, last) with all that begin earlier or with
/// them: to the columns of the former, above the diagonal.
void add_position(const CodedPosition& position, std::size_t first, std::size_t last,
                  Differences& differences, MatrixXd& steps) {
  const auto& blocks = position.superblocks;
  const auto begins_by = [&](std::size_t view) {
    return static_cast<std::size_t>(
        std::lower_bound(blocks.begin(), blocks.end(), view,
                         [](const Superblock& b, std::size_t v) { return b.first_view < v; }) -
        blocks.begin());
  };
  const std::size_t begin = begins_by(first);
  const std::size_t end = begins_by(last);
  if (begin == end) return;
  differences.take(position, end);
  const std::size_t stride = differences.stride();
  std::vector<std::int64_t> values(kRows * kColumns);
  for (std::size_t i = begin; i < end; i += kRows) {
    const std::size_t rows = std::min(kRows, end - i);
    const std::size_t row_width = differences.width(i, rows);
    for (std::size_t j = 0; j < i + rows; j += kColumns) {
      const std::size_t columns = std::min(kColumns, i + rows - j);
      const std::size_t width = std::min(row_width, differences.width(j, columns));
      if (width == 0) continue;
      std::fill(values.begin(), values.end(), 0);
      add_inner_products(Rows<std::int16_t>{differences.row(i), stride, (rows + 2) / 3 * 3},
                         Rows<std::int16_t>{differences.row(j), stride, (columns + 3) / 4 * 4}, width,
                         Sums<std::int64_t>{values.data(), kColumns});
      for (std::size_t r = 0; r < rows; ++r) {
        double* column = &steps(0, *differences.view(i + r));
        const Index* view = differences.view(j);
        const std::int64_t* value = values.data() + r * kColumns;
        const std::size_t earlier = std::min(columns, i + r + 1 - j);
        for (std::size_t c = 0; c < earlier; ++c) column[view[c]] += static_cast<double>(value[c]);
      }
    }
  }
}

/// Running sums down and across of a symmetric matrix of whole numbers that stands above the diagonal.
void sum_up(MatrixXd& steps) {
  steps.triangularView<Eigen::StrictlyLower>() = steps.transpose();
  for (Index j = 0; j < steps.cols(); ++j) {
    for (Index i = 1; i < steps.rows(); ++i) steps(i, j) += steps(i - 1, j);
    if (j > 0) steps.col(j) += steps.col(j - 1);
  }
}

}  // namespace

MatrixXd sta_gram(const StaCode& code, std::size_t views, std::size_t block_size, unsigned threads,
                  const Progress& progress, std::stop_token stop) {
  // Whole numbers below 2⁵³ all the way: the order of the sums does not matter.
  MatrixXd gram = MatrixXd::Zero(static_cast<Index>(views), static_cast<Index>(views));
  const std::size_t jobs = (views + kBand - 1) / kBand;
  WorkMeter meter(progress, std::move(stop), "inner products", jobs);
  parallel_for(jobs, threads, [&](std::size_t job) {
    // The last band is the longest: it goes first, so that no thread ends alone with it.
    const std::size_t first = (jobs - 1 - job) * kBand;
    Differences differences(block_size);
    for (const CodedPosition& position : code.positions)
      add_position(position, first, std::min(first + kBand, views), differences, gram);
    meter.finished(1);
  });
  sum_up(gram);
  gram *= sta_step * sta_step;
  return gram;
}

}  // namespace eigenpose
