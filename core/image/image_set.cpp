#include "core/image/image_set.h"

#include <algorithm>
#include <cctype>

#include "core/base/error.h"
#include "core/image/image_set_format.h"
#include "core/image/picture_file.h"

namespace eigenpose {
namespace {

/// True if a < b, where runs of digits count as numbers.
bool natural_less(const std::string& a, const std::string& b) {
  std::size_t i = 0;
  std::size_t j = 0;
  const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  while (i < a.size() && j < b.size()) {
    if (digit(a[i]) && digit(b[j])) {
      const auto number = [&](const std::string& s, std::size_t& at) {
        while (at < s.size() && s[at] == '0') ++at;
        const std::size_t first = at;
        while (at < s.size() && digit(s[at])) ++at;
        return s.substr(first, at - first);
      };
      const std::string m = number(a, i);
      const std::string n = number(b, j);
      if (m.size() != n.size()) return m.size() < n.size();
      if (m != n) return m < n;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  if ((a.size() - i) != (b.size() - j)) return a.size() - i < b.size() - j;
  return a < b;
}

}  // namespace

ImageSet ImageSet::open(const std::filesystem::path& folder) {
  SetIndex index = read_set_index(folder);
  ImageSet set;
  set.folder_ = folder;
  set.object_ = std::move(index.object);
  set.views_ = read_set_journal(folder, index.workspace, index.complete).views;
  set.workspace_ = std::move(index.workspace);
  set.cropped_ = index.cropped;
  set.complete_ = index.complete;
  return set;
}

cv::Mat ImageSet::load(std::size_t i) const {
  return load_picture(folder_ / views_.at(i).file);
}

std::vector<ImageSet> open_image_sets(const std::filesystem::path& root) {
  std::error_code error;
  if (!std::filesystem::is_directory(root, error))
    throw FileError(root,
                    "is not a folder of image sets; 'eigenpose import' and 'eigenpose acquire' make one");
  std::vector<ImageSet> sets;
  if (std::filesystem::exists(root / "set.json")) {
    sets.push_back(ImageSet::open(root));
    return sets;
  }
  for (const auto& entry : std::filesystem::directory_iterator(root))
    if (entry.is_directory() && std::filesystem::exists(entry.path() / "set.json"))
      sets.push_back(ImageSet::open(entry.path()));
  if (sets.empty())
    throw FileError(root,
                    "holds no image set (no folder with a set.json); 'eigenpose import' and 'eigenpose "
                    "acquire' make them");
  std::sort(sets.begin(), sets.end(),
            [](const ImageSet& a, const ImageSet& b) { return natural_less(a.object(), b.object()); });
  const auto twice = std::adjacent_find(sets.begin(), sets.end(), [](const ImageSet& a, const ImageSet& b) {
    return a.object() == b.object();
  });
  if (twice != sets.end())
    throw FileError(twice->folder(), "and " + (twice + 1)->folder().string() + " are both of the object \"" +
                                         twice->object() + "\"; remove one of them");
  return sets;
}

}  // namespace eigenpose
