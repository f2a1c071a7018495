#include "daemon/service/image_set_catalog.h"

#include <chrono>
#include <condition_variable>
#include <set>
#include <utility>

#include <spdlog/spdlog.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds catalog_look_period{2};
/// A look reads what has changed; a large set on a slow disk takes a while.
constexpr std::chrono::seconds catalog_look_limit{60};

std::int64_t ticks(const fs::path& file, std::error_code& error) {
  return static_cast<std::int64_t>(fs::last_write_time(file, error).time_since_epoch().count());
}

std::vector<std::string> list_folder(const fs::path& folder, std::error_code& error) {
  std::vector<std::string> names;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    names.push_back(entry->path().filename().string());
  if (error == std::errc::no_such_file_or_directory) error.clear();  // nothing was acquired yet
  return names;
}

}  // namespace

ImageSetCatalog::ImageSetCatalog(fs::path folder, Heartbeat& heartbeat)
    : ImageSetCatalog(std::move(folder), heartbeat, list_folder) {}

ImageSetCatalog::ImageSetCatalog(fs::path folder, Heartbeat& heartbeat, List list)
    : folder_(std::move(folder)), list_(std::move(list)) {
  refresh();
  pulse_ = heartbeat.join("catalog", catalog_look_limit);
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

ImageSetCatalog::~ImageSetCatalog() = default;

void ImageSetCatalog::run(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  while (!stop.stop_requested()) {
    pulse_.beat();
    never.wait_for(lock, stop, catalog_look_period, [] { return false; });
    if (stop.stop_requested()) return;
    try {
      refresh();
    } catch (const std::exception& error) {
      const std::lock_guard reading(reading_);
      report(error.what());
    }
  }
}

void ImageSetCatalog::report(const std::string& trouble) {
  if (trouble != trouble_ && !trouble.empty())
    spdlog::error("event=image_sets_unreadable folder={} error=\"{}\"", folder_.string(), trouble);
  trouble_ = trouble;
}

std::vector<CatalogEntry> ImageSetCatalog::entries() const {
  const std::lock_guard lock(mutex_);
  std::vector<CatalogEntry> result;
  for (const auto& [name, kept] : kept_) result.push_back(kept.entry);
  return result;
}

std::vector<CatalogEntry> ImageSetCatalog::refresh() {
  const std::lock_guard reading(reading_);
  std::error_code error;
  const std::vector<std::string> listed = list_(folder_, error);
  std::set<std::string> names(listed.begin(), listed.end());
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [name, kept] : kept_) names.insert(name);
  }
  for (const std::string& name : names) update(name);
  report(error ? error.message() : "");
  return entries();
}

std::optional<CatalogEntry> ImageSetCatalog::look_up(const std::string& object) {
  const std::lock_guard reading(reading_);
  update(object);
  const std::lock_guard lock(mutex_);
  const auto found = kept_.find(object);
  return found == kept_.end() ? std::nullopt : std::optional(found->second.entry);
}

std::optional<ImageSetCatalog::Stamp> ImageSetCatalog::stamp_of(const fs::path& folder) {
  std::error_code error;
  const fs::path index = folder / "set.json";
  const fs::path journal = folder / "views.jsonl";
  if (!fs::exists(index, error) && !error) return std::nullopt;
  Stamp stamp;
  if (error) return stamp;  // it may be there: reading it says what is wrong
  stamp.index_time = ticks(index, error);
  stamp.index_size = fs::file_size(index, error);
  if (fs::exists(journal, error)) {
    stamp.journal_time = ticks(journal, error);
    stamp.journal_size = fs::file_size(journal, error);
  }
  return stamp;
}

CatalogEntry ImageSetCatalog::read(const fs::path& folder) {
  CatalogEntry entry{folder.filename().string(), nullptr, {}};
  try {
    for (const char* name : {"set.json", "views.jsonl"}) {
      std::error_code ignored;
      const fs::path file = folder / name;
      // Opening a pipe or a device would wait for somebody at its other end.
      if (fs::exists(file, ignored) && !fs::is_regular_file(file, ignored))
        throw FileError(file, "is not a plain file: remove it");
    }
    auto set = std::make_shared<const ImageSet>(ImageSet::open(folder));
    entry.object = set->object();
    entry.set = std::move(set);
  } catch (const std::exception& error) {
    entry.error = error.what();
    spdlog::warn("event=image_set_unreadable folder={} error=\"{}\"", folder.string(), entry.error);
  }
  return entry;
}

void ImageSetCatalog::update(const std::string& name) {
  const fs::path folder = folder_ / name;
  const std::optional<Stamp> stamp = stamp_of(folder);
  {
    const std::lock_guard lock(mutex_);
    const auto found = kept_.find(name);
    if (!stamp) {
      kept_.erase(name);
      return;
    }
    if (found != kept_.end() && found->second.stamp == *stamp) return;
  }
  CatalogEntry entry = read(folder);
  const std::lock_guard lock(mutex_);
  kept_[name] = {*stamp, std::move(entry)};
}

}  // namespace eigenpose
