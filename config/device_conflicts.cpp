#include "config/device_conflicts.h"

#include <string>
#include <vector>

#include <fmt/format.h>

#include "drivers/modbus/endpoint.h"

namespace eigenpose {
namespace {

/// What an entry drives.
struct Use {
  std::string device;  ///< in words, the same however it is spelt
  std::string output;  ///< of a lamp: users of one device with other outputs do not disturb each other
  std::string who;     ///< "axis \"table\""
  std::string key;     ///< which key tells the device from others
};

std::string modbus_device(const std::string& endpoint, int station) {
  const std::string line =
      endpoint == "simulated" ? "the simulated drives" : line_name(parse_modbus_endpoint(endpoint));
  return fmt::format("{}, station {}", line, station);
}

Use use_of(const AxisOptions& axis) {
  const std::string who = fmt::format("axis \"{}\"", axis.dof.name);
  if (axis.driver == "modbus") return {modbus_device(axis.endpoint, axis.station), "", who, "station"};
  return {axis.endpoint == "simulated" ? "the simulated APT controller" : axis.endpoint, "", who, "endpoint"};
}

Use use_of(const LampOptions& lamp) {
  const std::string who = fmt::format("lamp \"{}\"", lamp.name);
  // A module of outputs at one station has a profile for each output.
  if (lamp.driver == "modbus")
    return {modbus_device(lamp.endpoint, lamp.station), lamp.profile.string(), who, "station"};
  if (lamp.driver == "dmx") return {lamp.endpoint, fmt::format("channel {}", lamp.channel), who, "channel"};
  return {"the simulated lab's lamp", "", who, "driver"};
}

bool disturb(const Use& a, const Use& b) {
  return a.device == b.device && (a.output.empty() || b.output.empty() || a.output == b.output);
}

}  // namespace

void refuse_device_conflicts(const TomlTable& root, const Config& config) {
  std::vector<Use> uses;
  const auto add = [&](const TomlTable& table, Use use) {
    for (const Use& other : uses)
      if (disturb(use, other))
        table.fail(use.key,
                   fmt::format("{} and {} would both drive {}{}{}: give each a device of its own", other.who,
                               use.who, use.device, use.output.empty() ? "" : ", ", use.output));
    uses.push_back(std::move(use));
  };
  const std::vector<TomlTable> axes = root.tables("axis");
  for (std::size_t i = 0; i < axes.size(); ++i) add(axes[i], use_of(config.axes[i]));
  const std::vector<TomlTable> lamps = root.tables("lamp");
  for (std::size_t i = 0; i < lamps.size(); ++i) add(lamps[i], use_of(config.lamps[i]));
}

}  // namespace eigenpose
