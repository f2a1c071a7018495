#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <system_error>

#include <nlohmann/json.hpp>

#include "core/base/atomic_file.h"
#include "core/base/error.h"
#include "core/base/file_lock.h"
#include "core/base/journal_file.h"
#include "core/dataset/image_set.h"
#include "core/dataset/image_set_format.h"
#include "core/image/picture_file.h"

namespace eigenpose {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// 17 of "000017.png"; nothing of other names.
std::size_t number_after(const std::string& file) {
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(file.data(), file.data() + file.size(), number);
  return error == std::errc() && number < 1'000'000'000 ? number + 1 : 0;
}

std::string file_name(std::size_t number) {
  std::array<char, 32> name{};
  std::snprintf(name.data(), name.size(), "%06zu.png", number);
  return name.data();
}

fs::path made(fs::path folder, const std::string& object, const Workspace& workspace) {
  check_object_name(object);
  if (workspace.size() == 0)
    throw std::invalid_argument("an image set needs a workspace of at least one degree of freedom");
  make_folders(folder);
  return folder;
}

}  // namespace

/// What a writer holds of its folder: nobody else writes there.
struct ImageSetWriter::Files {
  explicit Files(const fs::path& folder) : lock(folder / ".lock", "the image set") {}
  FileLock lock;
  std::unique_ptr<JournalFile> journal;
};

ImageSetWriter::ImageSetWriter(const fs::path& root, const std::string& object, Workspace workspace,
                               const json& source, ImageSetOptions options)
    : folder_(made(root / object, object, workspace)),
      object_(object),
      workspace_(std::move(workspace)),
      options_(options),
      files_(std::make_unique<Files>(folder_)),
      source_(json_line(source)) {
  remove_abandoned_parts(folder_);
  std::uint64_t good_bytes = 0;
  std::error_code error;
  if (fs::exists(folder_ / "set.json", error) || error) good_bytes = take_up();
  if (views_.empty())
    write_file_atomically(folder_ / "set.json",
                          set_index_text({object_, workspace_, options_.cropped, false}, this->source()));
  files_->journal = std::make_unique<JournalFile>(folder_ / "views.jsonl", good_bytes);
}

ImageSetWriter::~ImageSetWriter() = default;

std::uint64_t ImageSetWriter::take_up() {
  const SetIndex index = read_set_index(folder_);
  if (index.complete)
    throw FileError(folder_, "is a complete image set already; remove it or give the object another name");
  if (index.object != object_ || index.workspace != workspace_ || index.cropped != options_.cropped)
    throw FileError(folder_,
                    "is an unfinished image set of another object, workspace or kind of view; remove it or "
                    "give the object another name");
  SetJournal journal = read_set_journal(folder_, workspace_, SetState::unfinished);
  views_ = std::move(journal.views);
  if (!views_.empty()) source_ = json_line(read_set_source(folder_));
  for (const ViewRecord& view : views_) next_file_ = std::max(next_file_, number_after(view.file));
  return journal.good_bytes;
}

json ImageSetWriter::source() const {
  return json::parse(source_);
}

void ImageSetWriter::add(const cv::Mat& image, std::vector<double> q) {
  add(image, std::move(q), json::object());
}

void ImageSetWriter::add(const cv::Mat& image, std::vector<double> q, const json& facts) {
  q = workspace_.canonical(q);
  if (!std::all_of(q.begin(), q.end(), [](double v) { return std::isfinite(v); }))
    throw std::invalid_argument("a view of \"" + object_ + "\" has a pose that is not finite");
  if (!facts.is_object())
    throw std::invalid_argument("the facts of a view are a JSON object, got " + facts.dump());
  const std::string name = file_name(next_file_);
  const auto bytes = encode_png(image);
  const fs::path file = folder_ / name;
  json line = facts;
  line["file"] = name;
  line["q"] = q;
  const std::string_view picture(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (options_.sync_every_view)
    write_file_atomically(file, picture);
  else
    write_file_unflushed(file, picture);
  const std::uint64_t before = files_->journal->size();
  try {
    files_->journal->append(json_line(line));
    if (options_.sync_every_view) files_->journal->flush();
  } catch (...) {
    drop_view(file, before);
    throw;
  }
  ++next_file_;
  views_.push_back({name, std::move(q)});
}

void ImageSetWriter::drop_view(const fs::path& file, std::uint64_t journal_bytes) noexcept {
  try {
    files_->journal->cut_to(journal_bytes);
  } catch (...) {  // the journal cuts it off before its next line
  }
  std::error_code ignored;
  fs::remove(file, ignored);  // no picture without a line
}

void ImageSetWriter::finish() {
  if (views_.empty()) throw FileError(folder_, "has no view and cannot be complete; acquire at least one");
  if (!options_.sync_every_view) flush_file_system(folder_);
  write_file_atomically(folder_ / "set.json",
                        set_index_text({object_, workspace_, options_.cropped, true}, source()));
}

}  // namespace eigenpose
