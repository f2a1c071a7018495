#pragma once

/// A vector that holds its few elements in itself, for what must take no memory in every frame. (Boost's
/// static_vector is no contiguous range in Boost 1.74, so it does not convert to std::span.)

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <type_traits>

namespace eigenpose {

/// Up to `Capacity` elements of a trivially copyable type; more are a programmer's mistake.
template <typename T, std::size_t Capacity>
class BoundedVector {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  [[nodiscard]] static constexpr std::size_t capacity() { return Capacity; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] bool full() const { return size_ == Capacity; }

  /// New elements are value-initialised.
  void resize(std::size_t size) {
    assert(size <= Capacity);
    for (std::size_t i = size_; i < size; ++i) elements_[i] = T{};
    size_ = size;
  }
  void clear() { size_ = 0; }
  void push_back(const T& element) {
    assert(!full());
    elements_[size_++] = element;
  }

  [[nodiscard]] T* begin() { return elements_.data(); }
  [[nodiscard]] T* end() { return begin() + size_; }
  [[nodiscard]] const T* begin() const { return elements_.data(); }
  [[nodiscard]] const T* end() const { return begin() + size_; }
  [[nodiscard]] T* data() { return begin(); }
  [[nodiscard]] const T* data() const { return begin(); }
  [[nodiscard]] T& operator[](std::size_t i) { return elements_[i]; }
  [[nodiscard]] const T& operator[](std::size_t i) const { return elements_[i]; }
  [[nodiscard]] T& front() { return elements_[0]; }
  [[nodiscard]] const T& front() const { return elements_[0]; }

  friend bool operator==(const BoundedVector& a, const BoundedVector& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  std::array<T, Capacity> elements_{};
  std::size_t size_ = 0;
};

}  // namespace eigenpose
