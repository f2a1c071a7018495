#include "core/base/error.h"

#include "core/base/printable.h"

namespace eigenpose {

FileError::FileError(std::filesystem::path file, const std::string& what)
    : Error(printable(file.string()) + ": " + what), file_(std::move(file)) {}

DeviceError::DeviceError(std::string device, std::string operation, const std::string& cause)
    : Error(device + ": " + operation + ": " + cause),
      device_(std::move(device)),
      operation_(std::move(operation)) {}

}  // namespace eigenpose
