#include "drivers/modbus/connection.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <thread>

#include <fmt/format.h>
#include <netdb.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

namespace eigenpose {

namespace {

constexpr std::uint8_t read_holding_registers = 0x03;
constexpr std::uint8_t write_single_register = 0x06;
constexpr std::uint8_t write_multiple_registers = 0x10;
constexpr std::uint8_t exception_flag = 0x80;
constexpr int mbap_length = 7;  ///< transaction, protocol, length, unit
/// More than late answers ever are. What still comes in then comes without end, and is left to the checks of
/// the answer.
constexpr std::size_t most_stale_bytes = 16 * MODBUS_TCP_MAX_ADU_LENGTH;

std::uint8_t high(int value) {
  return static_cast<std::uint8_t>(value >> 8);
}
std::uint8_t low(int value) {
  return static_cast<std::uint8_t>(value);
}

std::string exception_words(int code) {
  static constexpr std::array<std::string_view, 12> words = {
      "",
      "illegal function: the device does not know this request",
      "illegal address: the device has no such register; is the profile the right one?",
      "illegal value: the device does not take this number",
      "device failure: it cannot do that now",
      "acknowledged, still working",
      "busy",
      "not acknowledged",
      "memory parity error in the device",
      "",
      "gateway: no path to the device",
      "gateway: the device behind it does not answer; check the unit number and the device's power"};
  const std::string_view text =
      code > 0 && code < static_cast<int>(words.size()) ? words[static_cast<std::size_t>(code)] : "";
  return fmt::format("refused with exception {:#04x}{}{}", code, text.empty() ? "" : ": ", text);
}

void set_timeout(modbus_t* context, Duration timeout) {
  const auto us =
      std::max<std::int64_t>(1, std::chrono::duration_cast<std::chrono::microseconds>(timeout).count());
  modbus_set_response_timeout(context, static_cast<std::uint32_t>(us / 1'000'000),
                              static_cast<std::uint32_t>(us % 1'000'000));
  // Zero: the whole answer, not each byte of it, has to come within the response timeout.
  modbus_set_byte_timeout(context, 0, 0);
}

[[noreturn]] void fail_with_errno(int error) {
  switch (error) {
    case ETIMEDOUT:
      throw ModbusFailure{ModbusFault::no_answer, "no answer"};
    case EMBBADCRC:
      throw ModbusFailure{ModbusFault::damaged, "answer with a wrong checksum"};
    case EMBBADDATA:
    case EMBBADEXC:
    case EMBUNKEXC:
    case EMBMDATA:
      throw ModbusFailure{ModbusFault::damaged, "answer that is not Modbus"};
    case EMBBADSLAVE:
      throw ModbusFailure{ModbusFault::damaged, "answer from another unit"};
    default:
      throw ModbusFailure{ModbusFault::no_connection, modbus_strerror(error)};
  }
}

std::string connect_advice(int error, bool serial) {
  std::string text = modbus_strerror(error);
  if (serial) {
    if (error == ENOENT) return text + ": is the adapter plugged in?";
    if (error == EACCES) return text + ": may this user open it (group dialout)?";
    return text;
  }
  if (error == ECONNREFUSED)
    return text + ": nothing listens there; is the drive or its gateway on, and the port right?";
  if (error == ETIMEDOUT || error == EINPROGRESS || error == EHOSTUNREACH || error == ENETUNREACH)
    return text + ": is the cable in and the address right?";
  return text;
}

Duration silent_interval_of(const ModbusRtuEndpoint& rtu) {
  // 3.5 characters of 11 bits; above 19200 baud the protocol fixes 1.75 ms (Modbus over serial
  // line, 2.5.1.1).
  const auto characters = std::chrono::nanoseconds(static_cast<std::int64_t>(3.5 * 11.0 * 1e9 / rtu.baud));
  const Duration protocol = rtu.baud > 19200 ? std::chrono::microseconds(1750) : Duration(characters);
  return std::max(protocol, rtu.silent_interval);
}

}  // namespace

ModbusBus::Connection::Connection(const std::string& address, int port, Duration timeout)
    : context_(modbus_new_tcp_pi(address.c_str(), std::to_string(port).c_str())) {
  connect(timeout);
}

ModbusBus::Connection::Connection(const ModbusRtuEndpoint& line, Duration timeout)
    : context_(modbus_new_rtu(line.device.c_str(), line.baud, line.parity, 8, line.stop_bits)),
      serial_(true),
      silent_interval_(silent_interval_of(line)) {
  connect(timeout);
  // Two masters on one line would also read each other's answers. The lock goes with the open port: a port
  // that was unplugged is nobody's.
  if (flock(modbus_get_socket(context_), LOCK_EX | LOCK_NB) != 0) {
    modbus_close(context_);
    modbus_free(context_);
    throw ModbusFailure{ModbusFault::held, std::string(held_by_another)};
  }
}

void ModbusBus::Connection::connect(Duration timeout) {
  if (context_ == nullptr) throw ModbusFailure{ModbusFault::no_connection, modbus_strerror(errno)};
  modbus_set_error_recovery(context_, MODBUS_ERROR_RECOVERY_NONE);
  set_timeout(context_, timeout);
  if (modbus_connect(context_) == 0) return;
  const int error = errno;
  modbus_free(context_);
  throw ModbusFailure{ModbusFault::no_connection, connect_advice(error, serial_)};
}

ModbusBus::Connection::~Connection() {
  modbus_close(context_);
  modbus_free(context_);
}

std::string ModbusBus::Connection::far_end() const {
  const int descriptor = modbus_get_socket(context_);
  sockaddr_storage address{};
  socklen_t length = sizeof address;
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  if (getpeername(descriptor, generic, &length) != 0) fail_with_errno(errno);
  std::array<char, NI_MAXHOST> host{};
  std::array<char, NI_MAXSERV> port{};
  if (getnameinfo(generic, length, host.data(), host.size(), port.data(), port.size(),
                  NI_NUMERICHOST | NI_NUMERICSERV) != 0)
    throw ModbusFailure{ModbusFault::no_connection, "the other end has no address"};
  return fmt::format("tcp {}:{}", host.data(), port.data());
}

void ModbusBus::Connection::drain(Duration silence, Duration limit) {
  const auto end = std::chrono::steady_clock::now() + limit;
  pollfd line{modbus_get_socket(context_), POLLIN, 0};
  for (;;) {
    const auto now = std::chrono::steady_clock::now();
    const auto wait = std::min<Duration>(silence, end - now);
    const auto wait_ms = std::chrono::ceil<std::chrono::milliseconds>(wait).count();
    if (wait_ms <= 0 || poll(&line, 1, static_cast<int>(wait_ms)) <= 0) return;
    std::array<std::uint8_t, 512> rubbish{};
    const ssize_t got = ::read(line.fd, rubbish.data(), rubbish.size());
    if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) return;
  }
}

