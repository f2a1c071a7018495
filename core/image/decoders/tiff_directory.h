#pragma once

/// The directory of a TIFF file, which EXIF data has too: numbers by tag.

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/image/decoders/decoders.h"

namespace eigenpose::decoders {

/// The first directory of a file. Values are read when asked for.
class TiffDirectory {
 public:
  /// @throws PictureError when `file` is not a classic TIFF file or its directory lies outside it.
  explicit TiffDirectory(Bytes file);

  [[nodiscard]] bool has(std::uint16_t tag) const { return entries_.count(tag) > 0; }
  /// All values of a tag whose type is BYTE, SHORT or LONG; none when the tag is absent.
  /// @throws PictureError when they lie outside the file or are of another type.
  [[nodiscard]] std::vector<std::uint32_t> numbers(std::uint16_t tag) const;
  /// The first value, or `fallback` when the tag is absent.
  [[nodiscard]] std::uint32_t number(std::uint16_t tag, std::uint32_t fallback) const;
  /// The bytes of a tag of type UNDEFINED; none when it is absent.
  [[nodiscard]] Bytes raw(std::uint16_t tag) const;

  [[nodiscard]] bool big_endian() const { return big_endian_; }
  /// A 16-bit number of the file's byte order.
  [[nodiscard]] std::uint32_t read_16(const unsigned char* at) const;

 private:
  struct Entry {
    std::uint16_t type = 0;
    std::uint32_t count = 0;
    std::size_t at = 0;  ///< of the four bytes that hold the values or their offset
  };
  [[nodiscard]] std::uint32_t read_32(const unsigned char* at) const;
  [[nodiscard]] Bytes values(std::uint16_t tag, std::size_t size_of_one) const;

  Bytes file_;
  bool big_endian_ = false;
  std::map<std::uint16_t, Entry> entries_;
};

}  // namespace eigenpose::decoders
