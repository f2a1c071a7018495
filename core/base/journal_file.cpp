#include "core/base/journal_file.h"

#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

#include "core/base/error.h"

namespace eigenpose {

JournalFile::JournalFile(std::filesystem::path file, std::uint64_t good_bytes, FileCalls& calls)
    : calls_(calls), file_(std::move(file)), good_bytes_(good_bytes) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(file_, error);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    throw FileError(file_, "is not a plain file; move it away");
  if (!std::filesystem::exists(status)) write_file_atomically(file_, "", calls);
  fd_ = calls_.open(file_.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK, 0);
  if (fd_ < 0) throw FileError(file_, "cannot be opened for writing: " + write_trouble(errno));
  try {
    cut_to(good_bytes);
  } catch (...) {
    (void)calls_.close(fd_);
    throw;
  }
}

JournalFile::~JournalFile() {
  (void)calls_.close(fd_);
}

void JournalFile::cut_to(std::uint64_t size) {
  good_bytes_ = size;
  to_be_cut_ = calls_.ftruncate(fd_, static_cast<off_t>(size)) != 0;
  if (to_be_cut_) throw FileError(file_, "cannot be cut to its last whole line: " + write_trouble(errno));
}

void JournalFile::append(std::string_view lines) {
  if (to_be_cut_) cut_to(good_bytes_);
  std::uint64_t at = good_bytes_;
  while (!lines.empty()) {
    const ssize_t n = calls_.pwrite(fd_, lines.data(), lines.size(), static_cast<off_t>(at));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      const int error = n < 0 ? errno : ENOSPC;
      to_be_cut_ = true;  // by the next call, if it cannot be now: what failed first is reported
      try {
        cut_to(good_bytes_);
      } catch (const FileError&) {
      }
      throw FileError(file_,
                      "cannot be written: " + write_trouble(error) + "; what was written before is safe");
    }
    at += static_cast<std::uint64_t>(n);
    lines.remove_prefix(static_cast<std::size_t>(n));
  }
  good_bytes_ = at;
}

void JournalFile::flush() {
  if (calls_.fsync(fd_) != 0)
    throw FileError(file_, "cannot be flushed to the disk: " + write_trouble(errno));
}

}  // namespace eigenpose
