#pragma once

/// How the file descriptors of the process are shared out, so that clients never take those of devices.

#include <cstdint>

namespace eigenpose {

/// Devices and files come first, then the operator's socket, then readers.
struct DescriptorBudget {
  int limit = 0;       ///< the process's, RLIMIT_NOFILE
  int commanders = 0;  ///< connections on control.sock
  int readers = 0;     ///< connections on results.sock
};

/// Shares out `limit` descriptors. @param wanted connections on each socket, ≥ 1.
/// @throws ConfigError when too few are left for a few clients beside the devices.
DescriptorBudget share_descriptors(int limit, int wanted);

/// Raises the process's soft limit to 4096, or to the hard limit if that is lower. @return the limit now.
int raise_descriptor_limit();

}  // namespace eigenpose
