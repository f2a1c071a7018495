#pragma once

/// Files in which no changed byte goes unnoticed.
///
/// A sealed file begins with a block of 512 bytes that HDF5 skips: format, version, length and checksum
/// (CRC-32) of everything after it. A file in which any byte was changed, or that is cut off, is refused
/// before HDF5 sees it.

#include <cstddef>
#include <filesystem>
#include <string_view>

#include "core/base/atomic_file.h"

namespace eigenpose {

inline constexpr std::size_t seal_size = 512;  ///< HDF5 wants a power of two, at least 512

/// One format, and what is said where a file is not of it.
struct SealedFormat {
  std::string_view magic;   ///< the first line, with its end
  int version = 1;          ///< the one that is read
  std::string_view absent;  ///< "is no …; this is what makes them"
  std::string_view remedy;  ///< what to do about one that cannot be used
};

/// Fills the first 512 bytes of a file whose content is complete. Reads it once, in pieces. @throws
/// FileError.
void seal_file(const SealedFormat& format, AtomicFile& file);

/// Reads the file once, in pieces. @throws FileError saying what is wrong (missing, another format or
/// version, truncated, damaged) and what to do.
void check_seal(const SealedFormat& format, const std::filesystem::path& file);

}  // namespace eigenpose
