#include "sim/lab/lab_requests.h"

#include <cstdint>
#include <limits>
#include <map>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "core/base/json.h"
#include "sim/modbus/modbus_server.h"

namespace eigenpose::sim {
namespace {

using Json = nlohmann::json;

double seconds_of(TimePoint when) {
  return std::chrono::duration<double>(when.time_since_epoch()).count();
}

constexpr std::int64_t most_faults = 1'000'000;  ///< planned at once
constexpr double no_limit = std::numeric_limits<double>::max();

/// The optional members of a request, each converted strictly and within its range.
const Json* member(const Json& request, const char* key) {
  const auto found = request.find(key);
  return found == request.end() || found->is_null() ? nullptr : &*found;
}
double number_or(const Json& request, const char* key, double otherwise, double lower = -no_limit,
                 double upper = no_limit) {
  const Json* value = member(request, key);
  return value == nullptr ? otherwise : json_number(*value, key, lower, upper);
}
std::int64_t integer_or(const Json& request, const char* key, std::int64_t otherwise, std::int64_t lower,
                        std::int64_t upper) {
  const Json* value = member(request, key);
  return value == nullptr ? otherwise : json_integer(*value, key, lower, upper);
}
bool flag_or(const Json& request, const char* key) {
  const Json* value = member(request, key);
  return value != nullptr && json_flag(*value, key);
}
bool needed_flag(const Json& request, const char* key) {
  return json_flag(json_member(request, key), key);
}

Json place(SimLab& lab, const Json& request) {
  const std::string object = json_text(json_member(request, "object"), "object");
  const Angle yaw = degrees(number_or(request, "yaw_deg", 0.0));
  const double x_mm = number_or(request, "x_mm", 0.0);
  const double y_mm = number_or(request, "y_mm", 0.0);
  const bool hand = flag_or(request, "hand");
  return {{"id", hand ? lab.place_by_hand(object, yaw, x_mm, y_mm) : lab.place(object, yaw, x_mm, y_mm)}};
}

Json remove(SimLab& lab, const Json& request) {
  const auto id = static_cast<std::uint64_t>(
      json_integer(json_member(request, "id"), "id", 1, std::numeric_limits<std::int64_t>::max()));
  if (flag_or(request, "hand")) {
    lab.remove_by_hand(id);
  } else {
    lab.remove(id);
  }
  return Json::object();
}

Json objects_of(const SimLab& lab) {
  Json list = Json::array();
  for (const CatalogEntry& entry : lab.objects()) {
    list.push_back({{"name", entry.name},
                    {"symmetric", entry.symmetric},
                    {"held_out", entry.held_out},
                    {"recorded", entry.recorded}});
  }
  return {{"objects", list}};
}

Json truth_of(const SimLab& lab) {
  const Truth truth = lab.truth();
  Json objects = Json::array();
  for (const TrueObject& object : truth.objects) {
    objects.push_back({{"id", object.id},
                       {"name", object.name},
                       {"angle_deg", object.angle.degrees()},
                       {"yaw_deg", object.yaw.degrees()},
                       {"x_mm", object.x_mm},
                       {"y_mm", object.y_mm},
                       {"symmetric", object.symmetric},
                       {"held_out", object.held_out},
                       {"carried", object.carried}});
  }
  return {{"time_s", seconds_of(truth.time)},
          {"table_deg", truth.table.degrees()},
          {"arm_azimuth_deg", truth.arm_azimuth.degrees()},
          {"arm_elevation_deg", truth.arm_elevation.degrees()},
          {"lamp_level", truth.lamp_level},
          {"moving", truth.moving},
          {"hand_in_view", truth.hand_in_view},
          {"objects", objects}};
}

CameraFaults camera_faults_of(const Json& request) {
  return {flag_or(request, "stalled"), flag_or(request, "lost"), number_or(request, "extra_noise", 0.0),
          number_or(request, "damaged_fraction", 0.0)};
}

DriveFaults drive_faults_of(const Json& request) {
  return {flag_or(request, "stuck"), number_or(request, "slip_steps", 0.0),
          number_or(request, "backlash_deg", 0.0), flag_or(request, "dead")};
}

WireFaultKind kind_of(const std::string& name) {
  static const std::map<std::string, WireFaultKind> kinds = {
      {"silence", WireFaultKind::silence},
      {"loss", WireFaultKind::loss},
      {"late", WireFaultKind::late},
      {"partial", WireFaultKind::partial},
      {"wrong_unit", WireFaultKind::wrong_unit},
      {"wrong_transaction", WireFaultKind::wrong_transaction},
      {"bad_crc", WireFaultKind::bad_crc},
      {"exception", WireFaultKind::exception},
      {"close_connection", WireFaultKind::close_connection},
      {"death", WireFaultKind::death}};
  const auto found = kinds.find(name);
  if (found != kinds.end()) return found->second;
  std::string known;
  for (const auto& [kind, value] : kinds) known += (known.empty() ? "" : ", ") + kind;
  throw std::invalid_argument("no wire fault is called \"" + name + "\"; there are: " + known);
}

WireFault wire_fault_of(const Json& request) {
  return {kind_of(json_text(json_member(request, "kind"), "kind")),
          std::chrono::milliseconds(integer_or(request, "delay_ms", 300, 0, 3'600'000)),
          static_cast<std::uint8_t>(integer_or(request, "exception_code", 4, 1, 255))};
}

Json obey_about_drives(SimModbusServer& modbus, const std::string& what, const Json& request) {
  const auto drive = [&]() -> AzDrive& {
    return modbus.drive(static_cast<std::uint8_t>(integer_or(request, "unit", 1, 1, 247)));
  };
  if (what == "drive_faults") {
    drive().set_faults(drive_faults_of(request));
  } else if (what == "alarm") {
    drive().raise_alarm(static_cast<int>(json_integer(json_member(request, "code"), "code", 1, 0xFFFF)));
  } else if (what == "wire_fault") {
    modbus.faults().add(wire_fault_of(request),
                        static_cast<int>(integer_or(request, "times", 1, 1, most_faults)),
                        static_cast<int>(integer_or(request, "skip", 0, 0, most_faults)));
  } else if (needed_flag(request, "alive")) {
    modbus.revive();
  } else {
    modbus.die();
  }
  return Json::object();
}

Json obey(SimLab& lab, SimModbusServer* modbus, const Json& request) {
  const std::string what = json_text(json_member(request, "do"), "do");
  if (what == "place") return place(lab, request);
  if (what == "remove") return remove(lab, request);
  if (what == "objects") return objects_of(lab);
  if (what == "truth") return truth_of(lab);
  if (what == "clear") {
    lab.clear();
    return Json::object();
  }
  if (what == "hand") {
    needed_flag(request, "in") ? lab.hand_in() : lab.hand_out();
    return Json::object();
  }
  if (what == "lamp") {
    lab.set_lamp_level(json_number(json_member(request, "level"), "level"));
    return Json::object();
  }
  if (what == "camera_faults") {
    lab.set_camera_faults(camera_faults_of(request));
    return Json::object();
  }
  if (what == "drive_faults" || what == "alarm" || what == "wire_fault" || what == "modbus") {
    if (modbus == nullptr) throw std::invalid_argument("this lab has no simulated drives");
    return obey_about_drives(*modbus, what, request);
  }
  throw std::invalid_argument("the lab cannot \"" + what +
                              "\"; it can: place, remove, clear, hand, lamp, objects, truth, camera_faults, "
                              "drive_faults, alarm, wire_fault, modbus");
}

}  // namespace

std::string obey_lab_request(SimLab& lab, SimModbusServer* modbus, std::string_view line) {
  Json answer;
  try {
    answer = obey(lab, modbus, parse_json(line));
    answer["ok"] = true;
  } catch (const JsonError& error) {
    answer = {{"ok", false}, {"error", std::string("not a request the lab understands: ") + error.what()}};
  } catch (const std::exception& error) {
    answer = {{"ok", false}, {"error", error.what()}};
  }
  return answer.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace eigenpose::sim
