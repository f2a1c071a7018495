#include "tests/support/counted_memory.h"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace eigenpose::testing {

std::atomic<long> allocations{0};

namespace {

void* counted_or_null(std::size_t size) noexcept {
  ++allocations;
  return std::malloc(std::max<std::size_t>(size, 1));
}

void* counted_or_null(std::size_t size, std::align_val_t alignment) noexcept {
  ++allocations;
  void* memory = nullptr;
  const std::size_t least = std::max(sizeof(void*), static_cast<std::size_t>(alignment));
  return posix_memalign(&memory, least, size) == 0 ? memory : nullptr;
}

void* or_thrown(void* memory) {
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace
}  // namespace eigenpose::testing

using eigenpose::testing::counted_or_null;
using eigenpose::testing::or_thrown;

void* operator new(std::size_t size) {
  return or_thrown(counted_or_null(size));
}
void* operator new[](std::size_t size) {
  return or_thrown(counted_or_null(size));
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return or_thrown(counted_or_null(size, alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return or_thrown(counted_or_null(size, alignment));
}
void* operator new(std::size_t size, const std::nothrow_t& /*tag*/) noexcept {
  return counted_or_null(size);
}
void* operator new[](std::size_t size, const std::nothrow_t& /*tag*/) noexcept {
  return counted_or_null(size);
}
void* operator new(std::size_t size, std::align_val_t alignment, const std::nothrow_t& /*tag*/) noexcept {
  return counted_or_null(size, alignment);
}
void* operator new[](std::size_t size, std::align_val_t alignment, const std::nothrow_t& /*tag*/) noexcept {
  return counted_or_null(size, alignment);
}
// Not inlined: g++ would see free() of what operator new gave, and take the pair for a mistake.
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete[](void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t /*size*/) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete[](void* memory, std::size_t /*size*/) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete[](void* memory, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t /*size*/,
                                       std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete[](void* memory, std::size_t /*size*/,
                                         std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, const std::nothrow_t& /*tag*/) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete[](void* memory, const std::nothrow_t& /*tag*/) noexcept {
  std::free(memory);
}
