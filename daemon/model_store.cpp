#include "daemon/model_store.h"

#include <spdlog/spdlog.h>

#include "core/base/error.h"

namespace eigenpose {

ModelStore::ModelStore(std::filesystem::path file) : file_(std::move(file)) {}

std::shared_ptr<const Model> ModelStore::current() const {
  const std::lock_guard lock(mutex_);
  return model_;
}

std::optional<std::string> ModelStore::error() const {
  const std::lock_guard lock(mutex_);
  return error_;
}

}  // namespace eigenpose
