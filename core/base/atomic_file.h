#pragma once

/// Writing files. Every file of Eigenpose is written here, so that a reader, a crash or a full disk never
/// meets half of one, and a file that stands there is lost only to one that is whole.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include <sys/types.h>

namespace eigenpose {

/// The system calls that writing takes, each as POSIX defines it (result and errno). Tests put failures in
/// their place. Thread-safe.
class FileCalls {
 public:
  virtual ~FileCalls() = default;
  virtual int open(const char* path, int flags, mode_t mode);
  virtual ssize_t pwrite(int fd, const void* bytes, std::size_t count, off_t at);
  virtual int ftruncate(int fd, off_t size);
  virtual int fsync(int fd);
  virtual int close(int fd);
  virtual int rename(const char* from, const char* to);

  /// The calls themselves.
  static FileCalls& system();
};

/// A file under construction beside its target. `commit` makes it durable and renames it over the target;
/// without `commit` the destructor removes it, and the target stays as it was.
///
/// A target that is a symbolic link stays one: the file that it names is replaced. A target that stands there
/// and is no plain file (a device, a pipe, a folder) is refused. The part file is locked (flock) while this
/// object lives; those of programs that were killed are removed by `remove_abandoned_parts`. One thread at a
/// time.
class AtomicFile {
 public:
  /// Makes the part file. @param calls outlives this object.
  /// @throws FileError: the folder is missing or not writable, or the target is no plain file.
  explicit AtomicFile(std::filesystem::path target, FileCalls& calls = FileCalls::system());
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  ~AtomicFile();

  [[nodiscard]] const std::filesystem::path& target() const { return target_; }
  /// Where the file stands until `commit`.
  [[nodiscard]] const std::filesystem::path& part() const { return part_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }

  /// Writes at the end. @throws FileError.
  void write(std::string_view bytes) { write_at(size_, bytes); }
  /// Writes anywhere; bytes between the former end and `at` become 0. @throws FileError.
  void write_at(std::uint64_t at, std::string_view bytes);
  /// Cuts the file off, or appends zeros. @throws FileError.
  void resize(std::uint64_t size);
  /// Reads back what was written. @return how many bytes, fewer only at the end. @throws FileError.
  std::size_t read_at(std::uint64_t at, std::span<std::uint8_t> bytes) const;

  /// Reads the part file as its later readers will, and throws where it is not good.
  using Verify = std::function<void(const std::filesystem::path& part)>;
  /// fsync of the file, then `verify`: what can fail is done, and `commit` only renames. For several files
  /// that replace former ones together. At most once; nothing is written afterwards.
  /// @throws FileError naming the target; what `verify` throws is reworded so, unless it is no Error.
  void prepare(const Verify& verify = {});
  /// `prepare` unless that was done, then close, rename to `staged_name`, fsync of the folder: the file
  /// survives a crash before `commit`, and the target is as it was. The destructor leaves a staged file. For
  /// a file that replaces its target together with another file: stage this one, replace the other one,
  /// commit this one; after a crash the other one decides which of target and staged file is meant. At most
  /// once.
  /// @throws FileError naming the target.
  void stage();
  /// Where a file for `target` stands between `stage` and `commit`: beside what a symbolic link names.
  /// @throws FileError where the target is no plain file.
  [[nodiscard]] static std::filesystem::path staged_name(const std::filesystem::path& target);
  /// `prepare` unless that was done, then close, rename, fsync of the folder. At most once.
  /// @throws FileError naming the target, as `prepare`. The target is then as it was, unless the folder's
  /// fsync failed: the message says so. A staged file stays staged.
  void commit(const Verify& verify = {});
  /// Close and rename alone, for many files that are flushed together afterwards (flush_file_system): until
  /// then a failing power supply may leave the file empty. At most once. @throws FileError.
  void commit_unflushed();

 private:
  [[nodiscard]] bool make_part(const std::filesystem::path& folder, unsigned serial);
  void sync();
  void rename_part(const std::filesystem::path& name);
  void rename_part_durably(const std::filesystem::path& name);
  [[noreturn]] void fail(const char* operation, int error) const;

  FileCalls& calls_;
  std::filesystem::path target_;
  std::filesystem::path part_;
  int fd_ = -1;
  std::uint64_t size_ = 0;
  bool prepared_ = false;
  bool renamed_ = false;  ///< staged or committed: the destructor removes nothing
};

/// The whole of `bytes` becomes the content of `target`, or nothing changes. @throws FileError.
void write_file_atomically(const std::filesystem::path& target, std::string_view bytes,
                           FileCalls& calls = FileCalls::system());

/// The same, not yet flushed to the disk: see AtomicFile::commit_unflushed. @throws FileError.
void write_file_unflushed(const std::filesystem::path& target, std::string_view bytes);

/// Flushes the file system that `folder` stands on. @throws FileError, also for what could not be written
/// before.
void flush_file_system(const std::filesystem::path& folder);

/// Makes `folder` and those above it where they are missing, and flushes them to the disk. @throws FileError.
void make_folders(const std::filesystem::path& folder);

/// Removes part files in `folder` that no running program is writing. Does nothing where it may not.
void remove_abandoned_parts(const std::filesystem::path& folder) noexcept;

/// What `error` (an errno) of a write means to a person: "the disk is full; make room and try again", or the
/// system's text.
std::string write_trouble(int error);

}  // namespace eigenpose
