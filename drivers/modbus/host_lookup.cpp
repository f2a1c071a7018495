#include "drivers/modbus/host_lookup.h"

#include <array>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <netdb.h>
#include <sys/socket.h>

namespace eigenpose {

namespace {

using AddressList = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;

/// @throws std::runtime_error with the system's words.
AddressList look_up(const std::string& host, int flags) {
  addrinfo wanted{};
  wanted.ai_family = AF_UNSPEC;
  wanted.ai_socktype = SOCK_STREAM;
  wanted.ai_flags = flags;
  addrinfo* found = nullptr;
  const int result = getaddrinfo(host.c_str(), nullptr, &wanted, &found);
  if (result != 0) throw std::runtime_error(gai_strerror(result));
  return {found, &freeaddrinfo};
}

std::vector<std::string> texts_of(const AddressList& list) {
  std::vector<std::string> addresses;
  for (const addrinfo* entry = list.get(); entry != nullptr; entry = entry->ai_next) {
    std::array<char, NI_MAXHOST> text{};
    if (getnameinfo(entry->ai_addr, entry->ai_addrlen, text.data(), text.size(), nullptr, 0,
                    NI_NUMERICHOST) == 0)
      addresses.emplace_back(text.data());
  }
  return addresses;
}

}  // namespace

std::vector<std::string> resolve_by_system(const std::string& host) {
  return texts_of(look_up(host, 0));
}

std::string canonical_host(const std::string& host) {
  const std::string this_machine = "127.0.0.1";
  std::string name = host;
  if (is_numeric_host(host)) {
    const auto texts = texts_of(look_up(host, AI_NUMERICHOST));
    if (!texts.empty()) name = texts.front();
    constexpr std::string_view ipv4_within = "::ffff:";
    if (name.starts_with(ipv4_within) && name.find('.') != std::string::npos)
      name.erase(0, ipv4_within.size());
    return name == "::1" ? this_machine : name;
  }
  for (char& c : name) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  if (name.ends_with('.')) name.pop_back();
  return name == "localhost" ? this_machine : name;
}

bool is_numeric_host(const std::string& host) {
  try {
    (void)look_up(host, AI_NUMERICHOST);
    return true;
  } catch (const std::runtime_error&) {
    return false;
  }
}

struct HostLookup::State {
  std::mutex mutex;
  std::condition_variable ended;
  bool running = false;                ///< guarded by mutex
  std::vector<std::string> addresses;  ///< guarded by mutex: what was found last
  std::string problem;                 ///< guarded by mutex: why nothing was found
};

HostLookup::HostLookup(std::string host, Resolver resolver)
    : host_(std::move(host)), resolver_(std::move(resolver)), state_(std::make_shared<State>()) {
  if (is_numeric_host(host_)) state_->addresses = {host_};
}

void HostLookup::start() {
  {
    const std::lock_guard lock(state_->mutex);
    if (state_->running) return;
    state_->running = true;
  }
  try {
    // Detached, because nothing can end a look-up; it touches only what it shares.
    std::thread([state = state_, host = host_, resolver = resolver_] {
      look_up_for(*state, host, resolver);
    }).detach();
  } catch (const std::exception& error) {
    {
      const std::lock_guard lock(state_->mutex);
      state_->running = false;
    }
    state_->ended.notify_all();
    throw std::runtime_error(fmt::format(
        "the name \"{}\" cannot be looked up: {}; end programs that are not needed, or give the address as "
        "numbers",
        host_, error.what()));
  }
}

void HostLookup::look_up_for(State& state, const std::string& host, const Resolver& resolver) {
  std::vector<std::string> found;
  std::string problem = "it has no address";
  try {
    found = resolver(host);
  } catch (const std::exception& error) {
    problem = error.what();
  }
  {
    const std::lock_guard lock(state.mutex);
    state.running = false;
    if (!found.empty()) state.addresses = std::move(found);
    state.problem = std::move(problem);
  }
  state.ended.notify_all();
}

std::vector<std::string> HostLookup::addresses(Duration patience) {
  {
    const std::lock_guard lock(state_->mutex);
    if (!state_->addresses.empty()) return state_->addresses;
  }
  start();
  std::unique_lock lock(state_->mutex);
  const bool ended = state_->ended.wait_for(lock, patience, [&] { return !state_->running; });
  if (!state_->addresses.empty()) return state_->addresses;
  if (!ended)
    throw std::runtime_error(
        fmt::format("the name \"{}\" was not found in time; see that the name server answers, or give the "
                    "address as numbers",
                    host_));
  throw std::runtime_error(
      fmt::format("the name \"{}\" was not found: {}; is it spelt right?", host_, state_->problem));
}

void HostLookup::refresh() {
  if (is_numeric_host(host_)) return;
  try {
    start();
  } catch (const std::runtime_error&) {
    // What was found before stays; whoever needs more asks again.
  }
}

}  // namespace eigenpose
