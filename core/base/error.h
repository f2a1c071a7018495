#pragma once

/// The typed failures of Eigenpose. Three channels that are never mixed:
///  - a device, file or user input that fails: one of the exceptions here, whose text says what to do;
///  - an expected result of looking (nothing there, unknown object): an `Outcome` with a reason;
///  - a bug: an assertion.
/// Wrong shapes or options passed by a caller: `std::invalid_argument` showing both values.

#include <filesystem>
#include <stdexcept>
#include <string>

namespace eigenpose {

/// Base of every failure that a person can do something about.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A file that cannot be read, written or understood. Text: "PATH: what: what to do".
class FileError : public Error {
 public:
  FileError(std::filesystem::path file, const std::string& what);
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
};

/// A setting, plan or request that cannot be obeyed. Text starts with where it stands.
class ConfigError : public Error {
 public:
  using Error::Error;
};

/// A device that does not do what it is told. Text: "DEVICE: operation: cause".
class DeviceError : public Error {
 public:
  DeviceError(std::string device, std::string operation, const std::string& cause);
  [[nodiscard]] const std::string& device() const { return device_; }
  [[nodiscard]] const std::string& operation() const { return operation_; }

 private:
  std::string device_;
  std::string operation_;
};

/// The device did not answer or arrive before the deadline.
class DeviceTimeout : public DeviceError {
 public:
  using DeviceError::DeviceError;
};

/// The device is gone (unplugged, connection closed); opening it again may help.
class DeviceLost : public DeviceError {
 public:
  using DeviceError::DeviceError;
};

/// The caller asked for a stop while the work was under way. Not a failure of any device.
class Interrupted : public Error {
 public:
  Interrupted() : Error("interrupted on request") {}
  explicit Interrupted(const std::string& what) : Error(what) {}
};

}  // namespace eigenpose
