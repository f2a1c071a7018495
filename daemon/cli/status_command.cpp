/// `eigenpose status` and `eigenpose objects`: what the service is and knows.

#include <cstdio>
#include <memory>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/printable.h"
#include "daemon/cli/service_client.h"
#include "daemon/cli/service_commands.h"

namespace eigenpose::cli {
namespace {

using nlohmann::json;

std::string text_or(const json& object, const char* key, const std::string& otherwise) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? printable(found->get<std::string>()) : otherwise;
}

void print_camera(const json& camera) {
  if (camera.is_null()) {
    std::printf("camera   none configured\n");
  } else if (camera.at("error").is_string()) {
    std::printf("camera   FAULT: %s\n", printable(camera.at("error").get<std::string>()).c_str());
  } else if (!camera.contains("name")) {
    std::printf("camera   opening\n");
  } else {
    std::printf("camera   %s: %s, %s %dx%d, %.3g fps; %llu frames taken, %llu dropped\n",
                camera.at("name").get<std::string>().c_str(), camera.at("model").get<std::string>().c_str(),
                camera.at("format").get<std::string>().c_str(), camera.at("width").get<int>(),
                camera.at("height").get<int>(), camera.at("frames_per_second").get<double>(),
                static_cast<unsigned long long>(camera.at("frames_taken").get<std::uint64_t>()),
                static_cast<unsigned long long>(camera.at("frames_dropped").get<std::uint64_t>()));
  }
}

void print_axis(const json& axis) {
  const std::string name = axis.at("name").get<std::string>();
  const std::string unit = axis.at("unit").get<std::string>();
  if (axis.at("error").is_string()) {
    std::printf("axis     %s: FAULT: %s\n", name.c_str(),
                printable(axis.at("error").get<std::string>()).c_str());
  } else if (axis.at("position").is_null()) {
    std::printf("axis     %s: opening\n", name.c_str());
  } else {
    std::printf("axis     %s: %.2f %s%s%s%s\n", name.c_str(), axis.at("position").get<double>(), unit.c_str(),
                axis.at("moving").get<bool>() ? ", moving" : "",
                axis.at("homed").get<bool>() ? "" : ", not homed yet",
                axis.at("alarm").is_string()
                    ? (", ALARM: " + printable(axis.at("alarm").get<std::string>())).c_str()
                    : "");
  }
}

int print_status(const ServiceOptions& options) {
  const json status = reading_client(options).get("/v1/status");
  if (options.json) {
    std::printf("%s\n", status.dump(2).c_str());
    return exit_done;
  }
  std::printf("service  eigenposed %s, %s; started %s\n", status.at("version").get<std::string>().c_str(),
              status.at("state").get<std::string>().c_str(), status.at("started").get<std::string>().c_str());
  print_camera(status.at("camera"));
  for (const json& axis : status.at("axes")) print_axis(axis);
  const json& model = status.at("model");
  if (model.is_object())
    std::printf("model    %zu objects from %zu views, %d components\n",
                model.at("objects").get<std::size_t>(), model.at("views").get<std::size_t>(),
                model.at("components").get<int>());
  else
    std::printf("model    %s\n",
                text_or(status, "model_error", "none yet: acquire objects, then learn").c_str());
  if (const std::string error = text_or(status.at("watch"), "error", ""); !error.empty())
    std::printf("watch    FAULT: %s\n", error.c_str());
  for (const json& job : status.at("jobs"))
    std::printf("job      %s: %s %s %zu/%zu, since %s\n", job.at("id").get<std::string>().c_str(),
                job.at("kind").get<std::string>().c_str(), text_or(job, "subject", "").c_str(),
                job.at("done").get<std::size_t>(), job.at("total").get<std::size_t>(),
                job.at("started").get<std::string>().c_str());
  if (const json& sim = status.at("sim"); sim.is_object())
    std::printf("lab      simulated; control %s, drives %s\n",
                sim.at("lab_socket").get<std::string>().c_str(),
                sim.at("modbus_endpoint").get<std::string>().c_str());
  return exit_done;
}

int print_objects(const ServiceOptions& options) {
  const json answer = reading_client(options).get("/v1/objects");
  if (options.json) {
    std::printf("%s\n", answer.dump(2).c_str());
    return exit_done;
  }
  if (answer.at("objects").empty())
    std::printf("no objects yet; put one on the table and run 'eigenpose acquire NAME'\n");
  for (const json& object : answer.at("objects")) {
    const json& acquired = object.at("image_set");
    const json& learned = object.at("learned");
    std::string line = printable(object.at("name").get<std::string>()) + ": ";
    if (object.at("error").is_string())
      line += "FAULT: " + printable(object.at("error").get<std::string>());
    else if (acquired.is_object())
      line += std::to_string(acquired.at("views").get<std::size_t>()) + " views" +
              (acquired.at("complete").get<bool>() ? "" : " (incomplete: the same acquisition continues)");
    else
      line += "no image set here";
    line += learned.is_object() ? ", learned" : ", not learned";
    if (learned.is_object() && !learned.at("pose_observable").get<bool>())
      line += ", its pose is not observable";
    std::printf("%s\n", line.c_str());
  }
  return exit_done;
}

}  // namespace

void add_status_command(CLI::App& app, CommandLine& line) {
  const auto options = std::make_shared<ServiceOptions>();
  CLI::App* command = app.add_subcommand("status", "What the service does now, its devices and model");
  add_service_options(*command, *options);
  command->callback([options, &line] { line.action = [options] { return print_status(*options); }; });
}

void add_objects_command(CLI::App& app, CommandLine& line) {
  const auto options = std::make_shared<ServiceOptions>();
  CLI::App* command = app.add_subcommand("objects", "The objects the service has acquired and learned");
  add_service_options(*command, *options);
  command->callback([options, &line] { line.action = [options] { return print_objects(*options); }; });
}

}  // namespace eigenpose::cli
