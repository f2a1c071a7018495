#include "core/windows/window_store.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/simd/window_scores.h"

namespace eigenpose {
namespace {

constexpr std::int32_t no_view = 1 << 29;  // bias of a place that holds no view
constexpr std::size_t dims = WindowGrid::components;
constexpr std::size_t block_bytes = WindowStore::group * dims;

}  // namespace

QueryWindow quantize_query(const float* coordinates, const WindowScale& scale) {
  QueryWindow window;
  float energy = 0.0F;
  for (std::size_t k = 0; k < dims; ++k) {
    const float step = std::clamp(std::nearbyint(coordinates[k] / scale.query), -63.0F, 63.0F);
    window.values[k] = static_cast<std::uint8_t>(static_cast<int>(step) + 64);
    energy += step * step;
  }
  window.energy = energy * scale.query * scale.query;
  return window;
}

WindowStore::WindowStore(const std::vector<Eigen::MatrixXf>& views, const WindowScale& scale)
    : views_(views.size()) {
  constexpr std::size_t positions = WindowGrid::positions;
  values_.assign(positions * groups() * block_bytes, 0);
  for (std::size_t v = 0; v < views_; ++v) {
    if (views[v].rows() != WindowGrid::components || views[v].cols() != WindowGrid::positions) {
      throw std::invalid_argument("a view has 32×289 window coordinates, not " +
                                  std::to_string(views[v].rows()) + "×" + std::to_string(views[v].cols()));
    }
    for (std::size_t p = 0; p < positions; ++p) {
      for (std::size_t k = 0; k < dims; ++k) {
        const float coordinate = views[v](static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(p));
        const float step = std::clamp(std::nearbyint(coordinate / scale.learned), -127.0F, 127.0F);
        values_[value_index(p, v, k)] = static_cast<std::int8_t>(step);
      }
    }
  }
  make_biases(scale);
}

WindowStore::WindowStore(std::size_t views, std::vector<std::int8_t> values, const WindowScale& scale)
    : views_(views), values_(std::move(values)) {
  const std::size_t expected = groups() * block_bytes * WindowGrid::positions;
  if (values_.size() != expected) {
    throw std::invalid_argument("the windows of " + std::to_string(views) + " views take " +
                                std::to_string(expected) + " bytes, not " + std::to_string(values_.size()));
  }
  make_biases(scale);
}

std::size_t WindowStore::value_index(std::size_t position, std::size_t view, std::size_t dimension) const {
  const std::size_t block = position * groups() + view / group;
  return block * block_bytes + dimension / 4 * 32 + view % group * 4 + dimension % 4;
}

void WindowStore::make_biases(const WindowScale& scale) {
  biases_.assign(WindowGrid::positions * groups() * group, no_view);
  for (std::size_t p = 0; p < WindowGrid::positions; ++p) {
    for (std::size_t v = 0; v < views_; ++v) {
      std::int32_t sum = 0;
      std::int32_t energy = 0;
      for (std::size_t k = 0; k < dims; ++k) {
        const auto step = values_[value_index(p, v, k)];
        sum += step;
        energy += step * step;
      }
      const float half_energy = 0.5F * static_cast<float>(energy) * scale.learned / scale.query;
      biases_[(p * groups() + v / group) * group + v % group] =
          64 * sum + static_cast<std::int32_t>(std::lround(half_energy));
    }
  }
}

void PlacedQueries::place(std::span<const QueryWindow> queries, int stride,
                          const PositionTolerance& tolerance, const WindowScale& scale) {
  count_ = queries.size();
  queries_.clear();
  const int side = (WindowGrid::side - 1) / stride + 1;
  const int reach = tolerance.cells;
  // Of the queries 0, stride, … those within reach of a place.
  const auto first = [&](int place) { return std::max(0, (place - reach + stride - 1) / stride); };
  const auto last = [&](int place) { return std::min(side - 1, (place + reach) / stride); };
  for (int r = 0; r < WindowGrid::side; ++r) {
    for (int c = 0; c < WindowGrid::side; ++c) {
      first_[static_cast<std::size_t>(r * WindowGrid::side + c)] = queries_.size();
      for (int i = first(r); i <= last(r); ++i) {
        for (int j = first(c); j <= last(c); ++j) {
          const int down = r - i * stride;
          const int right = c - j * stride;
          const auto squared = static_cast<float>(down * down + right * right);
          const auto index = static_cast<std::uint32_t>(i * side + j);
          queries_.push_back(
              {queries[index].values.data(),
               static_cast<std::int32_t>(std::lround(0.5F * tolerance.penalty * squared / scale.product())),
               index});
        }
      }
    }
  }
  first_.back() = queries_.size();
}

void WindowStore::best_scores(const PlacedQueries& queries, std::int32_t* scores) const {
  const std::size_t lanes = groups() * group;
  std::fill_n(scores, queries.count() * lanes, -no_view);
  for (std::size_t p = 0; p < WindowGrid::positions; ++p)
    raise_scores(values_.data() + p * groups() * block_bytes, biases_.data() + p * lanes, groups(),
                 queries.at(p), scores);
}

}  // namespace eigenpose