void ModbusBus::Connection::wait_for_silent_interval() {
  std::this_thread::sleep_until(last_frame_ + silent_interval_);
}

void ModbusBus::Connection::send_tcp(int unit, std::span<const std::uint8_t> request) {
  // libmodbus numbers only the requests it builds itself; sent raw they would all be number 0, and an answer
  // that comes twice would pass for the next one.
  ++transaction_;
  std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> frame{};
  const int length = static_cast<int>(request.size()) + 1;
  frame[0] = high(transaction_);
  frame[1] = low(transaction_);
  frame[4] = high(length);
  frame[5] = low(length);
  frame[6] = low(unit);
  std::copy(request.begin(), request.end(), frame.begin() + mbap_length);
  const std::size_t total = request.size() + mbap_length;
  const ssize_t sent = send(modbus_get_socket(context_), frame.data(), total, MSG_NOSIGNAL | MSG_DONTWAIT);
  if (sent < 0) fail_with_errno(errno);
  if (static_cast<std::size_t>(sent) != total)
    throw ModbusFailure{ModbusFault::no_connection, "the connection takes no more data"};
}

void ModbusBus::Connection::discard_stale_input() {
  if (serial_) {
    tcflush(modbus_get_socket(context_), TCIFLUSH);
    return;
  }
  std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> stale{};
  for (std::size_t discarded = 0; discarded < most_stale_bytes;) {
    const ssize_t got = recv(modbus_get_socket(context_), stale.data(), stale.size(), MSG_DONTWAIT);
    if (got <= 0) return;
    discarded += static_cast<std::size_t>(got);
  }
}

