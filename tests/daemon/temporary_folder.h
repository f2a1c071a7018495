#pragma once

/// A folder of one test, gone at its end.

#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

namespace eigenpose {

/// Its path is short, so that sockets fit in.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = "/tmp/eigenpose-XXXXXX";
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace eigenpose
