#pragma once

/// How an operator writes where a Modbus line is.

#include <string_view>
#include <variant>

#include "drivers/modbus/modbus_bus.h"
#include "drivers/modbus/profile.h"

namespace eigenpose {

/// Reads "tcp://HOST[:PORT]" (port 502 by default; IPv6 in brackets), or "rtu:DEVICE[:BAUD[:8E1]]" (what is
/// left out is the drive's factory setting). @throws std::invalid_argument saying what is allowed.
std::variant<ModbusTcpEndpoint, ModbusRtuEndpoint> parse_modbus_endpoint(std::string_view text,
                                                                         const SerialDefaults& defaults = {});

}  // namespace eigenpose