void ModbusBus::Connection::receive_serial(rtu::Answer& answer,
                                           std::chrono::steady_clock::time_point deadline) {
  std::array<std::uint8_t, MODBUS_RTU_MAX_ADU_LENGTH> buffer{};
  while (answer.missing() > 0) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    pollfd line{modbus_get_socket(context_), POLLIN, 0};
    const int ready = left.count() > 0 ? poll(&line, 1, static_cast<int>(left.count())) : 0;
    if (ready == 0) fail_with_errno(ETIMEDOUT);
    const ssize_t got =
        ready < 0 ? -1 : ::read(line.fd, buffer.data(), std::min(answer.missing(), buffer.size()));
    if (got == 0) fail_with_errno(ECONNRESET);
    if (got < 0 && errno != EAGAIN && errno != EINTR) fail_with_errno(errno);
    if (got > 0) answer.feed(std::span(buffer).first(static_cast<std::size_t>(got)));
  }
}

std::vector<std::uint8_t> ModbusBus::Connection::send_serial(int unit,
                                                             std::span<const std::uint8_t> request) {
  wait_for_silent_interval();
  std::vector<std::uint8_t> raw = {low(unit)};
  raw.insert(raw.end(), request.begin(), request.end());
  modbus_set_slave(context_, unit);
  if (modbus_send_raw_request(context_, raw.data(), static_cast<int>(raw.size())) < 0) fail_with_errno(errno);
  return rtu::with_checksum(raw);
}

// Whether the adapter echoes cannot be seen in the answer to function 06, which equals its request. A read
// tells, whatever the device says to it.
void ModbusBus::Connection::learn_echo(int unit, std::span<const std::uint8_t> request, Duration timeout) {
  const std::array<std::uint8_t, 5> probe = {read_holding_registers, request[1], request[2], 0, 1};
  try {
    (void)exchange(unit, probe, timeout);
  } catch (const ModbusFailure& failure) {
    if (failure.fault == ModbusFault::refused) return;
    // The request may be a stop: it goes out all the same, for a device that hears and cannot be heard.
    (void)send_serial(unit, request);
    throw;
  }
}

std::span<const std::uint8_t> ModbusBus::Connection::exchange_serial(int unit,
                                                                     std::span<const std::uint8_t> request,
                                                                     Duration timeout) {
  if (echo_ == rtu::Echo::unknown && request[0] == write_single_register) learn_echo(unit, request, timeout);
  rtu::Answer answer(send_serial(unit, request), echo_);
  try {
    receive_serial(answer, std::chrono::steady_clock::now() + timeout);
  } catch (const ModbusFailure&) {
    last_frame_ = std::chrono::steady_clock::now();
    throw;
  }
  last_frame_ = std::chrono::steady_clock::now();
  if (answer.echo_is_damaged())
    throw ModbusFailure{ModbusFault::damaged,
                        "the adapter hears other bytes than it sends; does something else send on the line?"};
  echo_ = answer.echo();
  answer_.assign(answer.bytes().begin(), answer.bytes().end());
  if (!rtu::is_sound(answer_)) fail_with_errno(EMBBADCRC);
  if (answer_[0] != low(unit)) throw ModbusFailure{ModbusFault::damaged, "answer from another unit"};
  return std::span<const std::uint8_t>(answer_).subspan(1, answer_.size() - 3);
}

