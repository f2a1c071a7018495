#include "core/model/sealed_file.h"

#include <array>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include <zlib.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

using Seal = std::array<char, seal_size>;

struct Content {
  std::uintmax_t bytes = 0;
  std::uint32_t checksum = 0;
};

/// What follows the seal in a file that stands there.
Content read_content(std::istream& file) {
  Content content;
  uLong crc = crc32(0L, nullptr, 0);
  std::vector<char> piece(std::size_t{1} << 20);
  while (file.read(piece.data(), static_cast<std::streamsize>(piece.size())) || file.gcount() > 0) {
    crc = crc32(crc, reinterpret_cast<const Bytef*>(piece.data()), static_cast<uInt>(file.gcount()));
    content.bytes += static_cast<std::uintmax_t>(file.gcount());
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

void seal_file(const SealedFormat& format, const std::filesystem::path& file) {
  std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
  stream.seekg(seal_size);
  const Seal seal = make_seal(format, read_content(stream));
  stream.clear();
  stream.seekp(0);
  stream.write(seal.data(), seal.size());
  stream.close();
  if (!stream) throw FileError(file, "cannot be written; is the disk full?");
}

void check_seal(const SealedFormat& format, const std::filesystem::path& file) {
  const std::string remedy(format.remedy);
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw FileError(file, "cannot be opened; is it there, and may it be read?");
  Seal found{};
  stream.read(found.data(), found.size());
  const std::string_view text(found.data(), static_cast<std::size_t>(stream.gcount()));
  if (!text.starts_with(format.magic)) throw FileError(file, std::string(format.absent));
  if (const long long version = number_after("\nversion ", text); version != format.version)
    throw FileError(file, "is of version " + std::to_string(version) + ", this program reads version " +
                              std::to_string(format.version) + "; " + remedy);
  const Content content = read_content(stream);
  const long long promised = number_after("\ncontent_bytes ", text);
  if (text.size() < seal_size || promised > static_cast<long long>(content.bytes))
    throw FileError(file, "is truncated; restore it from a copy or " + remedy);
  if (found != make_seal(format, content))
    throw FileError(file, "is damaged (wrong checksum); restore it from a copy or " + remedy);
}

}  // namespace eigenpose
