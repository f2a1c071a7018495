#include "core/image/segmentation.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/image/background.h"
#include "core/simd/threshold.h"

namespace eigenpose {

/// What `Segmenter::Impl` is made of. Named: a class with external linkage has fields of these types.
namespace segmentation {

/// Foreground of one row, widened to the right and downwards by the bridged gap: [first, last) and its
/// component.
struct Run {
  int first = 0;
  int last = 0;
  int label = 0;
};

/// What is known of one component; merged when two meet.
struct Component {
  int parent = 0;
  int left = 0;
  int right = 0;  ///< exclusive
  int top = 0;
  int bottom = 0;  ///< exclusive
  int area = 0;    ///< 0: nothing seen yet
};

}  // namespace segmentation

namespace {

using segmentation::Component;
using segmentation::Run;
using Word = std::uint64_t;

int find_root(std::vector<Component>& components, int label) {
  while (components[static_cast<std::size_t>(label)].parent != label) {
    auto& parent = components[static_cast<std::size_t>(label)].parent;
    parent = components[static_cast<std::size_t>(parent)].parent;
    label = parent;
  }
  return label;
}

void absorb(Component& into, const Component& from) {
  if (from.area == 0) return;
  if (into.area == 0) {
    const int parent = into.parent;
    into = from;
    into.parent = parent;
    return;
  }
  into.left = std::min(into.left, from.left);
  into.right = std::max(into.right, from.right);
  into.top = std::min(into.top, from.top);
  into.bottom = std::max(into.bottom, from.bottom);
  into.area += from.area;
}

/// row | row shifted up by 1…gap bits.
void widen(const Word* row, std::size_t words, int gap, Word* widened) {
  Word carry = 0;
  for (std::size_t w = 0; w < words; ++w) {
    Word value = row[w];
    Word out = value;
    for (int s = 1; s <= gap; ++s) out |= (value << s) | (carry >> (64 - s));
    carry = value;
    widened[w] = out;
  }
}

/// Drops pixels without a neighbour to the left or right: single hot pixels.
void drop_lone_pixels(Word* row, std::size_t words) {
  Word before = 0;
  for (std::size_t w = 0; w < words; ++w) {
    const Word value = row[w];
    const Word after = w + 1 < words ? row[w + 1] : 0;
    row[w] = value & ((value << 1) | (before >> 63) | (value >> 1) | (after << 63));
    before = value;
  }
}

/// First bit at or after `from` that equals `wanted`, or `width`.
int next_bit(const Word* row, int width, int from, bool wanted) {
  while (from < width) {
    const Word word = (wanted ? row[from / 64] : ~row[from / 64]) >> (from % 64);
    if (word != 0) return std::min(width, from + std::countr_zero(word));
    from = (from / 64 + 1) * 64;
  }
  return width;
}

/// Last set bit before `end`, or −1 when there is none at or after `from`.
int last_bit(const Word* row, int from, int end) {
  for (int at = end - 1; at >= from;) {
    const Word word = row[at / 64] << (63 - at % 64);
    if (word != 0) return std::max(from - 1, at - std::countl_zero(word));
    at = (at / 64) * 64 - 1;
  }
  return -1;
}

int count_bits(const Word* row, int first, int end) {
  int count = 0;
  for (int w = first / 64; w <= (end - 1) / 64; ++w) {
    Word word = row[w];
    if (w == first / 64) word &= ~Word{0} << (first % 64);
    if (w == (end - 1) / 64) word &= ~Word{0} >> (63 - (end - 1) % 64);
    count += std::popcount(word);
  }
  return count;
}

}  // namespace

struct Segmenter::Impl {
  SegmentationOptions options;
  Background background;
  cv::Mat reduced;           ///< 8-bit copy of a 16-bit picture
  std::vector<Word> rows;    ///< foreground bits of the row, then the last gap+1 widened rows, as a ring
  std::vector<Word> joined;  ///< the ring's rows together
  std::vector<Run> runs;
  std::vector<std::size_t> row_begin;  ///< first run of each row, and the end
  std::vector<Component> components;
  std::vector<Region> regions;
  std::vector<int> region_label;  ///< root component of each region
  std::vector<std::size_t> order;
  std::vector<Region> found;
  std::vector<int> found_label;
  cv::Mat scratch;
  cv::Mat cut;

