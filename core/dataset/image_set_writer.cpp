#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "core/base/atomic_file.h"
#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "core/dataset/image_set_format.h"
#include "core/image/picture_file.h"

namespace eigenpose {
namespace {

using nlohmann::json;

std::string cause(int error) {
  return std::strerror(error);
}

/// Appends to a file and tells whether all of it arrived.
void append(const std::filesystem::path& file, const std::string& text, bool sync) {
  const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (fd < 0) throw FileError(file, "cannot be opened for writing: " + cause(errno));
  const ssize_t written = ::write(fd, text.data(), text.size());
  int error = written < 0 ? errno : written != static_cast<ssize_t>(text.size()) ? ENOSPC : 0;
  if (error == 0 && sync && ::fdatasync(fd) != 0) error = errno;
  ::close(fd);
  if (error != 0)
    throw FileError(file, "cannot be written: " + cause(error) + "; the views before it are safe");
}

void write_plain(const std::filesystem::path& file, const std::vector<unsigned char>& bytes) {
  std::FILE* out = std::fopen(file.c_str(), "wb");
  if (out == nullptr) throw FileError(file, "cannot be written: " + cause(errno));
  const bool whole = std::fwrite(bytes.data(), 1, bytes.size(), out) == bytes.size();
  const int error = errno;
  if (std::fclose(out) != 0 || !whole)
    throw FileError(file,
                    "cannot be written: " + cause(whole ? errno : error) + "; the views before it are safe");
}

}  // namespace

void check_object_name(const std::string& name) {
  const auto alphanumeric = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; };
  const bool good = !name.empty() && name.size() <= 64 && alphanumeric(name.front()) &&
                    std::all_of(name.begin(), name.end(),
                                [&](char c) { return alphanumeric(c) || c == '_' || c == '.' || c == '-'; });
  if (!good)
    throw std::invalid_argument(
        "\"" + name +
        "\" cannot be an object's name; use 1 to 64 of A-Z a-z 0-9 _ . - and begin with a "
        "letter or digit");
}

ImageSetWriter::ImageSetWriter(const std::filesystem::path& root, const std::string& object,
                               Workspace workspace, const json& source, ImageSetOptions options)
    : folder_(root / object), object_(object), workspace_(std::move(workspace)), options_(options) {
  check_object_name(object);
  if (workspace_.size() == 0)
    throw std::invalid_argument("an image set needs a workspace of at least one degree of freedom");
  if (std::filesystem::exists(folder_ / "set.json")) {
    const SetIndex index = read_set_index(folder_);
    if (index.complete)
      throw FileError(folder_, "is a complete image set already; remove it or give the object another name");
    if (index.object != object_ || index.workspace != workspace_ || index.cropped != options_.cropped)
      throw FileError(folder_,
                      "is an unfinished image set of another object, workspace or kind of view; remove it or "
                      "give the object another name");
    SetJournal journal = read_set_journal(folder_, workspace_, false);
    views_ = std::move(journal.views);
    journal_ = journal.good_bytes;
    if (std::filesystem::exists(folder_ / "views.jsonl"))
      std::filesystem::resize_file(folder_ / "views.jsonl", journal_);
    for (const ViewRecord& view : views_)
      next_file_ = std::max<std::size_t>(next_file_, std::strtoul(view.file.c_str(), nullptr, 10) + 1);
  } else {
    std::error_code error;
    std::filesystem::create_directories(folder_, error);
    if (error) throw FileError(folder_, "cannot be made: " + error.message());
    write_file_atomically(folder_ / "set.json",
                          set_index_text({object_, workspace_, options_.cropped, false}, source));
  }
  source_ = source.dump();
}

ImageSetWriter::~ImageSetWriter() = default;

void ImageSetWriter::add(const cv::Mat& image, std::vector<double> q) {
  add(image, std::move(q), json::object());
}

void ImageSetWriter::add(const cv::Mat& image, std::vector<double> q, const json& facts) {
  q = workspace_.canonical(q);
  if (!std::all_of(q.begin(), q.end(), [](double v) { return std::isfinite(v); }))
    throw std::invalid_argument("a view of \"" + object_ + "\" has a pose that is not finite");
  if (!facts.is_object())
    throw std::invalid_argument("the facts of a view are a JSON object, got " + facts.dump());
  char name[32];
  std::snprintf(name, sizeof name, "%06zu.png", next_file_);
  const auto bytes = encode_png(image);
  const auto file = folder_ / name;
  const auto journal_file = folder_ / "views.jsonl";
  json line = facts;
  line["file"] = name;
  line["q"] = q;
  const std::string text = line.dump() + "\n";
  try {
    if (options_.sync_every_view)
      write_file_atomically(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    else
      write_plain(file, bytes);
    append(journal_file, text, options_.sync_every_view);
  } catch (...) {
    // The set is as it was before: no half line in the journal, no picture without a line.
    std::error_code ignored;
    if (std::filesystem::exists(journal_file, ignored))
      std::filesystem::resize_file(journal_file, journal_, ignored);
    std::filesystem::remove(file, ignored);
    throw;
  }
  journal_ += text.size();
  ++next_file_;
  views_.push_back({name, std::move(q)});
}

void ImageSetWriter::finish() {
  if (views_.empty()) throw FileError(folder_, "has no view and cannot be complete; acquire at least one");
  if (!options_.sync_every_view) {
    const int fd = ::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const bool synced = fd >= 0 && ::syncfs(fd) == 0;
    const int error = errno;
    if (fd >= 0) ::close(fd);
    if (!synced) throw FileError(folder_, "cannot be flushed to the disk: " + cause(error));
  }
  write_file_atomically(folder_ / "set.json",
                        set_index_text({object_, workspace_, options_.cropped, true}, json::parse(source_)));
}

}  // namespace eigenpose
