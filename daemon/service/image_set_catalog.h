#pragma once

/// The image sets in the state folder, kept in memory.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "core/dataset/image_set.h"
#include "daemon/rig/heartbeat.h"

namespace eigenpose {

/// One image set as last read. Value type.
struct CatalogEntry {
  std::string object;                   ///< its folder's name when it cannot be read
  std::shared_ptr<const ImageSet> set;  ///< null when it cannot be read
  std::string error;                    ///< why not
};

/// Knows every image set without reading it again for each question: a thread looks every few seconds which
/// files have changed, and only these are read. Thread-safe.
class ImageSetCatalog {
 public:
  /// The names of the folders in a folder; `error` is set where not all could be listed.
  using List =
      std::function<std::vector<std::string>(const std::filesystem::path& folder, std::error_code& error)>;

  /// Reads the folder once, then starts the thread. The heartbeat outlives the catalog.
  ImageSetCatalog(std::filesystem::path folder, Heartbeat& heartbeat);
  /// @param list replaces the system's listing; called on several threads, one call at a time.
  ImageSetCatalog(std::filesystem::path folder, Heartbeat& heartbeat, List list);
  ImageSetCatalog(const ImageSetCatalog&) = delete;
  ImageSetCatalog& operator=(const ImageSetCatalog&) = delete;
  ~ImageSetCatalog();

  /// As of a few seconds ago, ordered by object. Reads no file.
  [[nodiscard]] std::vector<CatalogEntry> entries() const;
  /// Looks now for what has changed, and reads it. Where the folder cannot be listed, what is known already
  /// is looked at. @return the entries.
  std::vector<CatalogEntry> refresh();
  /// The entry of one object, whose files are looked at now; nothing if there is no set of that name.
  std::optional<CatalogEntry> look_up(const std::string& object);

 private:
  /// What tells one state of a set's files from another without reading them.
  struct Stamp {
    std::int64_t index_time = 0;
    std::uintmax_t index_size = 0;
    std::int64_t journal_time = 0;
    std::uintmax_t journal_size = 0;
    friend bool operator==(const Stamp&, const Stamp&) = default;
  };
  struct Kept {
    Stamp stamp;
    CatalogEntry entry;
  };
  static std::optional<Stamp> stamp_of(const std::filesystem::path& folder);
  static CatalogEntry read(const std::filesystem::path& folder);
  void run(const std::stop_token& stop);
  /// Logs a trouble once, until it ends or is another one. @param trouble empty: none.
  void report(const std::string& trouble);
  /// Brings the entry of the folder of that name up to date.
  void update(const std::string& name);

  const std::filesystem::path folder_;
  const List list_;
  std::mutex reading_;   ///< one reader of files at a time
  std::string trouble_;  ///< guarded by reading_: logged last
  mutable std::mutex mutex_;
  std::map<std::string, Kept> kept_;  ///< guarded by mutex_: by the folder's name
  Heartbeat::Pulse pulse_;            ///< beaten on the thread
  std::jthread thread_;               ///< last: ends before the rest goes
};

}  // namespace eigenpose
