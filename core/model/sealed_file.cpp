#include "core/model/sealed_file.h"

#include <array>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <span>
#include <string>
#include <vector>

#include <zlib.h>

#include "core/base/error.h"
#include "core/base/input_file.h"

namespace eigenpose {
namespace {

using Seal = std::array<char, seal_size>;

struct Content {
  std::uintmax_t bytes = 0;
  std::uint32_t checksum = 0;
};

/// What follows the seal. @param read (position, bytes) → how many bytes were read, fewer only at the end.
template <typename Read>
Content measure_content(const Read& read) {
  Content content;
  uLong crc = crc32(0L, nullptr, 0);
  std::vector<std::uint8_t> piece(std::size_t{1} << 20);
  for (;;) {
    const std::size_t count = read(seal_size + content.bytes, std::span(piece));
    crc = crc32(crc, piece.data(), static_cast<uInt>(count));
    content.bytes += count;
    if (count < piece.size()) break;
  }
  content.checksum = static_cast<std::uint32_t>(crc);
  return content;
}

/// The one seal that belongs to this content; reading compares with it byte by byte.
Seal make_seal(const SealedFormat& format, const Content& content) {
  Seal seal{};
  std::snprintf(seal.data(), seal.size(), "%.*sversion %d\ncontent_bytes %ju\ncontent_crc32 %08x\n",
                static_cast<int>(format.magic.size()), format.magic.data(), format.version, content.bytes,
                content.checksum);
  return seal;
}

/// The number after `key`, or −1.
long long number_after(std::string_view key, std::string_view seal) {
  const auto at = seal.find(key);
  long long value = -1;
  if (at != std::string_view::npos)
    std::from_chars(seal.data() + at + key.size(), seal.data() + seal.size(), value);
  return value;
}

}  // namespace

void seal_file(const SealedFormat& format, AtomicFile& file) {
  const Seal seal = make_seal(format, measure_content([&](std::uint64_t at, std::span<std::uint8_t> bytes) {
                                return file.read_at(at, bytes);
                              }));
  file.write_at(0, {seal.data(), seal.size()});
}

void check_seal(const SealedFormat& format, const std::filesystem::path& file) {
  const std::string remedy(format.remedy);
  const InputFile in(file);
  std::array<std::uint8_t, seal_size> found{};
  const std::size_t count = in.read_some(0, found);
  const std::string_view text(reinterpret_cast<const char*>(found.data()), count);
  if (!text.starts_with(format.magic)) throw FileError(file, std::string(format.absent));
  if (const long long version = number_after("\nversion ", text); version != format.version)
    throw FileError(file, "is of version " + std::to_string(version) + ", this program reads version " +
                              std::to_string(format.version) + "; " + remedy);
  const Content content = measure_content(
      [&](std::uint64_t at, std::span<std::uint8_t> bytes) { return in.read_some(at, bytes); });
  const long long promised = number_after("\ncontent_bytes ", text);
  if (text.size() < seal_size || promised > static_cast<long long>(content.bytes))
    throw FileError(file, "is truncated; restore it from a copy or " + remedy);
  const Seal expected = make_seal(format, content);
  if (text != std::string_view(expected.data(), expected.size()))
    throw FileError(file, "is damaged (wrong checksum); restore it from a copy or " + remedy);
}

}  // namespace eigenpose
