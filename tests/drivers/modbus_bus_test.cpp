// The Modbus bus against other ends that no drive should be: one that sends without end, a name server that
// never answers, an adapter that hears itself, a line that others keep busy.

#include "drivers/modbus/modbus_bus.h"

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "config/modbus_profile.h"
#include "core/base/error.h"
#include "drivers/modbus/endpoint.h"
#include "tests/drivers/modbus_rig.h"

namespace eigenpose {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

constexpr ModbusCaller table{.device = "table", .operation = "read state", .unit = 1};
constexpr ModbusCaller table_stop{.device = "table", .operation = "stop", .unit = 1, .urgent = true};

TimePoint in(Duration time) {
  return std::chrono::steady_clock::now() + time;
}

template <class Failure = DeviceError, class Work>
std::string failure_of(const Work& work) {
  try {
    work();
  } catch (const Failure& error) {
    return error.what();
  }
  return "no failure";
}

/// Takes connections on the loopback interface, one after the other, and does with each what the test says.
class Peer {
 public:
  /// @param serve is called again and again while the connection stands. @return false to close it.
  explicit Peer(std::function<bool(int)> serve) : serve_(std::move(serve)) {
    listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), length), 0);
    EXPECT_EQ(::listen(listener_, 16), 0);
    EXPECT_EQ(::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &length), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;
  ~Peer() {
    thread_.request_stop();
    thread_.join();
    ::close(listener_);
  }
  [[nodiscard]] ModbusBusOptions options() const {
    ModbusBusOptions options;
    options.endpoint = ModbusTcpEndpoint{"127.0.0.1", port_};
    options.response_timeout = 100ms;
    options.retry_pause = 1ms;
    return options;
  }

 private:
  void run(const std::stop_token& stop) const {
    while (!stop.stop_requested()) {
      pollfd waiting{listener_, POLLIN, 0};
      if (::poll(&waiting, 1, 5) <= 0) continue;
      const int connection = ::accept(listener_, nullptr, nullptr);
      while (!stop.stop_requested() && serve_(connection)) {
      }
      ::close(connection);
    }
  }

  std::function<bool(int)> serve_;
  int listener_ = -1;
  int port_ = 0;
  std::jthread thread_;
};

/// Sends as fast as the connection takes it, and never reads.
bool flood(int connection) {
  static const std::string bytes(4096, '\x01');
  pollfd line{connection, POLLOUT, 0};
  if (::poll(&line, 1, 5) <= 0) return true;
  const ssize_t sent = ::send(connection, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  return sent > 0 || errno == EAGAIN;
}

bool stay_silent(int connection) {
  pollfd line{connection, POLLIN, 0};
  ::poll(&line, 1, 5);
  char rubbish[256];
  return ::recv(connection, rubbish, sizeof rubbish, MSG_DONTWAIT) != 0;
}

TEST(ModbusBusAgainstAFlood, ATransactionEndsAfterItsAttempts) {
  const Peer peer(flood);
  const SteadyClock clock;
  ModbusBus bus(peer.options(), clock);
  EXPECT_THAT(failure_of([&] { bus.read(table, 0x7F, 2, in(60s)); }), HasSubstr("tried 3 times"));
  EXPECT_EQ(bus.statistics().failures, 3U);
}

TEST(ModbusBusAgainstAFlood, AMoveAndItsStopEndWithAFailure) {
  const Peer peer(flood);
  const SteadyClock clock;
  const auto bus = std::make_shared<ModbusBus>(peer.options(), clock);
  ModbusAxisOptions options;
  ModbusAxis axis(oriental_motor_az_profile(), options, bus, clock);
  EXPECT_THROW(axis.move_to(30.0, in(60s), {}), DeviceError);
  EXPECT_THROW(axis.home(in(60s), {}), DeviceError);
  EXPECT_THROW(axis.stop_motion(), DeviceError);
}

TEST(ModbusBusRetries, AsManyAttemptsAsAreAllowedAndNotOneMore) {
  const Peer peer(stay_silent);
  const SteadyClock clock;
  for (const int attempts : {1, 2, 5}) {
    ModbusBusOptions options = peer.options();
    options.attempts = attempts;
    options.response_timeout = 10ms;
    ModbusBus bus(options, clock);
    EXPECT_THROW(bus.read(table, 0x7F, 2, in(60s)), DeviceTimeout);
    EXPECT_EQ(bus.statistics().failures, static_cast<std::uint64_t>(attempts));
    EXPECT_EQ(bus.statistics().connections, static_cast<std::uint64_t>(attempts));
    ModbusCaller once = table;
    once.once = true;
    EXPECT_THROW(bus.read(once, 0x7F, 2, in(60s)), DeviceTimeout);
    EXPECT_EQ(bus.statistics().failures, static_cast<std::uint64_t>(attempts) + 1);
  }
}

TEST(ModbusBusDeadline, HoldsWhileAnotherDeviceKeepsTheLineBusy) {
  std::atomic<bool> release{false};
  const Peer peer([&](int connection) { return !release && stay_silent(connection); });
  const SteadyClock clock;
  ModbusBusOptions options = peer.options();
  options.response_timeout = 10s;
  options.attempts = 1;
  ModbusBus bus(options, clock);
  std::atomic<bool> ended{false};
  std::jthread other([&] {
    EXPECT_THROW(bus.read(table, 0x7F, 2, in(60s)), DeviceError);
    ended = true;
  });
  while (bus.statistics().connections == 0) std::this_thread::yield();
  for (const ModbusCaller& caller : {table, table_stop})
    EXPECT_THAT(failure_of<DeviceTimeout>([&] { bus.read(caller, 0x7F, 2, in(20ms)); }),
                HasSubstr("other devices on the line"));
  EXPECT_FALSE(ended) << "waited for the other";
  release = true;
}

/// A name server that answers when the test lets it.
class NameServer {
 public:
  ~NameServer() { answer({}); }
  HostLookup::Resolver resolver() {
    return [state = state_](const std::string&) {
      std::unique_lock lock(state->mutex);
      ++state->asked;
      state->changed.wait(lock, [&] { return state->answers; });
      return state->addresses;
    };
  }
  void answer(std::vector<std::string> addresses) {
    const std::lock_guard lock(state_->mutex);
    state_->answers = true;
    state_->addresses = std::move(addresses);
    state_->changed.notify_all();
  }
  int asked() {
    const std::lock_guard lock(state_->mutex);
    return state_->asked;
  }

 private:
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    bool answers = false;
    int asked = 0;
    std::vector<std::string> addresses;
  };
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

/// A resolver that cannot be handed to a thread as long as there is none to be had.
struct ThreadlessResolver {
  explicit ThreadlessResolver(std::shared_ptr<bool> flag) : no_thread(std::move(flag)) {}
  ThreadlessResolver(const ThreadlessResolver& other) : no_thread(other.no_thread) {
    if (*no_thread) throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again));
  }
  ThreadlessResolver& operator=(const ThreadlessResolver&) = delete;
  ~ThreadlessResolver() = default;
  std::vector<std::string> operator()(const std::string&) const { return {"192.0.2.1"}; }
  std::shared_ptr<bool> no_thread;
};

