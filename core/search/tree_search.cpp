#include "core/search/tree_search.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "core/search/best_list.h"

namespace eigenpose {

namespace {

/// Dimensions of a node fetched into the cache before it is looked at.
constexpr std::size_t fetched_ahead = 4;

/// 16^8 patches are more than memory holds.
constexpr std::size_t max_levels = 8;

float rounded_down(double value) {
  const auto f = static_cast<float>(value);
  return f <= value ? f : std::nextafter(f, -std::numeric_limits<float>::infinity());
}
float rounded_up(double value) {
  const auto f = static_cast<float>(value);
  return f >= value ? f : std::nextafter(f, std::numeric_limits<float>::infinity());
}

/// Halvings of a patch per axis before its hull is taken: the hull of the pieces is tighter.
int hull_levels(int axes) {
  return axes == 1 ? 4 : axes == 2 ? 2 : 1;
}

/// Per patch: K lows, then K highs, rounded outward.
std::vector<float> patch_boxes(const PatchSet& patches) {
  const std::size_t dims = patches.dimensions();
  std::vector<float> boxes(patches.size() * 2 * dims);
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> net = patches.bezier(i);
    const bernstein::Shape& shape = patches.shape(i);
    for (std::size_t k = 0; k < dims; ++k) {
      const double* row = net.row(static_cast<Eigen::Index>(k)).data();
      const bernstein::Range range = bernstein::range(shape, {row, shape.size()}, hull_levels(shape.axes));
      boxes[(2 * i) * dims + k] = rounded_down(range.low);
      boxes[(2 * i + 1) * dims + k] = rounded_up(range.high);
    }
  }
  return boxes;
}

/// Splits [first, last) of `order` into 16 groups of at most `group` entries, by halving four times along the
/// axis on which the box centres vary most.
void arrange(std::span<std::uint32_t> order, std::size_t group, std::span<const float> boxes,
             std::size_t dims) {
  if (order.size() <= group) return;
  std::size_t widest = 0;
  double largest = -1.0;
  const auto centre = [&](std::uint32_t i, std::size_t k) {
    return boxes[2 * i * dims + k] + boxes[(2 * static_cast<std::size_t>(i) + 1) * dims + k];
  };
  for (std::size_t k = 0; k < dims; ++k) {
    double sum = 0.0;
    double squares = 0.0;
    for (const std::uint32_t i : order) {
      const double c = centre(i, k);
      sum += c;
      squares += c * c;
    }
    const double variance = squares - sum * sum / static_cast<double>(order.size());
    if (variance > largest) {
      largest = variance;
      widest = k;
    }
  }
  // The left part gets whole groups, so that all nodes but the last are full.
  const std::size_t groups = (order.size() + group - 1) / group;
  const std::size_t left = std::min(order.size(), (groups + 1) / 2 * group);
  std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(left), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return centre(a, widest) < centre(b, widest); });
  arrange(order.first(left), group, boxes, dims);
  arrange(order.subspan(left), group, boxes, dims);
}

}  // namespace

TreeSearch::TreeSearch(std::span<const Manifold> manifolds) : ManifoldSearch(manifolds), patches_(manifolds) {
  build(patch_boxes(patches_));
}

void TreeSearch::build(std::span<const float> boxes) {
  const std::size_t dims = patches_.dimensions();
  const std::size_t count = patches_.size();
  order_.resize(count);
  std::iota(order_.begin(), order_.end(), 0U);
  std::size_t levels = 1;
  std::size_t below = 1;  // patches under one child of the root
  while (below * box_lanes < count) {
    below *= box_lanes;
    ++levels;
  }
  // From the top: parts of `below` patches, then each part into parts of a sixteenth, and so on.
  for (std::size_t part = below, whole = count; part > 1; whole = part, part /= box_lanes)
    for (std::size_t at = 0; at < count; at += whole)
      arrange(std::span(order_).subspan(at, std::min(whole, count - at)), part, boxes, dims);
  // Nodes level by level: a node at height h covers 16^h patches in a row.
  for (std::size_t level = 0, covers = below * box_lanes; level < levels; ++level, covers /= box_lanes) {
    const std::size_t child = covers / box_lanes;
    const std::size_t nodes = (count + covers - 1) / covers;
    const std::size_t next_level = nodes_.size() + nodes;
    if (level + 1 == levels) first_leaf_ = nodes_.size();
    for (std::size_t n = 0; n < nodes; ++n) {
      const std::size_t from = n * covers;
      const std::size_t to = std::min(count, from + covers);
      Node node;
      node.count = static_cast<std::uint32_t>((to - from + child - 1) / child);
      node.first = static_cast<std::uint32_t>(child == 1 ? from : next_level + n * box_lanes);
      nodes_.push_back(node);
      slices_.resize(nodes_.size() * dims);
      BoxSlice* slices = slices_.data() + (nodes_.size() - 1) * dims;
      for (std::size_t k = 0; k < dims; ++k)
        for (std::size_t lane = 0; lane < box_lanes; ++lane) {
          float low = std::numeric_limits<float>::infinity();
          float high = -low;
          for (std::size_t i = from + lane * child; i < std::min(to, from + (lane + 1) * child); ++i) {
            const std::size_t box = 2 * static_cast<std::size_t>(order_[i]);
            low = std::min(low, boxes[box * dims + k]);
            high = std::max(high, boxes[(box + 1) * dims + k]);
          }
          // Lanes without a child are masked out by `count`.
          slices[k].low[lane] = lane < node.count ? low : 0.0F;
          slices[k].high[lane] = lane < node.count ? high : 0.0F;
        }
    }
  }
}

