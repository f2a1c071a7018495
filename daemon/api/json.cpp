#include "daemon/api/json.h"

#include <chrono>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/base/utc_text.h"
#include "core/dataset/workspace_json.h"

namespace eigenpose {
namespace {

using nlohmann::json;

template <typename Value>
json or_null(const std::optional<Value>& value) {
  return value ? json(*value) : json(nullptr);
}

json or_null(const std::string& text) {
  return text.empty() ? json(nullptr) : json(text);
}

}  // namespace

/// {"cut short": 3}: what was wrong with frames, without what never occurred.
json damage_json(const CameraStatistics& statistics) {
  json result = json::object();
  for (std::size_t fault = 0; fault < frame_fault_count; ++fault)
    if (statistics.damaged_by[fault] > 0)
      result[std::string(name_of(static_cast<FrameFault>(fault)))] = statistics.damaged_by[fault];
  return result;
}

json to_json(const CameraStatus& camera) {
  if (!camera.configured) return nullptr;
  json result = {{"error", or_null(camera.error)},
                 {"frames_taken", camera.statistics.frames_taken},
                 {"frames_dropped", camera.statistics.frames_dropped},
                 {"frames_damaged", camera.statistics.frames_damaged},
                 {"damaged_by", damage_json(camera.statistics)},
                 {"times_lost", camera.statistics.times_lost},
                 {"frame_sequence", or_null(camera.frame_sequence)},
                 {"frame_age_s", nullptr}};
  if (camera.frame_age) result["frame_age_s"] = std::chrono::duration<double>(*camera.frame_age).count();
  if (camera.info) {
    result["name"] = camera.info->name;
    result["model"] = camera.info->model;
    result["serial"] = or_null(camera.info->serial);
    result["format"] = camera.info->format;
    result["width"] = camera.info->width;
    result["height"] = camera.info->height;
    result["frames_per_second"] = camera.info->frames_per_second;
    result["controls"] = camera.info->controls;
  }
  return result;
}

json to_json(const AxisStatus& axis) {
  json result = {{"name", axis.dof.name},
                 {"unit", axis.dof.unit},
                 {"lower", axis.dof.lower},
                 {"upper", axis.dof.upper},
                 {"periodic", axis.dof.periodic},
                 {"model", or_null(axis.model)},
                 {"error", or_null(axis.error)},
                 {"position", nullptr},
                 {"moving", false},
                 {"homed", false},
                 {"alarm", nullptr}};
  if (axis.state) {
    result["position"] = axis.state->position;
    result["moving"] = axis.state->moving;
    result["homed"] = axis.state->homed;
    result["alarm"] = or_null(axis.state->alarm);
  }
  return result;
}

json to_json(const LampStatus& lamp) {
  return {{"name", lamp.name},
          {"model", or_null(lamp.model)},
          {"wanted_level", lamp.wanted_level},
          {"level", or_null(lamp.level)},
          {"error", or_null(lamp.error)}};
}

json to_json(const LeftOutDetail& left_out) {
  return {{"object", left_out.object},
          {"whole_object", left_out.whole_object},
          {"views", left_out.views},
          {"reason", left_out.reason}};
}

json to_json(const JobResult& result) {
  if (const auto* acquired = std::get_if<AcquisitionResult>(&result))
    return {{"folder", acquired->folder.string()},
            {"views", acquired->views},
            {"kept", acquired->kept},
            {"retaken", acquired->retaken},
            {"not_returned", or_null(acquired->not_returned)}};
  if (const auto* learned = std::get_if<LearningResult>(&result)) {
    json details = json::array();
    for (const LeftOutDetail& detail : learned->left_out_details) details.push_back(to_json(detail));
    return {{"objects", learned->objects},       {"views", learned->views},
            {"components", learned->components}, {"energy", learned->energy},
            {"seconds", learned->time.count()},  {"file", learned->file.string()},
            {"left_out", learned->left_out},     {"left_out_details", std::move(details)}};
  }
  return nullptr;
}

json to_json(const JobStatus& job) {
  const Failure failure = job.failure.value_or(Failure{});
  return {{"id", job.id},
          {"kind", job_kind_name(job.kind)},
          {"subject", or_null(job.subject)},
          {"state", job_state_name(job.state)},
          {"stage", or_null(job.stage)},
          {"done", job.done},
          {"total", job.total},
          {"error", or_null(failure.what)},
          {"hint", or_null(failure.hint)},
          {"result", to_json(job.result)},
          {"started", utc_text(job.started, UtcDigits::milliseconds)},
          {"ended", job.ended ? json(utc_text(*job.ended, UtcDigits::milliseconds)) : json(nullptr)}};
}

json status_json(const ApiSources& sources) {
  Service& service = sources.service;
  json axes = json::array();
  json lamps = json::array();
  const RigStatus rig = service.rig().status();
  for (const AxisStatus& axis : rig.axes) axes.push_back(to_json(axis));
  for (const LampStatus& lamp : rig.lamps) lamps.push_back(to_json(lamp));
  json running = json::array();
  for (const JobStatus& job : service.jobs().list())
    if (job.state == JobState::running) running.push_back(to_json(job));
  json plans = json::array();
  for (const Plan& plan : service.plans()) plans.push_back({{"name", plan.name}, {"views", plan.size()}});

  const ServiceActivity activity = service.activity();
  const WatchStatus watched = service.watcher().status();
  json model = nullptr;
  if (const auto current = service.models().current()) {
    std::size_t views = 0;
    for (const ModelObject& object : current->objects) views += object.views;
    model = {{"objects", current->objects.size()},
             {"views", views},
             {"components", current->eigenspace.components()},
             {"size", current->normalization.size},
             {"color", current->normalization.color},
             {"type", image_type_name(current->normalization)},
             {"created", current->provenance.created}};
  }
  json simulation = nullptr;
  if (const auto& sim = sources.simulation)
    simulation = {{"lab_socket", sim->lab_socket.string()},
                  {"modbus_endpoint", fmt::format("tcp://127.0.0.1:{}", sim->modbus_port)}};
  return {{"program", "eigenposed"},
          {"version", EIGENPOSE_VERSION},
          {"started", utc_text(service.started(), UtcDigits::milliseconds)},
          {"state", service_state_name(activity.state)},
          {"since", utc_text(activity.since, UtcDigits::milliseconds)},
          {"camera", to_json(service.camera().status())},
          {"axes", std::move(axes)},
          {"lamps", std::move(lamps)},
          {"plans", std::move(plans)},
          {"model", std::move(model)},
          {"model_error", or_null(service.models().error())},
          {"watch",
           {{"frames", watched.frames},
            {"recognitions", watched.recognitions},
            {"flicker", watched.flicker},
            {"error", or_null(watched.error)}}},
          {"run", sources.results->run()},
          {"last_result", sources.results->last_sequence()},
          {"jobs", std::move(running)},
          {"sim", std::move(simulation)}};
}

json objects_json(const Service& service) {
  const auto model = service.models().current();
  json objects = json::array();
  for (const ObjectStatus& object : service.objects()) {
    json entry = {{"name", object.name},
                  {"image_set", nullptr},
                  {"learned", nullptr},
                  {"error", or_null(object.error)}};
    if (object.acquired)
      entry["image_set"] = {{"views", object.acquired->views}, {"complete", object.acquired->complete}};
    if (object.learned_as && model && *object.learned_as < model->objects.size()) {
      const ModelObject& learned = model->objects[*object.learned_as];
      entry["learned"] = {{"views", learned.views},
                          {"rejection_distance", model->rejection_distance(*object.learned_as)},
                          {"pose_observable", learned.pose_observable},
                          {"workspace", workspace_json(learned.workspace)}};
    }
    objects.push_back(std::move(entry));
  }
  return {{"objects", std::move(objects)}};
}

}  // namespace eigenpose
