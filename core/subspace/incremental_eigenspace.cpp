#include "core/subspace/incremental_eigenspace.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/subspace/gram.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solvers.h"
#include "core/subspace/view_reader.h"

namespace eigenpose {
namespace {

struct Object {
  std::string name;
  std::size_t count = 0;
  std::vector<std::uint8_t> bytes;
  std::vector<float> floats;

  [[nodiscard]] ViewBlock block(std::size_t length) const {
    return {bytes.empty() ? nullptr : bytes.data(), floats.empty() ? nullptr : floats.data(), count, length};
  }
};

}  // namespace

/// All objects' views as one source.
class IncrementalEigenspace::Views final : public AppearanceSource {
 public:
  Views(std::size_t length, bool bytes) : length_(length), bytes_(bytes) {}

  [[nodiscard]] std::size_t count() const override {
    std::size_t sum = 0;
    for (const Object& object : objects) sum += object.count;
    return sum;
  }
  [[nodiscard]] std::size_t length() const override { return length_; }
  [[nodiscard]] bool has_bytes() const override { return bytes_; }

  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override {
    check_columns(first, static_cast<std::size_t>(tile.cols()), count());
    for_each_part(first, static_cast<std::size_t>(tile.cols()), [&](const ViewBlock& part, std::size_t at) {
      auto columns = tile.middleCols(static_cast<Eigen::Index>(at), static_cast<Eigen::Index>(part.count));
      if (bytes_) {
        bytes_to_unit_columns(part.bytes, first + at, columns);
      } else {
        columns = Eigen::Map<const Eigen::MatrixXf>(part.floats, columns.rows(), columns.cols());
      }
    });
  }

  void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const override {
    if (!bytes_) AppearanceSource::read_bytes(first, n, tile);
    check_columns(first, n, count());
    for_each_part(first, n, [&](const ViewBlock& part, std::size_t at) {
      std::copy_n(part.bytes, part.count * length_, tile + at * length_);
    });
  }

  std::vector<Object> objects;

 private:
  /// Calls work(views of one object, their place in the request) over [first, first + n).
  template <typename Work>
  void for_each_part(std::size_t first, std::size_t n, const Work& work) const {
    std::size_t start = 0;
    for (const Object& object : objects) {
      const std::size_t from = std::max(first, start);
      const std::size_t to = std::min(first + n, start + object.count);
      if (from < to) work(object.block(length_).part(from - start, to - from), from - first);
      start += object.count;
    }
  }

