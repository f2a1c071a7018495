#pragma once

/// What a line to the lab's control means. Kept apart from the socket.

#include <string>
#include <string_view>

#include "sim/lab/sim_lab.h"

namespace eigenpose::sim {

class SimModbusServer;

/// Obeys one request. Never throws for a bad request; the answer says what is wrong. @return one line of
/// JSON, no newline.
std::string obey_lab_request(SimLab& lab, SimModbusServer* modbus, std::string_view line);

}  // namespace eigenpose::sim
