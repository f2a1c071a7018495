#include "core/base/atomic_file.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/error.h"
#include "core/base/printable.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view part_prefix = ".eigenpose-part-";
constexpr const char* staged_suffix = ".next";

fs::path folder_of(const fs::path& file) {
  const fs::path folder = file.parent_path();
  return folder.empty() ? fs::path(".") : folder;
}

/// The file that is to be replaced: what a symbolic link names, else the path itself.
fs::path resolved(fs::path target) {
  std::error_code error;
  constexpr int most_links = 40;
  for (int i = 0; fs::is_symlink(target, error); ++i) {
    const fs::path named = fs::read_symlink(target, error);
    if (error || i == most_links) throw FileError(target, "is a symbolic link that leads nowhere; remove it");
    target = named.is_absolute() ? named : target.parent_path() / named;
  }
  const fs::file_status status = fs::status(target, error);
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw FileError(target, fs::is_directory(status)
                                ? "is a folder; give the name of a file"
                                : "is not a plain file and is not replaced; give another name");
  return target;
}

/// The text without the path that it begins with.
std::string cause_of(const FileError& error) {
  const std::string text = error.what();
  const std::string path = printable(error.file().string()) + ": ";
  return text.starts_with(path) ? text.substr(path.size()) : text;
}

/// A folder that is to be flushed.
class OpenFolder {
 public:
  OpenFolder(const fs::path& folder, FileCalls& calls)
      : calls_(calls), fd_(calls.open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC, 0)) {}
  OpenFolder(const OpenFolder&) = delete;
  OpenFolder& operator=(const OpenFolder&) = delete;
  ~OpenFolder() {
    if (fd_ >= 0) (void)calls_.close(fd_);
  }
  /// False, with errno, where it cannot be opened.
  [[nodiscard]] bool open() const { return fd_ >= 0; }
  [[nodiscard]] int fd() const { return fd_; }
  /// 0 or an errno. Some file systems flush no folders; that is no reason to call a file lost.
  [[nodiscard]] int flush() {
    int error = calls_.fsync(fd_) != 0 && errno != EINVAL && errno != ENOTSUP ? errno : 0;
    if (calls_.close(std::exchange(fd_, -1)) != 0 && error == 0 && errno != EINTR) error = errno;
    return error;
  }

 private:
  FileCalls& calls_;
  int fd_;
};

/// True if the part file has its name yet: nobody took it for abandoned before it was locked.
bool still_there(int fd) {
  struct stat status {};
  return ::fstat(fd, &status) == 0 && status.st_nlink > 0;
}

}  // namespace

int FileCalls::open(const char* path, int flags, mode_t mode) {
  return ::open(path, flags, mode);
}
ssize_t FileCalls::pwrite(int fd, const void* bytes, std::size_t count, off_t at) {
  return ::pwrite(fd, bytes, count, at);
}
int FileCalls::ftruncate(int fd, off_t size) {
  return ::ftruncate(fd, size);
}
int FileCalls::fsync(int fd) {
  return ::fsync(fd);
}
int FileCalls::close(int fd) {
  return ::close(fd);
}
int FileCalls::rename(const char* from, const char* to) {
  return ::rename(from, to);
}

FileCalls& FileCalls::system() {
  static FileCalls calls;
  return calls;
}

std::string write_trouble(int error) {
  if (error == ENOSPC || error == EDQUOT)
    return std::string("the disk is full (") + std::strerror(error) + "); make room and try again";
  if (error == EFBIG) return "the file would be larger than this process may write (ulimit -f)";
  return std::strerror(error);
}

AtomicFile::AtomicFile(fs::path target, FileCalls& calls)
    : calls_(calls), target_(resolved(std::move(target))) {
  static std::atomic<unsigned> serial{0};
  const fs::path folder = folder_of(target_);
  constexpr int attempts = 1000;  // names that programs with this process number have left
  for (int i = 0; i < attempts; ++i)
    if (make_part(folder, serial++)) return;
  fail("cannot be written", EEXIST);
}

bool AtomicFile::make_part(const fs::path& folder, unsigned serial) {
  part_ = folder / (std::string(part_prefix) + std::to_string(::getpid()) + "-" + std::to_string(serial));
  fd_ = calls_.open(part_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (fd_ < 0 && errno == EEXIST) return false;
  if (fd_ < 0) fail("cannot be written", errno);
  // Where a file system knows no locks, nothing is abandoned but by hand.
  (void)::flock(fd_, LOCK_EX | LOCK_NB);
  if (still_there(fd_)) return true;
  (void)calls_.close(std::exchange(fd_, -1));
  return false;
}

AtomicFile::~AtomicFile() {
  if (fd_ >= 0) (void)calls_.close(fd_);
  if (!renamed_) (void)::unlink(part_.c_str());
}

void AtomicFile::fail(const char* operation, int error) const {
  std::error_code ignored;
  throw FileError(target_, std::string(operation) + ": " + write_trouble(error) +
                               (fs::exists(target_, ignored) ? "; the former file is unchanged" : ""));
}

void AtomicFile::write_at(std::uint64_t at, std::string_view bytes) {
  constexpr std::size_t largest = std::size_t{1} << 30;  // the system writes no more at once
  while (!bytes.empty()) {
    const ssize_t n =
        calls_.pwrite(fd_, bytes.data(), std::min(bytes.size(), largest), static_cast<off_t>(at));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) fail("cannot be written", n < 0 ? errno : ENOSPC);
    at += static_cast<std::uint64_t>(n);
    bytes.remove_prefix(static_cast<std::size_t>(n));
    size_ = std::max(size_, at);
  }
}

