#pragma once

/// Who gets a place on a socket that has a limited number of them.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include <sys/types.h>

namespace eigenpose {

/// A place that is taken.
struct Place {
  enum class Use {
    idle,       ///< waits for a request
    streaming,  ///< an event stream
    busy,       ///< a request is being read or answered
  };
  uid_t user = 0;
  Use use = Use::idle;
  std::uint64_t since = 0;  ///< of its last activity; smaller is longer ago
};

struct Admission {
  bool admitted = false;
  std::optional<std::size_t> evicted;  ///< index of the connection that is closed to admit the newcomer
};

/// Decides whether a newcomer of `user` gets one of `most` places.
///
/// While there is room, everybody does. When there is none, the user who has the most places gives one of
/// them to a user who has at least two fewer: the longest idle one, or if none is idle the quietest stream. A
/// user with a full share gives up a connection of its own that is idle. Whoever is busy is never disturbed.
Admission admit(std::span<const Place> places, std::size_t most, uid_t user);

/// A function that decides as `admit` does.
using AdmissionPolicy = std::function<Admission(std::span<const Place>, std::size_t most, uid_t user)>;

}  // namespace eigenpose
