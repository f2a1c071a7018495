#pragma once

/// The model in use, swapped in live.

#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "core/model/model.h"

namespace eigenpose {

/// Holds the model that is watched with and its file. A reader keeps the model it got for as long as it
/// likes. Thread-safe.
class ModelStore {
 public:
  explicit ModelStore(std::filesystem::path file);

  /// Reads the file. If it is damaged there is no model, `error` says why, and the file stays as it is.
  void load();
  /// Writes the file, then swaps the model in. @throws FileError, and then the former model stays in use and
  /// on disk.
  void replace(std::shared_ptr<const Model> model);

  [[nodiscard]] std::shared_ptr<const Model> current() const;  ///< null when there is none
  [[nodiscard]] std::optional<std::string> error() const;
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  const std::filesystem::path file_;
  mutable std::mutex mutex_;
  std::shared_ptr<const Model> model_;  ///< guarded by mutex_
  std::optional<std::string> error_;    ///< guarded by mutex_
};

}  // namespace eigenpose