void AtomicFile::resize(std::uint64_t size) {
  if (calls_.ftruncate(fd_, static_cast<off_t>(size)) != 0) fail("cannot be written", errno);
  size_ = size;
}

std::size_t AtomicFile::read_at(std::uint64_t at, std::span<std::uint8_t> bytes) const {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::pread(fd_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(at + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail("cannot be read back", errno);
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  return done;
}

void AtomicFile::sync() {
  if (calls_.fsync(fd_) != 0) fail("cannot be flushed to the disk", errno);
}

void AtomicFile::rename_part(const fs::path& name) {
  // The lock stays until the part has its name: others would take it for an abandoned one.
  const int locked = fd_ >= 0 ? ::fcntl(fd_, F_DUPFD_CLOEXEC, 0) : -1;
  // Network file systems and quotas report here what they could not write. The descriptor is gone either way.
  const bool closed = fd_ < 0 || calls_.close(std::exchange(fd_, -1)) == 0 || errno == EINTR;
  const bool renamed = closed && calls_.rename(part_.c_str(), name.c_str()) == 0;
  const int error = errno;
  if (locked >= 0) ::close(locked);
  if (!closed) fail("cannot be written", error);
  if (!renamed) fail("cannot be replaced", error);
  renamed_ = true;
  part_ = name;
}

void AtomicFile::rename_part_durably(const fs::path& name) {
  OpenFolder folder(folder_of(target_), calls_);
  if (!folder.open()) fail("its folder cannot be opened to flush it", errno);
  rename_part(name);
  if (const int error = folder.flush(); error != 0)
    throw FileError(name,
                    "is written, but its folder cannot be flushed to the disk: " + write_trouble(error));
}

void AtomicFile::commit_unflushed() {
  rename_part(target_);
}

void AtomicFile::prepare(const Verify& verify) {
  sync();
  prepared_ = true;
  if (!verify) return;
  // Clean pages are dropped, so that the disk is read and not the memory.
  (void)::posix_fadvise(fd_, 0, 0, POSIX_FADV_DONTNEED);
  try {
    verify(part_);
  } catch (const FileError& wrong) {
    throw FileError(target_,
                    "read back after writing, it " + cause_of(wrong) + "; the former file is unchanged");
  } catch (const Error& wrong) {
    throw FileError(
        target_, std::string("read back after writing: ") + wrong.what() + "; the former file is unchanged");
  }
}

fs::path AtomicFile::staged_name(const fs::path& target) {
  return resolved(target) += staged_suffix;
}

void AtomicFile::stage() {
  if (!prepared_) prepare();
  rename_part_durably(staged_name(target_));
}

void AtomicFile::commit(const Verify& verify) {
  if (!prepared_) prepare(verify);
  rename_part_durably(target_);
}

void write_file_atomically(const fs::path& target, std::string_view bytes, FileCalls& calls) {
  AtomicFile file(target, calls);
  file.write(bytes);
  file.commit();
}

void write_file_unflushed(const fs::path& target, std::string_view bytes) {
  AtomicFile file(target);
  file.write(bytes);
  file.commit_unflushed();
}

void flush_file_system(const fs::path& folder) {
  const OpenFolder open(folder, FileCalls::system());
  if (!open.open() || ::syncfs(open.fd()) != 0)
    throw FileError(folder, "cannot be flushed to the disk: " + write_trouble(errno));
}

void make_folders(const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(folder, error) || folder.empty()) return;
  make_folders(folder.parent_path());
  std::error_code ignored;
  if (!fs::create_directory(folder, error) && !fs::is_directory(folder, ignored))
    throw FileError(folder, "cannot be made: " + (error ? error.message() : "something else stands there"));
  OpenFolder above(folder_of(folder), FileCalls::system());
  const int trouble = above.open() ? above.flush() : errno;
  if (trouble != 0) throw FileError(folder, "cannot be flushed to the disk: " + write_trouble(trouble));
}

void remove_abandoned_parts(const fs::path& folder) noexcept {
  try {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
      if (!entry->path().filename().string().starts_with(part_prefix)) continue;
      const int fd = ::open(entry->path().c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
      if (fd < 0) continue;
      if (::flock(fd, LOCK_EX | LOCK_NB) == 0) (void)::unlink(entry->path().c_str());
      (void)::close(fd);
    }
  } catch (...) {  // out of memory: they stay
  }
}

}  // namespace eigenpose