std::span<const std::uint8_t> ModbusBus::Connection::exchange_tcp(int unit,
                                                                  std::span<const std::uint8_t> request,
                                                                  Duration timeout) {
  set_timeout(context_, timeout);
  send_tcp(unit, request);
  answer_.resize(MODBUS_MAX_ADU_LENGTH);
  const int length = modbus_receive_confirmation(context_, answer_.data());
  if (length < 0) fail_with_errno(errno);
  if (length < mbap_length + 2) throw ModbusFailure{ModbusFault::damaged, "answer too short"};
  answer_.resize(static_cast<std::size_t>(length));
  if (answer_[0] != high(transaction_) || answer_[1] != low(transaction_))
    throw ModbusFailure{ModbusFault::damaged, "answer to another request"};
  if (answer_[2] != 0 || answer_[3] != 0)
    throw ModbusFailure{ModbusFault::damaged, "answer that is not Modbus"};
  if (answer_[4] * 256 + answer_[5] != length - (mbap_length - 1))
    throw ModbusFailure{ModbusFault::damaged, "answer with a wrong length"};
  if (answer_[mbap_length - 1] != low(unit))
    throw ModbusFailure{ModbusFault::damaged, "answer from another unit"};
  return std::span<const std::uint8_t>(answer_).subspan(mbap_length);
}

std::span<const std::uint8_t> ModbusBus::Connection::exchange(int unit, std::span<const std::uint8_t> request,
                                                              Duration timeout) {
  discard_stale_input();
  const std::span<const std::uint8_t> pdu =
      serial_ ? exchange_serial(unit, request, timeout) : exchange_tcp(unit, request, timeout);
  if (pdu[0] == (request[0] | exception_flag)) {
    const int code = pdu[1];
    throw ModbusFailure{code == 5 || code == 6 ? ModbusFault::busy : ModbusFault::refused,
                        exception_words(code)};
  }
  if (pdu[0] != request[0]) throw ModbusFailure{ModbusFault::damaged, "answer to another function"};
  return pdu;
}

std::vector<std::uint16_t> ModbusBus::Connection::read(int unit, std::uint16_t address, int count,
                                                       Duration timeout) {
  const std::array<std::uint8_t, 5> request = {read_holding_registers, high(address), low(address),
                                               high(count), low(count)};
  const auto answer = exchange(unit, request, timeout);
  if (answer.size() != static_cast<std::size_t>(2 + 2 * count) || answer[1] != 2 * count)
    throw ModbusFailure{ModbusFault::damaged,
                        fmt::format("answer with {} bytes instead of {}", answer[1], 2 * count)};
  std::vector<std::uint16_t> registers(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < registers.size(); ++i)
    registers[i] = static_cast<std::uint16_t>(answer[2 + 2 * i] << 8 | answer[3 + 2 * i]);
  return registers;
}

void ModbusBus::Connection::write(int unit, std::uint16_t address, std::span<const std::uint16_t> values,
                                  Duration timeout) {
  std::vector<std::uint8_t> request;
  request.reserve(6 + 2 * values.size());
  const int count = static_cast<int>(values.size());
  if (count == 1) {
    request = {write_single_register, high(address), low(address), high(values[0]), low(values[0])};
  } else {
    request = {
        write_multiple_registers, high(address), low(address), high(count), low(count), low(2 * count)};
    for (const std::uint16_t value : values) {
      request.push_back(high(value));
      request.push_back(low(value));
    }
  }
  const auto answer = exchange(unit, request, timeout);
  // Both functions repeat the first five bytes: address, and value or count.
  if (answer.size() != 5 || !std::equal(answer.begin(), answer.end(), request.begin()))
    throw ModbusFailure{ModbusFault::damaged, "answer that confirms another write"};
}

}  // namespace eigenpose
