#include "daemon/service/service.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "daemon/rig/acquisition.h"

namespace eigenpose {
namespace {

constexpr int max_components = 1024;

/// The complete image sets, or those that are named.
std::vector<ImageSet> learning_sets(const std::filesystem::path& folder,
                                    const std::vector<std::string>& wanted) {
  std::vector<ImageSet> sets;
  std::size_t named = 0;
  for (ImageSet& set : open_image_sets(folder)) {
    const bool is_named = std::find(wanted.begin(), wanted.end(), set.object()) != wanted.end();
    named += is_named ? 1 : 0;
    if (!wanted.empty() && !is_named) continue;
    if (set.complete())
      sets.push_back(std::move(set));
    else if (is_named)
      throw ServiceError(Fault::conflict, "the image set of \"" + set.object() + "\" is incomplete",
                         "acquire it again: it continues where it was");
    else
      spdlog::warn("event=set_left_out object={} reason=incomplete", set.object());
  }
  if (named < wanted.size())
    throw ServiceError(Fault::not_found, "an object that was named has no image set",
                       "ask for the objects there are");
  if (sets.empty())
    throw ServiceError(Fault::conflict, "no image set is complete yet", "acquire an object first");
  return sets;
}

std::vector<Dof> dofs_of(const std::vector<RigAxis>& axes) {
  std::vector<Dof> dofs;
  for (const RigAxis& axis : axes) dofs.push_back(axis.options.dof);
  return dofs;
}

}  // namespace

std::string_view service_state_name(ServiceState state) {
  switch (state) {
    case ServiceState::acquiring:
      return "acquiring";
    case ServiceState::watching:
      return "watching";
    case ServiceState::idle:
      return "idle";
  }
  return "idle";
}

Service::Service(ServiceOptions options, ServiceDevices devices, EventSink& events, const Clock& clock)
    : options_(std::move(options)),
      clock_(clock),
      dofs_(dofs_of(devices.axes)),
      models_(options_.model_file),
      rig_(std::move(devices.axes), std::move(devices.lamps), clock),
      camera_(std::move(devices.camera), clock),
      watcher_(options_.watch, camera_, models_, events),
      jobs_(events) {
  models_.load();
}

Service::~Service() = default;

JobStatus Service::acquire(const std::string& object, const PlanRequest& plan) {
  return start_acquisition(object, make_plan(plan, dofs_));
}

JobStatus Service::acquire(const std::string& object, const std::string& plan_name) {
  for (const Plan& plan : options_.plans)
    if (plan.name == plan_name) return start_acquisition(object, plan);
  std::string names;
  for (const Plan& plan : options_.plans) names += (names.empty() ? "" : ", ") + plan.name;
  throw ServiceError(Fault::not_found, "there is no plan \"" + plan_name + "\"",
                     names.empty() ? "add a [[plan]] to the configuration" : "plans: " + names);
}

JobStatus Service::start_acquisition(const std::string& object, Plan plan) {
  AcquisitionRequest request{object, std::move(plan), {}, options_.image_sets};
  request.workspace = plan_workspace(request.plan, dofs_);
  return jobs_.start(
      JobKind::acquire, object, [this, request = std::move(request)](const Jobs::Context& job) {
        const Watcher::Pause pause(watcher_);
        AcquisitionReport report;
        try {
          eigenpose::acquire(request, rig_, camera_, clock_, report, job.progress, job.stop);
        } catch (...) {
          if (!report.folder.empty())
            job.add_hint(fmt::format("{} of {} views are kept in {}: the same acquisition continues there",
                                     report.kept + report.taken, report.total, report.folder.string()));
          throw;
        }
        return AcquisitionResult{report.folder, report.total, report.kept};
      });
}

JobStatus Service::learn(const LearnRequest& request) {
  LearningOptions options = options_.learning;
  if (request.components) {
    if (*request.components < 1 || *request.components > max_components)
      throw ServiceError(Fault::invalid_request, fmt::format("components is {}", *request.components),
                         fmt::format("allowed: 1 to {}", max_components));
    options.solver.components = static_cast<std::size_t>(*request.components);
  }
  return jobs_.start(
      JobKind::learn, "", [this, options, wanted = request.objects](const Jobs::Context& job) -> JobResult {
        const std::vector<ImageSet> sets = learning_sets(options_.image_sets, wanted);
        LearningReport report;
        const auto model = std::make_shared<const Model>(
            eigenpose::learn(all_views(sets), options, &report, job.progress, job.stop));
        models_.replace(model);
        const LearningResult result{model->objects.size(), report.views,      report.solver.components,
                                    report.solver.energy,  report.total_time, models_.file()};
        spdlog::info("event=model_learned objects={} views={} components={} energy={:.4f} seconds={:.2f}",
                     result.objects, result.views, result.components, result.energy, result.time.count());
        return result;
      });
}

std::vector<ObjectStatus> Service::objects() const {
  std::map<std::string, ObjectStatus> found;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(options_.image_sets, error)) {
    if (!std::filesystem::exists(entry.path() / "set.json")) continue;
    ObjectStatus object;
    object.name = entry.path().filename().string();
    try {
      const ImageSet set = ImageSet::open(entry.path());
      object.name = set.object();
      object.acquired = ObjectStatus::Acquired{set.views().size(), set.complete()};
    } catch (const Error& trouble) {
      object.trouble = trouble.what();
    }
    found[object.name] = object;
  }
  if (const auto model = models_.current()) {
    for (std::size_t i = 0; i < model->objects.size(); ++i) {
      ObjectStatus& object = found[model->objects[i].name];
      object.name = model->objects[i].name;
      object.learned_as = i;
    }
  }
  std::vector<ObjectStatus> result;
  for (auto& [name, object] : found) result.push_back(std::move(object));
  return result;
}

Frame Service::newest_frame() const {
  std::optional<Frame> frame = camera_.latest();
  if (!frame)
    throw ServiceError(Fault::unavailable,
                       camera_.status().error.value_or("the camera has not taken a picture yet"),
                       "`eigenpose status` shows the camera; try again when it runs");
  return *std::move(frame);
}

ServiceState Service::state() const {
  if (jobs_.running(JobKind::acquire)) return ServiceState::acquiring;
  return options_.watch.enabled && models_.current() ? ServiceState::watching : ServiceState::idle;
}

}  // namespace eigenpose