  std::size_t length_;
  bool bytes_;
};

IncrementalEigenspace::IncrementalEigenspace(std::size_t length, bool bytes, unsigned threads)
    : views_(std::make_unique<Views>(length, bytes)), threads_(threads) {
  if (length == 0) throw std::invalid_argument("an appearance has 0 numbers: give views of at least one");
}
IncrementalEigenspace::IncrementalEigenspace(IncrementalEigenspace&&) noexcept = default;
IncrementalEigenspace& IncrementalEigenspace::operator=(IncrementalEigenspace&&) noexcept = default;
IncrementalEigenspace::~IncrementalEigenspace() = default;

void IncrementalEigenspace::add(const std::string& name, const AppearanceSource& source,
                                const Progress& progress, std::stop_token stop) {
  const std::size_t length = views_->length();
  auto& objects = views_->objects;
  if (std::any_of(objects.begin(), objects.end(), [&](const Object& o) { return o.name == name; })) {
    throw std::invalid_argument("object '" + name + "' is there already: remove it first");
  }
  if (source.length() != length) {
    throw std::invalid_argument("the views of '" + name + "' have " + std::to_string(source.length()) +
                                " numbers, the others " + std::to_string(length));
  }
  if (views_->has_bytes() && !source.has_bytes()) {
    throw std::invalid_argument("the views of '" + name + "' are not 8-bit, the others are");
  }
  if (source.count() == 0) throw std::invalid_argument("object '" + name + "' has no views");

  Object object{name, source.count(), {}, {}};
  if (views_->has_bytes()) {
    object.bytes.resize(object.count * length);
    source.read_bytes(0, object.count, object.bytes.data());
  } else {
    object.floats.resize(object.count * length);
    source.read(0, Eigen::Map<Eigen::MatrixXf>(object.floats.data(), static_cast<Eigen::Index>(length),
                                               static_cast<Eigen::Index>(object.count)));
  }
  const GramOptions options{threads_, 0, nullptr};
  const ViewBlock fresh = object.block(length);
  const Eigen::Index before = products_.rows();
  const auto added = static_cast<Eigen::Index>(object.count);
  Eigen::MatrixXd grown(before + added, before + added);
  grown.topLeftCorner(before, before) = products_;
  Eigen::Index column = 0;
  for (const Object& old : objects) {
    const auto width = static_cast<Eigen::Index>(old.count);
    inner_products(fresh, old.block(length), false, options, grown.block(before, column, added, width),
                   progress, stop);
    column += width;
  }
  inner_products(fresh, fresh, true, options, grown.bottomRightCorner(added, added), progress,
                 std::move(stop));
  for (Eigen::Index j = before; j < before + added; ++j) {
    for (Eigen::Index i = 0; i < j; ++i) grown(i, j) = grown(j, i);
  }
  objects.push_back(std::move(object));
  products_ = std::move(grown);
}

void IncrementalEigenspace::remove(std::string_view name) {
  auto& objects = views_->objects;
  Eigen::Index first = 0;
  auto found = objects.begin();
  for (; found != objects.end() && found->name != name; ++found)
    first += static_cast<Eigen::Index>(found->count);
  if (found == objects.end())
    throw std::invalid_argument("there is no object '" + std::string(name) + "' to remove");
  const auto gone = static_cast<Eigen::Index>(found->count);
  const Eigen::Index after = products_.rows() - first - gone;
  Eigen::MatrixXd shrunk(first + after, first + after);
  shrunk.topLeftCorner(first, first) = products_.topLeftCorner(first, first);
  shrunk.bottomLeftCorner(after, first) = products_.bottomLeftCorner(after, first);
  shrunk.topRightCorner(first, after) = products_.topRightCorner(first, after);
  shrunk.bottomRightCorner(after, after) = products_.bottomRightCorner(after, after);
  products_ = std::move(shrunk);
  objects.erase(found);
}

std::vector<std::string> IncrementalEigenspace::names() const {
  std::vector<std::string> result;
  for (const Object& object : views_->objects) result.push_back(object.name);
  return result;
}

std::size_t IncrementalEigenspace::count() const {
  return views_->count();
}

std::size_t IncrementalEigenspace::memory() const {
  std::size_t sum = static_cast<std::size_t>(products_.size()) * sizeof(double);
  for (const Object& object : views_->objects)
    sum += object.bytes.size() + object.floats.size() * sizeof(float);
  return sum;
}

const AppearanceSource& IncrementalEigenspace::views() const {
  return *views_;
}

Eigenspace IncrementalEigenspace::solve(const SolverOptions& options, SolverReport* report,
                                        const Progress& progress, std::stop_token stop) const {
  const SolverOptions bounded = detail::checked_options(*views_, options);
  SolverReport result;
  result.solver = "gram";
  // The views stand in memory object by object: strips of this size are copied for the back-projection.
  constexpr std::size_t kStrip = 64;
  const std::size_t strip_memory = kStrip * views_->length() * (views_->has_bytes() ? 1 : sizeof(float));
  Eigenspace space =
      detail::solve_products(products_, strip_memory, {*views_, bounded, progress, std::move(stop)}, result);
  detail::complete_report(space, options, result);
  if (report != nullptr) *report = std::move(result);
  return space;
}

}  // namespace eigenpose
