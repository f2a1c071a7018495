#pragma once

/// Addresses of Unix sockets, and whether anybody listens there.

#include <filesystem>

#include <sys/un.h>

namespace eigenpose {

/// @throws FileError when the path is longer than a Unix socket allows (107 bytes).
sockaddr_un local_address(const std::filesystem::path& socket);

/// Whether a program listens there, also one that does not let this user in.
/// @throws FileError as `local_address` does, and when the system has no socket to try with.
bool is_answered(const std::filesystem::path& socket);

}  // namespace eigenpose