TEST(HostLookup, WithoutAThreadSaysSoAndLooksUpAgainOnceThereIsOne) {
  const auto no_thread = std::make_shared<bool>(false);
  HostLookup lookup("drives.lab", ThreadlessResolver(no_thread));
  *no_thread = true;
  for (int attempt = 0; attempt < 2; ++attempt)
    EXPECT_THAT(failure_of<std::runtime_error>([&] { (void)lookup.addresses(20s); }),
                AllOf(HasSubstr("\"drives.lab\" cannot be looked up"), HasSubstr("unavailable")));
  EXPECT_NO_THROW(lookup.refresh());
  *no_thread = false;
  EXPECT_THAT(lookup.addresses(20s), testing::ElementsAre("192.0.2.1"));
}

TEST(ModbusBusNameLookup, IsWaitedForUntilTheDeadlineAndByAStopNotAtAll) {
  NameServer names;
  const SteadyClock clock;
  ModbusBusOptions options;
  options.endpoint = ModbusTcpEndpoint{"drives.lab", 502};
  options.response_timeout = 10s;
  options.attempts = 1;
  options.resolve = names.resolver();
  ModbusBus bus(options, clock);
  EXPECT_THAT(failure_of<DeviceLost>([&] { bus.read(table, 0x7F, 2, in(30ms)); }),
              AllOf(HasSubstr("\"drives.lab\" was not found in time"), HasSubstr("as numbers")));
  // Ten seconds of patience would show as the test's own time limit.
  for (int i = 0; i < 50; ++i) EXPECT_THROW(bus.read(table_stop, 0x7F, 2, in(10s)), DeviceLost);
  EXPECT_EQ(names.asked(), 1) << "one look-up at a time";
}

TEST(ModbusBusNameLookup, IsDoneOnceAndKeptForReconnecting) {
  NameServer names;
  const SteadyClock clock;
  sim::SimLab lab(clock);
  sim::SimModbusServer server(lab, {});
  ModbusBusOptions options;
  options.endpoint = ModbusTcpEndpoint{"drives.lab", server.port()};
  options.resolve = names.resolver();
  ModbusBus bus(options, clock);
  names.answer({"127.0.0.1"});
  EXPECT_NO_THROW(bus.read(table, 0x7F, 1, in(20s)));
  server.faults().add({sim::WireFaultKind::close_connection});
  EXPECT_NO_THROW(bus.read(table, 0x7F, 1, in(20s)));
  EXPECT_EQ(bus.statistics().connections, 2U);
  EXPECT_EQ(names.asked(), 1);
}

