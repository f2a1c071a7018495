// The per-frame path of the search allocates nothing. A program of its own: it replaces operator new.

#include <atomic>
#include <cstdlib>
#include <new>
#include <random>

#include <gtest/gtest.h>

#include "core/search/search.h"
#include "tests/core/search/search_queries.h"
#include "tests/support/synthetic_manifolds.h"

namespace {

std::atomic<std::size_t> allocations{0};

void* counted(std::size_t size, std::size_t alignment) {
  ++allocations;
  void* memory = alignment <= alignof(std::max_align_t)
                     ? std::malloc(size)
                     : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

void* operator new(std::size_t size) {
  return counted(size, 1);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return counted(size, static_cast<std::size_t>(alignment));
}
// Not inlined: g++ would see free() of what operator new gave, and take the pair for a mistake.
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

namespace eigenpose {
namespace {

TEST(TreeSearch, AllocatesNothingAfterTheFirstQuery) {
  std::mt19937 random(51);
  std::vector<Manifold> list;
  for (int i = 0; i < 40; ++i) list.push_back(synthetic::smooth_curve(24, 20, i % 2 == 0 ? 2 : 3, random));
  list.push_back(synthetic::smooth_manifold(
      {synthetic::axis("table", 8, true, false, random), synthetic::axis("x", 4, false, false, random)}, 20,
      2, random, 2));
  std::vector<Eigen::VectorXf> points;
  for (int i = 0; i < 500; ++i) points.push_back(synthetic::random_query(list, random).point);
  const auto search = make_search(list);
  ClosestPoint results[41];
  // Asking for all of them once brings the memory of the thread to its full size.
  ASSERT_EQ(search->nearest_into(points[0], results), 41U);
  const std::size_t before = allocations;
  std::size_t found = 0;
  for (const auto& point : points) found += search->nearest_into(point, {results, 2});
  EXPECT_EQ(allocations - before, 0U);
  EXPECT_EQ(found, 2 * points.size());
}

}  // namespace
}  // namespace eigenpose
