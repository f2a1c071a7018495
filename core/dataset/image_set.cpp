#include "core/dataset/image_set.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/dataset/image_set_format.h"
#include "core/dataset/natural_order.h"
#include "core/image/picture_file.h"

namespace eigenpose {
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
            [](const ImageSet& a, const ImageSet& b) { return NaturalLess()(a.object(), b.object()); });
  const auto twice = std::adjacent_find(sets.begin(), sets.end(), [](const ImageSet& a, const ImageSet& b) {
    return a.object() == b.object();
  });
  if (twice != sets.end())
    throw FileError(twice->folder(), "and " + (twice + 1)->folder().string() + " are both of the object \"" +
                                         twice->object() + "\"; remove one of them");
  return sets;
}

}  // namespace eigenpose
