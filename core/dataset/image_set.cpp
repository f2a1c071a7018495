#include "core/dataset/image_set.h"

#include <algorithm>
#include <system_error>

#include "core/base/error.h"
#include "core/base/printable.h"
#include "core/dataset/image_set_format.h"
#include "core/dataset/natural_order.h"
#include "core/image/picture_file.h"

namespace eigenpose {

ImageSet ImageSet::open(const std::filesystem::path& folder) {
  SetIndex index = read_set_index(folder);
  ImageSet set;
  set.folder_ = folder;
  set.object_ = std::move(index.object);
  set.views_ =
      read_set_journal(folder, index.workspace, index.complete ? SetState::complete : SetState::unfinished)
          .views;
  set.workspace_ = std::move(index.workspace);
  set.cropped_ = index.cropped;
  set.complete_ = index.complete;
  return set;
}

cv::Mat ImageSet::load(std::size_t i) const {
  return load_picture(folder_ / views_.at(i).file);
}

namespace {

namespace fs = std::filesystem;

/// The folders below `root` that claim to be image sets, and those that cannot be looked into.
std::vector<fs::path> list_sets(const fs::path& root, std::vector<FileError>& left_out) {
  std::error_code error;
  fs::directory_iterator entries(root, error);
  if (error) throw FileError(root, "cannot be listed: " + error.message());
  std::vector<fs::path> folders;
  for (const fs::directory_iterator end; entries != end; entries.increment(error)) {
    if (error) throw FileError(root, "cannot be listed: " + error.message());
    const fs::path& folder = entries->path();
    if (!fs::is_directory(folder, error)) continue;
    const fs::file_status index = fs::symlink_status(folder / "set.json", error);
    if (index.type() == fs::file_type::none)
      left_out.emplace_back(folder, "cannot be read: " + error.message());
    else if (fs::exists(index))
      folders.push_back(folder);
  }
  return folders;
}

/// Moves sets that are of one object out: which of them is meant nobody knows.
void leave_out_doubles(FoundImageSets& found) {
  std::vector<ImageSet> kept;
  for (std::size_t i = 0; i < found.sets.size(); ++i) {
    const auto same = [&](std::size_t j) {
      return j < found.sets.size() && found.sets[i].object() == found.sets[j].object();
    };
    const std::size_t other = same(i + 1) ? i + 1 : i - 1;
    if (same(i + 1) || (i > 0 && same(i - 1)))
      found.left_out.emplace_back(found.sets[i].folder(),
                                  "and " + printable(found.sets[other].folder().string()) +
                                      " are both of the object \"" + found.sets[i].object() +
                                      "\"; remove one of them");
    else
      kept.push_back(std::move(found.sets[i]));
  }
  found.sets = std::move(kept);
}

}  // namespace

FoundImageSets find_image_sets(const fs::path& root) {
  std::error_code error;
  if (!fs::is_directory(root, error))
    throw FileError(root,
                    "is not a folder of image sets; 'eigenpose import' and 'eigenpose acquire' make one");
  FoundImageSets found;
  if (fs::exists(root / "set.json", error)) {
    found.sets.push_back(ImageSet::open(root));
    return found;
  }
  for (const fs::path& folder : list_sets(root, found.left_out)) {
    try {
      found.sets.push_back(ImageSet::open(folder));
    } catch (const FileError& wrong) {
      found.left_out.push_back(wrong);
    }
  }
  std::sort(found.sets.begin(), found.sets.end(), [](const ImageSet& a, const ImageSet& b) {
    return a.object() != b.object() ? NaturalLess()(a.object(), b.object()) : a.folder() < b.folder();
  });
  leave_out_doubles(found);
  std::sort(found.left_out.begin(), found.left_out.end(),
            [](const FileError& a, const FileError& b) { return a.file() < b.file(); });
  if (found.sets.empty() && !found.left_out.empty())
    throw FileError(
        root, "holds no image set that can be used; the first is " + std::string(found.left_out[0].what()));
  if (found.sets.empty())
    throw FileError(root,
                    "holds no image set (no folder with a set.json); 'eigenpose import' and 'eigenpose "
                    "acquire' make them");
  return found;
}

std::vector<ImageSet> open_image_sets(const fs::path& root) {
  FoundImageSets found = find_image_sets(root);
  if (!found.left_out.empty()) throw found.left_out.front();
  return std::move(found.sets);
}

}  // namespace eigenpose
