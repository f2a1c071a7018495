#pragma once

/// Reading a source in blocks of views, without a copy where the views stand in memory already.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/subspace/appearance_source.h"

namespace eigenpose {

/// Neighbouring views as they stand in memory, view after view: one of the pointers is set.
struct ViewBlock {
  const std::uint8_t* bytes = nullptr;
  const float* floats = nullptr;
  std::size_t count = 0;
  std::size_t length = 0;
  const double* doubles = nullptr;

  /// Views [first, first + n) of this block.
  [[nodiscard]] ViewBlock part(std::size_t first, std::size_t n) const;
  /// Numbers [offset, offset + n) of one view as doubles. Bytes stay unscaled.
  void widen(std::size_t view, std::size_t offset, std::size_t n, double* out) const;
};

/// Hands out blocks of a source. The source must outlive it. One thread at a time.
class ViewReader {
 public:
  explicit ViewReader(const AppearanceSource& source);

  /// Reading costs nothing: the views stand in memory.
  [[nodiscard]] bool resident() const { return resident_; }
  /// Memory of n views in the reader's buffer: 0 where the source is resident.
  [[nodiscard]] std::size_t buffer_bytes(std::size_t n) const;
  /// How many views fit into `memory` bytes (0: no limit), at most M. @throws std::invalid_argument if not
  /// one does.
  [[nodiscard]] std::size_t views_in(std::size_t memory) const;
  /// Views [first, first + n), valid until the next call. @throws what the source throws.
  [[nodiscard]] ViewBlock read(std::size_t first, std::size_t n);

 private:
  const AppearanceSource& source_;
  bool resident_;
  std::vector<std::uint8_t> bytes_;
  std::vector<float> floats_;
};

}  // namespace eigenpose
