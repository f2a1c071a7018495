#include "core/image/decoders/tiff_directory.h"

namespace eigenpose::decoders {
namespace {

enum TiffType : std::uint16_t { type_byte = 1, type_short = 3, type_long = 4, type_undefined = 7 };

}  // namespace

TiffDirectory::TiffDirectory(Bytes file) : file_(file) {
  if (file.size() < 8) refuse_truncated("its header is cut off");
  big_endian_ = file[0] == 'M';
  const std::uint32_t version = read_16(file.data() + 2);
  if (version == 43) refuse_unsupported("is a BigTIFF file");
  if (version != 42) refuse_damaged("it has no TIFF header");
  const std::size_t at = read_32(file.data() + 4);
  if (at < 8 || at + 2 > file.size()) refuse_truncated("its directory is missing");
  const std::size_t count = read_16(file.data() + at);
  constexpr std::size_t entry_bytes = 12;
  if (at + 2 + count * entry_bytes > file.size()) refuse_truncated("its directory is cut off");
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t entry = at + 2 + i * entry_bytes;
    const unsigned char* bytes = file.data() + entry;
    entries_.emplace(static_cast<std::uint16_t>(read_16(bytes)),
                     Entry{static_cast<std::uint16_t>(read_16(bytes + 2)), read_32(bytes + 4), entry + 8});
  }
}

std::vector<std::uint32_t> TiffDirectory::numbers(std::uint16_t tag) const {
  std::vector<std::uint32_t> result;
  const auto found = entries_.find(tag);
  if (found == entries_.end()) return result;
  const std::uint16_t type = found->second.type;
  if (type != type_byte && type != type_short && type != type_long)
    refuse_damaged("its tag " + std::to_string(tag) + " is not a whole number");
  const std::size_t size = type == type_byte ? 1 : (type == type_short ? 2 : 4);
  const Bytes bytes = values(tag, size);
  result.reserve(bytes.size() / size);
  for (std::size_t i = 0; i < bytes.size(); i += size) {
    const unsigned char* at = bytes.data() + i;
    result.push_back(size == 1 ? *at : (size == 2 ? read_16(at) : read_32(at)));
  }
  return result;
}

std::uint32_t TiffDirectory::number(std::uint16_t tag, std::uint32_t fallback) const {
  const std::vector<std::uint32_t> all = numbers(tag);
  return all.empty() ? fallback : all[0];
}

Bytes TiffDirectory::raw(std::uint16_t tag) const {
  const auto found = entries_.find(tag);
  if (found == entries_.end()) return {};
  if (found->second.type != type_undefined && found->second.type != type_byte)
    refuse_damaged("its tag " + std::to_string(tag) + " is not a list of bytes");
  return values(tag, 1);
}

Bytes TiffDirectory::values(std::uint16_t tag, std::size_t size_of_one) const {
  const Entry& entry = entries_.at(tag);
  const std::uint64_t bytes = std::uint64_t{entry.count} * size_of_one;
  const std::size_t at = bytes <= 4 ? entry.at : read_32(file_.data() + entry.at);
  if (at > file_.size() || bytes > file_.size() - at)
    refuse_truncated("the values of its tag " + std::to_string(tag) + " are missing");
  return file_.subspan(at, static_cast<std::size_t>(bytes));
}

std::uint32_t TiffDirectory::read_16(const unsigned char* at) const {
  return big_endian_ ? std::uint32_t{at[0]} << 8U | at[1] : std::uint32_t{at[1]} << 8U | at[0];
}

std::uint32_t TiffDirectory::read_32(const unsigned char* at) const {
  return big_endian_ ? read_16(at) << 16U | read_16(at + 2) : read_16(at + 2) << 16U | read_16(at);
}

int exif_orientation(Bytes exif) {
  constexpr std::uint16_t orientation_tag = 274;
  try {
    const std::uint32_t value = TiffDirectory(exif).number(orientation_tag, 1);
    return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  } catch (const PictureError&) {
    return 1;  // damaged remarks about a picture do not damage the picture
  }
}

}  // namespace eigenpose::decoders
