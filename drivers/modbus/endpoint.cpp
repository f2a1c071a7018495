#include "drivers/modbus/endpoint.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "drivers/modbus/host_lookup.h"

namespace eigenpose {

namespace {

/// What Linux and libmodbus know; libmodbus silently takes 9600 for any other.
constexpr std::array baud_rates = {1200,    2400,    4800,    9600,    19200,   38400,  57600,
                                   115200,  230400,  460800,  500000,  576000,  921600, 1000000,
                                   1152000, 1500000, 2500000, 3000000, 3500000, 4000000};

[[noreturn]] void refuse(std::string_view text, const std::string& what) {
  throw std::invalid_argument(fmt::format(
      "Modbus endpoint \"{}\": {}; write tcp://HOST:PORT or rtu:/dev/serial/by-id/…:115200:8E1", text, what));
}

int number(std::string_view text, std::string_view digits, const char* what) {
  int value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size() || value <= 0)
    refuse(text, fmt::format("\"{}\" is no {}", digits, what));
  return value;
}

/// Of names, of addresses, and of the zone of an IPv6 address.
constexpr std::string_view host_characters =
    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_:%";

ModbusTcpEndpoint parse_tcp(std::string_view text, std::string_view rest) {
  ModbusTcpEndpoint endpoint;
  std::size_t host_end = rest.find(':');
  if (rest.starts_with('[')) {
    host_end = rest.find(']');
    if (host_end == std::string_view::npos) refuse(text, "the bracket is not closed");
    endpoint.host = rest.substr(1, host_end - 1);
    ++host_end;
  } else {
    host_end = std::min(host_end, rest.size());
    endpoint.host = rest.substr(0, host_end);
  }
  if (endpoint.host.empty()) refuse(text, "no host");
  if (const std::size_t wrong = endpoint.host.find_first_not_of(host_characters); wrong != std::string::npos)
    refuse(text, fmt::format("\"{}\" cannot stand in a host", endpoint.host[wrong]));
  const std::string_view after = rest.substr(host_end);
  if (!after.empty() && !after.starts_with(':')) refuse(text, "something stands behind the bracket");
  if (!after.empty()) endpoint.port = number(text, after.substr(1), "port");
  if (endpoint.port > 65535) refuse(text, "the port is above 65535");
  return endpoint;
}

ModbusRtuEndpoint parse_rtu(std::string_view text, std::string_view rest, const SerialDefaults& defaults) {
  ModbusRtuEndpoint endpoint{
      {}, defaults.baud, defaults.parity, defaults.stop_bits, defaults.silent_interval};
  // Names below /dev/serial/by-path have colons of their own; what follows the device is a number.
  const auto cut_last = [&rest]() -> std::string_view {
    const std::size_t colon = rest.rfind(':');
    if (colon == std::string_view::npos) return {};
    return rest.substr(colon + 1);
  };
  const auto is_frame = [](std::string_view part) {
    return part.size() == 3 && part[0] == '8' &&
           std::string_view("NEO").find(part[1]) != std::string_view::npos &&
           (part[2] == '1' || part[2] == '2');
  };
  std::string_view part = cut_last();
  if (is_frame(part)) {
    endpoint.parity = part[1];
    endpoint.stop_bits = part[2] - '0';
    rest.remove_suffix(part.size() + 1);
    part = cut_last();
    endpoint.baud = number(text, part, "baud rate");
    rest.remove_suffix(part.size() + 1);
  } else if (!part.empty() && part.find_first_not_of("0123456789") == std::string_view::npos) {
    endpoint.baud = number(text, part, "baud rate");
    rest.remove_suffix(part.size() + 1);
  }
  if (!rest.starts_with('/')) refuse(text, "the device must be a path from /");
  endpoint.device = rest;
  try {
    check_baud(endpoint.baud);
  } catch (const std::invalid_argument& error) {
    refuse(text, error.what());
  }
  return endpoint;
}

}  // namespace

void check_baud(int baud) {
  if (std::find(baud_rates.begin(), baud_rates.end(), baud) == baud_rates.end())
    throw std::invalid_argument(
        fmt::format("no serial port has {} baud; allowed: {}", baud, fmt::join(baud_rates, ", ")));
}

std::variant<ModbusTcpEndpoint, ModbusRtuEndpoint> parse_modbus_endpoint(std::string_view text,
                                                                         const SerialDefaults& defaults) {
  constexpr std::string_view tcp = "tcp://";
  constexpr std::string_view rtu = "rtu:";
  if (text.starts_with(tcp)) return parse_tcp(text, text.substr(tcp.size()));
  if (text.starts_with(rtu)) return parse_rtu(text, text.substr(rtu.size()), defaults);
  refuse(text, "neither tcp:// nor rtu:");
}

std::string line_name(const std::variant<ModbusTcpEndpoint, ModbusRtuEndpoint>& endpoint) {
  if (const auto* tcp = std::get_if<ModbusTcpEndpoint>(&endpoint))
    return fmt::format("tcp {}:{}", canonical_host(tcp->host), tcp->port);
  const std::string& device = std::get<ModbusRtuEndpoint>(endpoint).device;
  std::error_code failed;
  const std::filesystem::path port = std::filesystem::weakly_canonical(device, failed);
  return "serial " + (failed ? device : port.string());
}

}  // namespace eigenpose
