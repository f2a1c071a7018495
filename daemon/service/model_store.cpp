#include "daemon/service/model_store.h"

#include <spdlog/spdlog.h>

#include "core/base/error.h"
#include "core/model/model_file.h"

namespace eigenpose {

ModelStore::ModelStore(std::filesystem::path file) : file_(std::move(file)) {}

void ModelStore::load() {
  std::error_code ignored;
  if (!std::filesystem::exists(file_, ignored)) return;
  try {
    auto model = std::make_shared<const Model>(load_model(file_));
    spdlog::info("event=model_loaded file={} objects={}", file_.string(), model->objects.size());
    const std::lock_guard lock(mutex_);
    model_ = std::move(model);
  } catch (const Error& error) {
    spdlog::error("event=model_refused error=\"{}\"", error.what());
    const std::lock_guard lock(mutex_);
    error_ = error.what();
  }
}

void ModelStore::replace(std::shared_ptr<const Model> model) {
  save_model(*model, file_);
  const std::lock_guard lock(mutex_);
  model_ = std::move(model);
  error_.reset();
}

std::shared_ptr<const Model> ModelStore::current() const {
  const std::lock_guard lock(mutex_);
  return model_;
}

std::optional<std::string> ModelStore::error() const {
  const std::lock_guard lock(mutex_);
  return error_;
}

}  // namespace eigenpose
