#pragma once

/// Writing an HDF5 file through our own writer.

#include <cstdint>
#include <functional>

#include "core/base/atomic_file.h"
#include "core/model/hdf5_file.h"

namespace eigenpose {

/// Writes an HDF5 file into `file`, whose first `user_block` bytes (0, 512, 1024, …) are left to the caller.
/// `content` fills the root group; nothing of the file stays in the library's hands when this returns or
/// throws. `file` is not committed.
///
/// The library writes through a driver of ours that reports no failure to it: HDF5 cannot close a file whose
/// disk is full, and stumbles over it when the program ends. The driver keeps the first failure, and this
/// call throws it. Takes the Hdf5Lock. @throws FileError naming the target; what `content` throws, unless it
/// is an Hdf5Failure.
void write_hdf5(AtomicFile& file, std::uint64_t user_block,
                const std::function<void(const Hdf5Group& root)>& content);

}  // namespace eigenpose
