#pragma once

/// The learned windows of one object, laid out so that eight views are compared with one query window at a
/// time.
///
/// Every window is 32 numbers of 8 bits. For one position, eight views and four dimensions stand in 32
/// neighbouring bytes; the constant parts of the squared distance, −½‖m‖², are folded into an integer bias,
/// so that comparing is one integer product. 36 views take 0.42 MB.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/simd/window_scores.h"
#include "core/windows/windows.h"

namespace eigenpose {

/// How real window coordinates become integers: learned ones −127…127, query ones 0…127 (offset 64).
struct WindowScale {
  float learned = 0.01F;  ///< value of one step of a learned coordinate
  float query = 0.02F;    ///< value of one step of a query coordinate

  /// A scale that holds coordinates up to ±largest.
  static WindowScale for_range(float largest) { return {largest / 127.0F, largest / 63.0F}; }
  [[nodiscard]] float product() const { return learned * query; }
};

/// A query window ready to be compared.
struct QueryWindow {
  alignas(32) std::array<std::uint8_t, WindowGrid::components> values{};
  float energy = 0.0F;  ///< ‖q‖² of the rounded values
};

QueryWindow quantize_query(const float* coordinates, const WindowScale& scale);

/// How far a learned window may lie from the query window's place, and what each cell of offset costs.
struct PositionTolerance {
  int cells = 2;
  float penalty = 0.01F;  ///< added to the squared distance per squared cell of offset
};

/// The windows of a region, by the learned places they are compared with. Value type.
class PlacedQueries {
 public:
  /// @param queries a square grid, row by row, at places 0, stride, 2·stride … 16; they must stay.
  void place(std::span<const QueryWindow> queries, int stride, const PositionTolerance& tolerance,
             const WindowScale& scale);

  [[nodiscard]] std::size_t count() const { return count_; }
  /// Those within the tolerance of one of the 289 places.
  [[nodiscard]] std::span<const PlacedQuery> at(std::size_t position) const {
    return std::span(queries_).subspan(first_[position], first_[position + 1] - first_[position]);
  }

 private:
  std::size_t count_ = 0;
  std::array<std::size_t, WindowGrid::positions + 1> first_{};
  std::vector<PlacedQuery> queries_;
};

/// All windows of one object's views. Value type; const calls are thread-safe.
class WindowStore {
 public:
  WindowStore() = default;
  /// @param views one 32×289 matrix a view: the coordinates of its windows, row by row.
  WindowStore(const std::vector<Eigen::MatrixXf>& views, const WindowScale& scale);
  /// Rebuilds what a model file stores. @throws std::invalid_argument for sizes that do not fit.
  WindowStore(std::size_t views, std::vector<std::int8_t> values, const WindowScale& scale);

  static constexpr std::size_t group = 8;  ///< views compared together
  [[nodiscard]] std::size_t views() const { return views_; }
  [[nodiscard]] std::size_t groups() const { return (views_ + group - 1) / group; }
  [[nodiscard]] const std::vector<std::int8_t>& values() const { return values_; }
  [[nodiscard]] std::size_t memory() const { return values_.size() + biases_.size() * sizeof(std::int32_t); }

  /// For each query and each view (rounded up to whole groups) the largest q·m − ½‖m‖² − ½·penalty over the
  /// windows within the tolerance of the query's place, in steps of scale.product(). The squared distance is
  /// q.energy − 2·score·scale.product(). Places of a last group that are no views get a score far below every
  /// real one.
  /// @param scores [queries][groups × 8]
  void best_scores(const PlacedQueries& queries, std::int32_t* scores) const;

 private:
  [[nodiscard]] std::size_t value_index(std::size_t position, std::size_t view, std::size_t dimension) const;
  void make_biases(const WindowScale& scale);

  std::size_t views_ = 0;
  std::vector<std::int8_t> values_;   ///< [289][groups][8 × 4 dimensions][8 views][4]
  std::vector<std::int32_t> biases_;  ///< [289][groups][8 views]
};

}  // namespace eigenpose
