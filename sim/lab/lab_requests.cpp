#include "sim/lab/lab_requests.h"

#include <functional>
#include <map>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "sim/modbus/modbus_server.h"

namespace eigenpose::sim {
namespace {

using Json = nlohmann::json;

double seconds_of(TimePoint when) {
  return std::chrono::duration<double>(when.time_since_epoch()).count();
}

template <class T>
T value_or(const Json& request, const char* key, T otherwise) {
  const auto found = request.find(key);
  return found == request.end() || found->is_null() ? otherwise : found->get<T>();
}

Json place(SimLab& lab, const Json& request) {
  const auto object = request.at("object").get<std::string>();
  const Angle yaw = degrees(value_or(request, "yaw_deg", 0.0));
  const double x_mm = value_or(request, "x_mm", 0.0);
  const double y_mm = value_or(request, "y_mm", 0.0);
  const bool hand = value_or(request, "hand", false);
  return {{"id", hand ? lab.place_by_hand(object, yaw, x_mm, y_mm) : lab.place(object, yaw, x_mm, y_mm)}};
}

Json remove(SimLab& lab, const Json& request) {
  const auto id = request.at("id").get<std::uint64_t>();
  if (value_or(request, "hand", false)) {
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
  return {value_or(request, "stalled", false), value_or(request, "lost", false),
          value_or(request, "extra_noise", 0.0), value_or(request, "damaged_fraction", 0.0)};
}

DriveFaults drive_faults_of(const Json& request) {
  return {value_or(request, "stuck", false), value_or(request, "slip_steps", 0.0),
          value_or(request, "backlash_deg", 0.0), value_or(request, "dead", false)};
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
  return {kind_of(request.at("kind").get<std::string>()),
          std::chrono::milliseconds(value_or(request, "delay_ms", 300)),
          static_cast<std::uint8_t>(value_or(request, "exception_code", 4))};
}

Json obey_about_drives(SimModbusServer& modbus, const std::string& what, const Json& request) {
  const auto drive = [&]() -> AzDrive& { return modbus.drive(value_or<std::uint8_t>(request, "unit", 1)); };
  if (what == "drive_faults") {
    drive().set_faults(drive_faults_of(request));
  } else if (what == "alarm") {
    drive().raise_alarm(request.at("code").get<int>());
  } else if (what == "wire_fault") {
    modbus.faults().add(wire_fault_of(request), value_or(request, "times", 1), value_or(request, "skip", 0));
  } else if (request.at("alive").get<bool>()) {
    modbus.revive();
  } else {
    modbus.die();
  }
  return Json::object();
}

Json obey(SimLab& lab, SimModbusServer* modbus, const Json& request) {
  const auto what = request.at("do").get<std::string>();
  if (what == "place") return place(lab, request);
  if (what == "remove") return remove(lab, request);
  if (what == "objects") return objects_of(lab);
  if (what == "truth") return truth_of(lab);
  if (what == "clear") {
    lab.clear();
    return Json::object();
  }
  if (what == "hand") {
    request.at("in").get<bool>() ? lab.hand_in() : lab.hand_out();
    return Json::object();
  }
  if (what == "lamp") {
    lab.set_lamp_level(request.at("level").get<double>());
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
    answer = obey(lab, modbus, Json::parse(line));
    answer["ok"] = true;
  } catch (const Json::exception& error) {
    answer = {{"ok", false}, {"error", std::string("not a request the lab understands: ") + error.what()}};
  } catch (const std::exception& error) {
    answer = {{"ok", false}, {"error", error.what()}};
  }
  return answer.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace eigenpose::sim