  void label_rows(const cv::Mat& image);
  void add_row_runs(int y, int width, const Word* bits);
  void join_with_row_above(int y);
  void collect(const cv::Mat& image);
  [[nodiscard]] bool erase_others(const cv::Rect& box, int label, cv::Mat* target);
};

void Segmenter::Impl::label_rows(const cv::Mat& image) {
  const int width = image.cols;
  const std::size_t words = (static_cast<std::size_t>(width) + 63) / 64;
  const auto depth = static_cast<std::size_t>(options.bridged_gap) + 1;
  rows.assign(words * (depth + 1), 0);
  joined.resize(words);
  runs.clear();
  components.clear();
  row_begin.resize(static_cast<std::size_t>(image.rows) + 1);
  for (int y = 0; y < image.rows; ++y) {
    Word* bits = rows.data();
    threshold_row(image.ptr<std::uint8_t>(y), width, image.channels(),
                  static_cast<std::uint8_t>(background.threshold), bits);
    drop_lone_pixels(bits, words);
    Word* ring = rows.data() + words;
    widen(bits, words, options.bridged_gap, ring + (static_cast<std::size_t>(y) % depth) * words);
    std::fill(joined.begin(), joined.end(), Word{0});
    for (std::size_t r = 0; r < depth; ++r)
      for (std::size_t w = 0; w < words; ++w) joined[w] |= ring[r * words + w];
    row_begin[static_cast<std::size_t>(y)] = runs.size();
    add_row_runs(y, width, bits);
    if (y > 0) join_with_row_above(y);
  }
  row_begin.back() = runs.size();
}

void Segmenter::Impl::add_row_runs(int y, int width, const Word* bits) {
  for (int first = next_bit(joined.data(), width, 0, true); first < width;) {
    const int last = next_bit(joined.data(), width, first, false);
    const int label = static_cast<int>(components.size());
    Component component;
    component.parent = label;
    if (const int rightmost = last_bit(bits, first, last); rightmost >= first) {
      component.left = next_bit(bits, last, first, true);
      component.right = rightmost + 1;
      component.top = y;
      component.bottom = y + 1;
      component.area = count_bits(bits, component.left, component.right);
    }
    components.push_back(component);
    runs.push_back({first, last, label});
    first = next_bit(joined.data(), width, last, true);
  }
}

void Segmenter::Impl::join_with_row_above(int y) {
  const auto row = static_cast<std::size_t>(y);
  std::size_t above = row_begin[row - 1];
  const std::size_t above_end = row_begin[row];
  for (std::size_t here = row_begin[row]; here < runs.size(); ++here) {
    while (above < above_end && runs[above].last < runs[here].first) ++above;
    for (std::size_t a = above; a < above_end && runs[a].first <= runs[here].last; ++a) {
      const int upper = find_root(components, runs[a].label);
      const int lower = find_root(components, runs[here].label);
      if (upper == lower) continue;
      // The older component stays the root, so that labels stay small and paths short.
      const int root = std::min(upper, lower);
      const int other = std::max(upper, lower);
      absorb(components[static_cast<std::size_t>(root)], components[static_cast<std::size_t>(other)]);
      components[static_cast<std::size_t>(other)].parent = root;
    }
  }
}

void Segmenter::Impl::collect(const cv::Mat& image) {
  const double dirt = options.dirt_share * image.rows * image.cols;
  found.clear();
  found_label.clear();
  for (std::size_t i = 0; i < components.size(); ++i) {
    const Component& c = components[i];
    if (c.parent != static_cast<int>(i) || c.area == 0 || c.area < dirt) continue;
    found.push_back({cv::Rect(c.left, c.top, c.right - c.left, c.bottom - c.top), c.area,
                     c.left == 0 || c.top == 0 || c.right == image.cols || c.bottom == image.rows});
    found_label.push_back(static_cast<int>(i));
  }
  order.resize(found.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(found[a].box.x, found[a].box.y) < std::pair(found[b].box.x, found[b].box.y);
  });
  regions.clear();
  region_label.clear();
  for (const std::size_t i : order) {
    regions.push_back(found[i]);
    region_label.push_back(found_label[i]);
  }
}

bool Segmenter::Impl::erase_others(const cv::Rect& box, int label, cv::Mat* target) {
  bool any = false;
  for (int y = box.y; y < box.y + box.height; ++y) {
    const auto row = static_cast<std::size_t>(y);
    for (std::size_t r = row_begin[row]; r < row_begin[row + 1]; ++r) {
      const int first = std::max(runs[r].first, box.x);
      const int last = std::min(runs[r].last, box.x + box.width);
      if (first >= last || find_root(components, runs[r].label) == label) continue;
      any = true;
      if (target == nullptr) return true;
      (*target)(cv::Rect(first - box.x, y - box.y, last - first, 1)) = background.color();
    }
  }
  return any;
}

Segmenter::Segmenter(SegmentationOptions options) : impl_(std::make_unique<Impl>()) {
  if (options.bridged_gap < 0 || options.bridged_gap > 16)
    throw std::invalid_argument("bridged_gap is " + std::to_string(options.bridged_gap) +
                                ", allowed are 0 to 16");
  if (options.least_contrast < 1 || options.least_contrast > 200)
    throw std::invalid_argument("least_contrast is " + std::to_string(options.least_contrast) +
                                ", allowed are 1 to 200");
  impl_->options = options;
}

Segmenter::~Segmenter() = default;
Segmenter::Segmenter(Segmenter&&) noexcept = default;
Segmenter& Segmenter::operator=(Segmenter&&) noexcept = default;

std::span<const Region> Segmenter::segment(const cv::Mat& image) {
  if (image.empty() || (image.type() != CV_8UC1 && image.type() != CV_8UC3 && image.type() != CV_16UC1))
    throw std::invalid_argument(
        "a picture to segment is 8-bit grey, 8-bit BGR or 16-bit grey and not empty; got type " +
        cv::typeToString(image.type()));
  const cv::Mat* bytes = &image;
  if (image.type() == CV_16UC1) {
    image.convertTo(impl_->reduced, CV_8UC1, 1.0 / 256.0);
    bytes = &impl_->reduced;
  }
  impl_->background = measure_background(*bytes, impl_->options);
  impl_->label_rows(*bytes);
  impl_->collect(*bytes);
  return impl_->regions;
}

const Background& Segmenter::background() const {
  return impl_->background;
}

const cv::Mat& Segmenter::cut_out(const cv::Mat& image, std::size_t index) {
  const cv::Rect box = impl_->regions.at(index).box;
  const int label = impl_->region_label[index];
  impl_->cut = image(box);
  if (impl_->erase_others(box, label, nullptr)) {
    impl_->cut.copyTo(impl_->scratch);
    (void)impl_->erase_others(box, label, &impl_->scratch);
    impl_->cut = impl_->scratch;
  }
  return impl_->cut;
}

}  // namespace eigenpose