TEST(ModbusBusNameLookup, TriesEachAddressOfAName) {
  NameServer names;
  const SteadyClock clock;
  sim::SimLab lab(clock);
  sim::SimModbusServer server(lab, {});
  ModbusBusOptions options;
  options.endpoint = ModbusTcpEndpoint{"drives.lab", server.port()};
  options.resolve = names.resolver();
  ModbusBus bus(options, clock);
  names.answer({"::1", "127.0.0.1"});  // nobody serves at the first
  EXPECT_NO_THROW(bus.read(table, 0x7F, 1, in(20s)));
}

TEST(ModbusBusNameLookup, ANameThatDoesNotExistIsSaid) {
  NameServer names;
  const SteadyClock clock;
  ModbusBusOptions options;
  options.endpoint = ModbusTcpEndpoint{"drvies.lab", 502};
  options.resolve = [](const std::string&) -> std::vector<std::string> {
    throw std::runtime_error("Name or service not known");
  };
  ModbusBus bus(options, clock);
  EXPECT_THAT(
      failure_of<DeviceLost>([&] { bus.read(table, 0x7F, 1, in(20s)); }),
      AllOf(HasSubstr("\"drvies.lab\" was not found: Name or service not known"), HasSubstr("spelt right")));
}

TEST(CanonicalHost, HasOneSpelling) {
  for (const char* spelling :
       {"127.0.0.1", "127.1", "::1", "::ffff:127.0.0.1", "localhost", "LOCALHOST", "localhost.", "0x7f.1"})
    EXPECT_EQ(canonical_host(spelling), "127.0.0.1") << spelling;
  EXPECT_EQ(canonical_host("Gateway.Lab."), "gateway.lab");
  EXPECT_EQ(canonical_host("2001:DB8::0:1"), "2001:db8::1");
  EXPECT_NE(canonical_host("127.0.0.2"), canonical_host("127.0.0.1")) << "another server may listen there";
}

TEST(ModbusEndpoint, IsReadAsItIsWritten) {
  const auto tcp = std::get<ModbusTcpEndpoint>(parse_modbus_endpoint("tcp://[fe80::1%eth0]:1502"));
  EXPECT_EQ(tcp.host, "fe80::1%eth0");
  EXPECT_EQ(tcp.port, 1502);
  EXPECT_EQ(std::get<ModbusTcpEndpoint>(parse_modbus_endpoint("tcp://drives.lab")).port, 502);
  const SerialDefaults defaults{.baud = 9600, .parity = 'O', .stop_bits = 2, .silent_interval = 5ms};
  const auto plain = std::get<ModbusRtuEndpoint>(parse_modbus_endpoint("rtu:/dev/ttyS0", defaults));
  EXPECT_EQ(plain.baud, 9600);
  EXPECT_EQ(plain.parity, 'O');
  EXPECT_EQ(plain.stop_bits, 2);
  EXPECT_EQ(plain.silent_interval, Duration(5ms));
  const auto full = std::get<ModbusRtuEndpoint>(parse_modbus_endpoint(
      "rtu:/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0:19200:8N2", defaults));
  EXPECT_EQ(full.device, "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0");
  EXPECT_EQ(full.baud, 19200);
  EXPECT_EQ(full.parity, 'N');
  EXPECT_EQ(full.stop_bits, 2);
}

TEST(ModbusEndpoint, WhatCannotBeIsRefused) {
  for (const char* text : {"",
                           "10.0.0.1",
                           "http://10.0.0.1",
                           "tcp://",
                           "tcp://:502",
                           "tcp://10.0.0.1:",
                           "tcp://10.0.0.1:0",
                           "tcp://10.0.0.1:-1",
                           "tcp://10.0.0.1:65536",
                           "tcp://10.0.0.1:99999999999",
                           "tcp://10.0.0.1:502/",
                           "tcp://10.0.0.1/",
                           "tcp://10.0.0.1/drive",
                           "tcp://a b",
                           "tcp://user@10.0.0.1",
                           "tcp://10.0.0.1?x",
                           "tcp://[::1",
                           "tcp://[::1]502",
                           "tcp://[]:502",
                           "tcp://10.0.0.1:502:1",
                           "rtu:",
                           "rtu:ttyUSB0",
                           "rtu:/dev/ttyS0:0:8E1",
                           "rtu:/dev/ttyS0:12345",
                           "rtu:/dev/ttyS0:115200000:8N1",
                           "rtu:/dev/ttyS0:8E1"})
    EXPECT_THROW((void)parse_modbus_endpoint(text), std::invalid_argument) << text;
}

