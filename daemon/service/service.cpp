#include "daemon/service/service.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "core/dataset/natural_order.h"

namespace eigenpose {
namespace {

constexpr int max_components = 1024;

/// The image sets to learn, and those that are left out.
struct ChosenSets {
  std::vector<ImageSet> sets;
  std::vector<std::string> left_out;
};

[[noreturn]] void refuse_named_set(const CatalogEntry& entry) {
  if (!entry.set)
    throw ServiceError(Fault::conflict, "the image set of \"" + entry.object + "\" cannot be read",
                       entry.error);
  throw ServiceError(Fault::conflict, "the image set of \"" + entry.object + "\" is incomplete",
                     "acquire it again: it continues where it was");
}

/// The complete image sets, or those that are named. @throws ServiceError (not_found, conflict).
ChosenSets choose_sets(const std::vector<CatalogEntry>& entries, const std::vector<std::string>& wanted) {
  ChosenSets chosen;
  for (const std::string& name : wanted)
    if (std::none_of(entries.begin(), entries.end(), [&](const auto& entry) { return entry.object == name; }))
      throw ServiceError(Fault::not_found, "there is no image set of \"" + name + "\"",
                         "ask for the objects there are");
  for (const CatalogEntry& entry : entries) {
    const bool named = std::find(wanted.begin(), wanted.end(), entry.object) != wanted.end();
    if (!wanted.empty() && !named) continue;
    if (entry.set && entry.set->complete()) {
      chosen.sets.push_back(*entry.set);
      continue;
    }
    if (named) refuse_named_set(entry);
    chosen.left_out.push_back(entry.object);
  }
  std::sort(chosen.sets.begin(), chosen.sets.end(),
            [](const ImageSet& a, const ImageSet& b) { return NaturalLess()(a.object(), b.object()); });
  if (chosen.sets.empty())
    throw ServiceError(Fault::conflict, "no image set is complete yet", "acquire an object first");
  return chosen;
}

/// Whether colour cannot be learned because a set has grey views.
bool is_grey(const std::vector<ImageSet>& sets) {
  return std::any_of(sets.begin(), sets.end(),
                     [](const ImageSet& set) { return !set.views().empty() && set.load(0).channels() == 1; });
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

Service::Service(ServiceOptions options, ServiceDevices devices, EventSink& events, Heartbeat& heartbeat,
                 const Clock& clock)
    : options_(std::move(options)),
      clock_(clock),
      dofs_(dofs_of(devices.axes)),
      models_(options_.model_file),
      image_sets_(options_.image_sets, heartbeat),
      rig_(std::move(devices.axes), std::move(devices.lamps), clock, heartbeat),
      camera_(std::move(devices.camera), clock, heartbeat,
              [&events](const std::optional<std::string>& error) {
                if (error)
                  events.publish(CameraLost{*error});
                else
                  events.publish(CameraFound{});
              }),
      watcher_(options_.watch, camera_, models_, events, heartbeat),
      jobs_(events, heartbeat) {
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

void Service::refuse_set_in_the_way(const std::string& object, const Workspace& workspace) {
  const std::optional<CatalogEntry> there = image_sets_.look_up(object);
  if (!there) return;
  const std::string hint = "remove the set, or give the object another name";
  if (!there->set)
    throw ServiceError(Fault::conflict, "the image set of \"" + object + "\" cannot be read: " + there->error,
                       hint);
  if (there->set->complete())
    throw ServiceError(Fault::conflict, "the image set of \"" + object + "\" is complete already", hint);
  if (there->set->workspace() != workspace)
    throw ServiceError(Fault::conflict,
                       "the unfinished image set of \"" + object + "\" has other axes than this plan",
                       "continue it with its own plan, or " + hint);
}

JobStatus Service::start_acquisition(const std::string& object, Plan plan) {
  try {
    check_object_name(object);
  } catch (const std::invalid_argument& error) {
    throw ServiceError(Fault::invalid_request, error.what(), "choose another name");
  }
  AcquisitionRequest request{object, std::move(plan), {}, options_.image_sets};
  request.workspace = plan_workspace(request.plan, dofs_);
  if (!jobs_.running(JobKind::acquire)) refuse_set_in_the_way(object, request.workspace);
  return jobs_.start(JobKind::acquire, object,
                     [this, request = std::move(request)](const Jobs::Context& job) {
                       return run_acquisition(request, job);
                     });
}

JobResult Service::run_acquisition(const AcquisitionRequest& request, const Jobs::Context& job) {
  const Watcher::Pause pause(watcher_);
  AcquisitionReport report;
  try {
    eigenpose::acquire(request, {rig_, camera_, clock_}, report, job.progress, job.stop);
  } catch (...) {
    if (!report.folder.empty())
      job.add_hint(fmt::format("{} of {} views are kept in {}: the same acquisition continues there",
                               report.kept + report.taken, report.total, report.folder.string()));
    image_sets_.look_up(request.object);
    throw;
  }
  image_sets_.look_up(request.object);
  return AcquisitionResult{report.folder, report.total, report.kept, report.retaken, report.not_returned};
}

void Service::refuse_what_cannot_be_learned(const std::vector<std::string>& objects) {
  try {
    (void)choose_sets(image_sets_.entries(), objects);
  } catch (const ServiceError&) {
    // Perhaps what is kept is a few seconds old: the files decide.
    (void)choose_sets(image_sets_.refresh(), objects);
  }
}

JobStatus Service::learn(const LearnRequest& request) {
  LearningOptions options = options_.learning;
  if (request.components) {
    if (*request.components < 1 || *request.components > max_components)
      throw ServiceError(Fault::invalid_request, fmt::format("components is {}", *request.components),
                         fmt::format("allowed: 1 to {}", max_components));
    options.solver.components = static_cast<std::size_t>(*request.components);
  }
  refuse_what_cannot_be_learned(request.objects);
  return jobs_.start(JobKind::learn, "",
                     [this, options = std::move(options), wanted = request.objects](
                         const Jobs::Context& job) { return run_learning(options, wanted, job); });
}

JobResult Service::run_learning(LearningOptions options, const std::vector<std::string>& wanted,
                                const Jobs::Context& job) {
  ChosenSets chosen = choose_sets(image_sets_.refresh(), wanted);
  if (options.normalization.color && options.normalization.type.empty() && is_grey(chosen.sets)) {
    spdlog::info("event=learning_grey reason=\"a set has grey views\"");
    options.normalization.color = false;
  }
  for (const std::string& object : chosen.left_out) spdlog::warn("event=set_left_out object={}", object);
  LearningReport report;
  std::shared_ptr<const Model> model;
  try {
    model = std::make_shared<const Model>(
        eigenpose::learn(all_views(chosen.sets), options, &report, job.progress, job.stop));
  } catch (const std::invalid_argument& error) {
    // Views and options do not suit each other; which of them is wrong only the operator knows.
    throw ServiceError(Fault::conflict, error.what(),
                       "change [learn] in the configuration, or the image sets");
  }
  models_.replace(model);
  LearningResult result{model->objects.size(),     report.views,      report.solver.components,
                        report.solver.energy,      report.total_time, models_.file(),
                        std::move(chosen.left_out)};
  spdlog::info("event=model_learned objects={} views={} components={} energy={:.4f} seconds={:.2f}",
               result.objects, result.views, result.components, result.energy, result.time.count());
  return result;
}

void Service::stop_motion() noexcept {
  rig_.stop_motion();
  try {
    if (const auto job = jobs_.running(JobKind::acquire)) jobs_.cancel(job->id);
  } catch (const std::exception& error) {
    spdlog::error("event=cancel_failed error=\"{}\"", error.what());
  }
}

std::vector<ObjectStatus> Service::objects() const {
  std::map<std::string, ObjectStatus> found;
  for (const CatalogEntry& entry : image_sets_.entries()) {
    ObjectStatus& object = found[entry.object];
    object.name = entry.object;
    if (entry.set)
      object.acquired = ObjectStatus::Acquired{entry.set->views().size(), entry.set->complete()};
    else
      object.error = entry.error;
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

NewestFrame Service::newest_frame() const {
  std::optional<Frame> frame = camera_.latest();
  const std::optional<std::string> error = camera_.status().error;
  const std::string hint = "`eigenpose status` shows the camera; try again when it runs";
  if (!frame)
    throw ServiceError(Fault::unavailable, error.value_or("the camera has not taken a picture yet"), hint);
  const Duration age = clock_.now() - frame->exposure_start;
  if (age > options_.stale_frame)
    throw ServiceError(
        Fault::unavailable,
        fmt::format("the newest frame is {:.0f} s old{}{}", std::chrono::duration<double>(age).count(),
                    error ? ": " : "", error.value_or("")),
        hint);
  return {*std::move(frame), age};
}

ServiceActivity Service::activity() const {
  if (const auto job = jobs_.running(JobKind::acquire)) return {ServiceState::acquiring, job->started};
  const bool watches = options_.watch.enabled && models_.current();
  return {watches ? ServiceState::watching : ServiceState::idle, started_};
}

}  // namespace eigenpose
