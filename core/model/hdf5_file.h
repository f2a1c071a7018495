#pragma once

/// The few HDF5 calls a model file needs, each handle with one owner. Everything here throws Hdf5Failure.
///
/// The HDF5 library is not thread-safe: hold an Hdf5Lock while any of these objects live.

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <hdf5.h>

namespace eigenpose {

class Hdf5Failure : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A name whose alphabetical order is the order of the numbers: "000007".
std::string numbered(std::size_t i);

/// Exclusive use of the library, with its own error printing off.
class Hdf5Lock {
 public:
  Hdf5Lock();

 private:
  std::scoped_lock<std::mutex> lock_;
};

/// One HDF5 handle and how to close it.
class Hdf5Handle {
 public:
  using Close = herr_t (*)(hid_t);
  /// @throws Hdf5Failure saying `what` when `id` is negative.
  Hdf5Handle(hid_t id, Close close, const std::string& what);
  Hdf5Handle(Hdf5Handle&& other) noexcept;
  Hdf5Handle& operator=(Hdf5Handle&&) = delete;
  ~Hdf5Handle();
  [[nodiscard]] hid_t get() const { return id_; }

 private:
  hid_t id_;
  Close close_;
};

/// A group: attributes, datasets and groups below it.
class Hdf5Group {
 public:
  explicit Hdf5Group(Hdf5Handle handle) : handle_(std::move(handle)) {}
  [[nodiscard]] hid_t id() const { return handle_.get(); }

  [[nodiscard]] Hdf5Group make_group(const std::string& name) const;
  [[nodiscard]] Hdf5Group open_group(const std::string& name) const;
  /// Names of the groups below, in alphabetical order.
  [[nodiscard]] std::vector<std::string> group_names() const;

  void write(const std::string& attribute, double value) const;
  void write(const std::string& attribute, std::int64_t value) const;
  void write(const std::string& attribute, const std::string& value) const;
  [[nodiscard]] double read_double(const std::string& attribute) const;
  /// @throws Hdf5Failure also for a value that is not in [lower, upper].
  [[nodiscard]] std::int64_t read_integer(const std::string& attribute, std::int64_t lower,
                                          std::int64_t upper) const;
  [[nodiscard]] bool read_bool(const std::string& attribute) const {
    return read_integer(attribute, 0, 1) != 0;
  }
  [[nodiscard]] std::string read_text(const std::string& attribute) const;
  [[nodiscard]] bool has_attribute(const std::string& name) const;

  /// Datasets. A matrix is stored column after column, as rows of a file dataset: its shape there is cols ×
  /// rows. Reading refuses a dataset that claims more bytes than the file has, or whose values stand in other
  /// files.
  void write(const std::string& dataset, const Eigen::MatrixXf& matrix) const;
  void write(const std::string& dataset, const Eigen::MatrixXd& matrix) const;
  void write(const std::string& dataset, const std::vector<std::int8_t>& bytes) const;
  void write(const std::string& dataset, std::span<const std::uint8_t> bytes) const;
  [[nodiscard]] std::vector<std::int8_t> read_bytes(const std::string& dataset) const;
  /// Exactly as many bytes as there are.
  void read_bytes(const std::string& dataset, std::span<std::uint8_t> bytes) const;
  /// A group or dataset of this name stands below.
  [[nodiscard]] bool has(const std::string& name) const;
  [[nodiscard]] Eigen::MatrixXf read_floats(const std::string& dataset) const;
  [[nodiscard]] Eigen::MatrixXd read_doubles(const std::string& dataset) const;

 private:
  Hdf5Handle handle_;
};

/// True if a handle could not be closed since this was last asked. Under the lock.
bool take_close_failure();

/// Opens a file to read it. Takes no lock on it: our files are replaced, never changed. To write one:
/// hdf5_output.h.
Hdf5Handle open_hdf5(const std::filesystem::path& path);
Hdf5Group root_of(const Hdf5Handle& file);

}  // namespace eigenpose
