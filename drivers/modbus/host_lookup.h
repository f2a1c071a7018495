#pragma once

/// The addresses of a host. The system's name look-up has no deadline: it may wait half a minute for a name
/// server that is away. So it runs on a thread of its own, and whoever needs the addresses waits for it no
/// longer than he has time.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/clock.h"

namespace eigenpose {

/// Numeric addresses of `host`, best first. Blocks. @throws std::runtime_error with the cause in words.
std::vector<std::string> resolve_by_system(const std::string& host);

/// True for "192.168.0.10", "127.1", "::1": what needs no look-up.
bool is_numeric_host(const std::string& host);

/// One spelling of each host, without a look-up: numeric addresses as the system writes them, an IPv4 address
/// within an IPv6 one as IPv4, this machine as 127.0.0.1, names in small letters.
std::string canonical_host(const std::string& host);

/// Thread-safe. Starts no look-up before it is asked for addresses.
class HostLookup {
 public:
  using Resolver = std::function<std::vector<std::string>(const std::string& host)>;

  /// @param resolver what looks the name up, on a thread of its own that may outlive this object.
  explicit HostLookup(std::string host, Resolver resolver = resolve_by_system);

  /// At once when `host` is numeric or was found before, otherwise after `patience` at the latest.
  /// @throws std::runtime_error in words when it is not found, not in time, or cannot be looked up; the next
  /// call asks again.
  [[nodiscard]] std::vector<std::string> addresses(Duration patience);

  /// Looks the name up again, for the next connection. Returns at once; until then what was found stays.
  void refresh();

 private:
  struct State;
  /// Begins a look-up unless one is under way. @throws std::runtime_error when no thread can be started.
  void start();
  /// On the look-up's thread.
  static void look_up_for(State& state, const std::string& host, const Resolver& resolver);

  std::string host_;
  Resolver resolver_;
  std::shared_ptr<State> state_;  ///< shared with the thread that looks up
};

}  // namespace eigenpose
