#pragma once

/// How an operator writes where a Modbus line is.

#include <string>
#include <string_view>
#include <variant>

#include "drivers/modbus/modbus_bus.h"
#include "drivers/modbus/profile.h"

namespace eigenpose {

/// @throws std::invalid_argument naming the allowed ones when no serial port can be set to `baud`.
void check_baud(int baud);

/// Reads "tcp://HOST[:PORT]" (port 502 by default; IPv6 in brackets), or "rtu:DEVICE[:BAUD[:8E1]]" (what is
/// left out is the drive's factory setting). @throws std::invalid_argument saying what is allowed.
std::variant<ModbusTcpEndpoint, ModbusRtuEndpoint> parse_modbus_endpoint(std::string_view text,
                                                                         const SerialDefaults& defaults = {});

/// "tcp 192.168.0.10:502" or "serial /dev/ttyUSB0": the same for every spelling of one line, its links to a
/// port followed. Opens nothing and looks no name up.
std::string line_name(const std::variant<ModbusTcpEndpoint, ModbusRtuEndpoint>& endpoint);

}  // namespace eigenpose