void TreeSearch::run(const float* point, const double* exact, BestList& best) const {
  const std::size_t dims = patches_.dimensions();
  // A box farther than this in float is farther than the cut for certain (see the header).
  const double widen = 1.0 + (4.0 * static_cast<double>(dims) + 32.0) * std::ldexp(1.0, -24);
  const auto limit = [&] { return rounded_up(best.cut() * widen); };
  struct Entry {
    float squared;
    std::uint32_t node;
  };
  std::array<Entry, max_levels * box_lanes> stack;
  std::size_t waiting = 1;
  stack[0] = {0.0F, 0};
  float within = limit();
  while (waiting > 0) {
    const Entry entry = stack[--waiting];
    if (entry.squared > within) continue;
    const Node node = nodes_[entry.node];
    BoxDistances distances;
    const std::uint32_t used = node.count == box_lanes ? 0xFFFFU : (1U << node.count) - 1U;
    const bool inner = entry.node < first_leaf_;
    const BoxSlice* slices = slices_.data() + entry.node * dims;
    const std::uint32_t mask = used & (inner ? ordered_box_distances(slices, point, dims, within, distances)
                                             : box_distances(slices, point, dims, within, distances));
    const float* order = inner ? distances.order : distances.squared;
    std::array<std::uint8_t, box_lanes> lanes;
    std::size_t count = 0;
    for (std::uint32_t in = mask; in != 0; in &= in - 1) {
      const auto lane = static_cast<std::uint8_t>(std::countr_zero(in));
      std::size_t at = count++;
      for (; at > 0 && order[lanes[at - 1]] > order[lane]; --at) lanes[at] = lanes[at - 1];
      lanes[at] = lane;
    }
    if (inner) {
      for (std::size_t i = count; i-- > 0;) {
        stack[waiting++] = {distances.squared[lanes[i]], node.first + lanes[i]};
        // Most nodes are done after the first few dimensions: these are wanted soon.
        const BoxSlice* soon = slices_.data() + (node.first + lanes[i]) * dims;
        for (std::size_t k = 0; k < std::min(dims, fetched_ahead); ++k) {
          __builtin_prefetch(soon[k].low);
          __builtin_prefetch(soon[k].high);
        }
      }
      continue;
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (distances.squared[lanes[i]] > within) continue;
      PatchPoint found;
      if (!patches_.closest(order_[node.first + lanes[i]], exact, best.cut(), found)) continue;
      best.offer(found);
      within = limit();
    }
  }
}

std::size_t TreeSearch::nearest_into(const Eigen::Ref<const Eigen::VectorXf>& point,
                                     std::span<ClosestPoint> results, double bound) const {
  QueryMemory& memory = begin_query(point, patches_.dimensions(), results.size());
  if (results.empty()) return 0;
  BestList best(std::span(memory.slots).first(results.size()), bound);
  run(point.data(), memory.point.data(), best);
  return finish_query(patches_, best, memory.point.data(), results);
}

std::size_t TreeSearch::memory() const {
  return patches_.memory() + nodes_.capacity() * sizeof(Node) + slices_.capacity() * sizeof(BoxSlice) +
         order_.capacity() * sizeof(std::uint32_t);
}

}  // namespace eigenpose