TEST(ModbusLineName, IsTheSameForEverySpellingOfOneLine) {
  const auto name = [](const std::string& text) { return line_name(parse_modbus_endpoint(text)); };
  EXPECT_EQ(name("tcp://127.0.0.1"), "tcp 127.0.0.1:502");
  EXPECT_EQ(name("tcp://LocalHost:502"), name("tcp://127.1"));
  EXPECT_NE(name("tcp://127.0.0.1:503"), name("tcp://127.0.0.1"));
  test::TemporaryFolder folder;
  const std::string link = (folder.path() / "by-id").string();
  std::filesystem::create_symlink("/dev/null", link);
  EXPECT_EQ(name("rtu:" + link + ":9600:8N1"), name("rtu:/dev/null:115200"));
  EXPECT_NE(name("rtu:/dev/ttyS0"), name("rtu:/dev/ttyS1"));
}

class ModbusOnAnEchoingLine : public testing::Test {
 protected:
  ModbusOnAnEchoingLine() { rig_.set_echo(true); }
  ModbusRig rig_{ModbusLine::rtu, 0.0, 300ms};
};

TEST_F(ModbusOnAnEchoingLine, AnAxisIsReadHomedAndMovedAsOnAnyOther) {
  EXPECT_NO_THROW(rig_.axis().state(in(60s)));
  rig_.axis().home(in(60s), {});
  EXPECT_NEAR(rig_.axis().move_to(40.0, in(60s), {}), 40.0, 0.05);
  EXPECT_NEAR(rig_.true_position(), 40.0, 0.05);
  EXPECT_EQ(rig_.bus()->statistics().failures, 0U);
}

TEST_F(ModbusOnAnEchoingLine, TheEchoOfAWriteIsNotItsConfirmation) {
  // The first transaction of all: nothing is known of the line yet.
  const std::vector<std::uint16_t> stop = {0x20};
  const auto write = [&](int attempts) {
    SteadyClock clock;
    ModbusCaller caller = table;
    caller.once = attempts == 1;
    rig_.bus()->write(caller, 0x007D, stop, in(60s));
  };
  EXPECT_NO_THROW(write(4));
  rig_.faults().add({sim::WireFaultKind::loss});
  EXPECT_THROW(write(1), DeviceTimeout) << "nobody but the adapter has heard it";
}

TEST(ModbusOnASerialLine, AStopGoesOutToADriveThatCannotBeHeard) {
  ModbusRig rig(ModbusLine::rtu, 0.0);
  rig.turn_steadily(3.0);
  while (!rig.truly_moving()) std::this_thread::yield();
  rig.faults().at_random(1.0, 1, {{sim::WireFaultKind::silence}});  // it hears all, and nobody hears it
  EXPECT_THROW(rig.axis().stop_motion(), DeviceError);
  while (rig.truly_moving()) std::this_thread::yield();
}

TEST(ModbusOnASerialLine, ASilentIntervalLiesBetweenTwoFrames) {
  struct Case {
    int baud;
    Duration wanted;  ///< by the drive's profile
    Duration least;   ///< the greater of that and of 3.5 characters of 11 bits, 1.75 ms above 19200 baud
  };
  for (const Case& line : {Case{1200, 0ms, 32ms}, Case{1200, 10ms, 32ms}, Case{1200, 60ms, 60ms},
                           Case{115200, 0ms, 1750us}, Case{115200, 100ms, 100ms}}) {
    ModbusRig rig(ModbusLine::rtu, 0.0);
    rig.discard_axis();
    rig.hang_up();
    const SteadyClock clock;
    ModbusBusOptions options;
    options.endpoint =
        ModbusRtuEndpoint{.device = rig.line(), .baud = line.baud, .silent_interval = line.wanted};
    options.response_timeout = 10s;
    ModbusBus bus(options, clock);
    // No wait is ever cut short, whatever the machine does meanwhile; a line without the interval takes a
    // millisecond a frame.
    constexpr int frames = 5;
    const TimePoint start = clock.now();
    for (int i = 0; i < frames; ++i) (void)bus.read(table, 0x7F, 1, in(60s));
    EXPECT_GE(clock.now() - start, (frames - 1) * line.least) << line.baud << " baud";
  }
}

TEST_F(ModbusOnAnEchoingLine, ASilentDriveIsStillASilentDrive) {
  rig_.silence(true);
  EXPECT_THAT(failure_of<DeviceTimeout>([&] { rig_.axis().state(in(60s)); }), HasSubstr("no answer"));
}

}  // namespace
}  // namespace eigenpose
