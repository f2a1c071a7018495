#include "daemon/service/service.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>
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
  std::vector<LeftOutDetail> left_out;
};

/// Why an image set cannot be learned, and what to do.
struct Trouble {
  std::string what;
  std::string hint;

  [[nodiscard]] std::string text() const { return what + ": " + hint; }
};

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// The folders of all image sets of an object that can be read: "mug, mug2".
std::vector<std::string> folders_of(const std::vector<CatalogEntry>& entries, const std::string& object) {
  std::vector<std::string> folders;
  for (const CatalogEntry& entry : entries)
    if (entry.set && entry.object == object) folders.push_back(entry.set->folder().filename().string());
  return folders;
}

Trouble doubled(const std::vector<std::string>& folders, const std::string& object) {
  return {fmt::format("the folders {} all hold an image set of \"{}\"", fmt::join(folders, ", "), object),
          "remove all but one of them"};
}

std::optional<Trouble> trouble_with(const CatalogEntry& entry, const std::vector<CatalogEntry>& entries) {
  const std::string set = "the image set of \"" + entry.object + "\"";
  if (!entry.set) return Trouble{set + " cannot be read", entry.error};
  if (const std::vector<std::string> folders = folders_of(entries, entry.object); folders.size() > 1)
    return doubled(folders, entry.object);
  if (!entry.set->complete())
    return Trouble{set + " is incomplete", "acquire it again: it continues where it was"};
  return std::nullopt;
}

/// The image sets that are named, or else all that can be learned. What would take an object out of the model
/// that is named, or that the former model knows and has an image set, is refused.
/// @throws ServiceError (not_found, conflict).
ChosenSets choose_sets(const std::vector<CatalogEntry>& entries, const std::vector<std::string>& wanted,
                       const std::vector<std::string>& former) {
  for (const std::string& name : wanted)
    if (std::none_of(entries.begin(), entries.end(), [&](const auto& entry) { return entry.object == name; }))
      throw ServiceError(Fault::not_found, "there is no image set of \"" + name + "\"",
                         "ask for the objects there are");
  ChosenSets chosen;
  for (const CatalogEntry& entry : entries) {
    const bool named = contains(wanted, entry.object);
    if (!wanted.empty() && !named) continue;
    const std::optional<Trouble> trouble = trouble_with(entry, entries);
    if (!trouble) {
      chosen.sets.push_back(*entry.set);
      continue;
    }
    if (named) throw ServiceError(Fault::conflict, trouble->what, trouble->hint);
    if (contains(former, entry.object))
      throw ServiceError(Fault::conflict,
                         trouble->what + ", and the model in use would lose \"" + entry.object + "\"",
                         trouble->hint + "; or name the objects to learn, without this one");
    chosen.left_out.push_back({entry.object, true, 0, trouble->text()});
  }
  std::sort(chosen.sets.begin(), chosen.sets.end(),
            [](const ImageSet& a, const ImageSet& b) { return NaturalLess()(a.object(), b.object()); });
  if (chosen.sets.empty())
    throw ServiceError(Fault::conflict, "no image set is complete yet", "acquire an object first");
  return chosen;
}

/// What could not be used, object by object.
std::vector<LeftOutDetail> details_of(const std::vector<LeftOut>& left_out) {
  std::vector<LeftOutDetail> details;
  for (const LeftOut& what : left_out) {
    auto found = std::find_if(details.begin(), details.end(),
                              [&](const LeftOutDetail& detail) { return detail.object == what.object; });
    if (found == details.end())
      found = details.insert(found, {what.object, what.whole_object, 0, what.text()});
    if (what.whole_object) {
      found->whole_object = true;
      found->reason = what.text();
    } else {
      ++found->views;
    }
  }
  return details;
}

/// Nothing that was asked for, or is in the model in use and has an image set, may be lost unnoticed.
/// @param kept names of such objects. @throws ServiceError (conflict).
void refuse_lost_objects(const std::vector<std::string>& kept, const Model& model,
                         const std::vector<LeftOutDetail>& left_out) {
  for (const std::string& name : kept) {
    if (std::ranges::find(model.objects, name, &ModelObject::name) != model.objects.end()) continue;
    const auto why = std::ranges::find(left_out, name, &LeftOutDetail::object);
    throw ServiceError(Fault::conflict,
                       "\"" + name + "\" cannot be learned, and the former model stays in use: " +
                           (why == left_out.end() ? "it was left out" : why->reason),
                       "mend or remove its image set, or name the objects to learn, without this one");
  }
}

/// The names in their order, each once, of what is not in the model at all.
std::vector<std::string> names_of(const std::vector<LeftOutDetail>& left_out) {
  std::set<std::string> names;
  for (const LeftOutDetail& detail : left_out)
    if (detail.whole_object) names.insert(detail.object);
  return {names.begin(), names.end()};
}

std::vector<std::string> names_of(const std::shared_ptr<const Model>& model) {
  std::vector<std::string> names;
  if (model)
    for (const ModelObject& object : model->objects) names.push_back(object.name);
  return names;
}

void log_left_out(const std::vector<LeftOutDetail>& left_out) {
  for (const LeftOutDetail& detail : left_out)
    if (detail.whole_object)
      spdlog::warn("event=set_left_out object={} reason=\"{}\"", detail.object, detail.reason);
    else
      spdlog::warn("event=views_left_out object={} views={} first=\"{}\"", detail.object, detail.views,
                   detail.reason);
}

/// Whether the first view of the set that can be read is grey.
bool is_grey(const ImageSet& set) {
  for (std::size_t i = 0; i < set.views().size(); ++i) try {
      return set.load(i).channels() == 1;
    } catch (const FileError&) {  // learning says which views cannot be read
    }
  return false;
}

/// Whether colour cannot be learned because a set has grey views.
bool has_grey_set(const std::vector<ImageSet>& sets) {
  return std::any_of(sets.begin(), sets.end(), [](const ImageSet& set) { return is_grey(set); });
}

/// Learns the sets. @throws ServiceError (conflict) where views and options do not suit each other: which of
/// them is wrong only the operator knows.
Model learned_model(const std::vector<ImageSet>& sets, const LearningOptions& options, LearningReport& report,
                    const Jobs::Context& job) {
  const auto conflict = [](const std::exception& error) {
    return ServiceError(Fault::conflict, error.what(),
                        "change [learn] in the configuration, or the image sets");
  };
  try {
    return eigenpose::learn(all_views(sets), options, &report, job.progress, job.stop);
  } catch (const FileError&) {
    throw;
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw conflict(error);
  } catch (const std::invalid_argument& error) {
    throw conflict(error);
  }
}

std::vector<Dof> dofs_of(const std::vector<RigAxis>& axes) {
  std::vector<Dof> dofs;
  dofs.reserve(axes.size());
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
  const std::string hint = "remove the set, or give the object another name";
  for (const std::string& folder : folders_of(image_sets_.entries(), object))
    if (folder != object)
      throw ServiceError(
          Fault::conflict,
          fmt::format("the folder \"{}\" holds an image set of \"{}\" already", folder, object), hint);
  const std::optional<CatalogEntry> there = image_sets_.look_up(object);
  if (!there) return;
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
    (void)choose_sets(image_sets_.entries(), objects, names_of(models_.current()));
  } catch (const ServiceError&) {
    // Perhaps what is kept is a few seconds old: the files decide.
    (void)choose_sets(image_sets_.refresh(), objects, names_of(models_.current()));
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
  const std::vector<std::string> former = names_of(models_.current());
  ChosenSets chosen = choose_sets(image_sets_.refresh(), wanted, former);
  if (options.normalization.color && options.normalization.type.empty() && has_grey_set(chosen.sets)) {
    spdlog::info("event=learning_grey reason=\"a set has grey views\"");
    options.normalization.color = false;
  }
  LearningReport report;
  const auto model = std::make_shared<const Model>(learned_model(chosen.sets, options, report, job));
  std::vector<LeftOutDetail> left_out = std::move(chosen.left_out);
  std::ranges::move(details_of(report.left_out), std::back_inserter(left_out));
  std::vector<std::string> kept = wanted;
  if (wanted.empty()) {
    for (const std::string& name : former) {
      const bool has_set = std::ranges::find(chosen.sets, name, &ImageSet::object) != chosen.sets.end();
      if (has_set)
        kept.push_back(name);
      else
        left_out.push_back({name, true, 0, name + ": has no image set any more"});
    }
  }
  log_left_out(left_out);
  refuse_lost_objects(kept, *model, left_out);
  models_.replace(model);
  LearningResult result{model->objects.size(), report.views,   report.solver.components, report.solver.energy,
                        report.total_time,     models_.file(), names_of(left_out),       left_out};
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
  const std::vector<CatalogEntry> entries = image_sets_.entries();
  for (const CatalogEntry& entry : entries) {
    ObjectStatus& object = found[entry.object];
    object.name = entry.object;
    const std::vector<std::string> folders = folders_of(entries, entry.object);
    if (!entry.set)
      object.error = entry.error;
    else if (folders.size() > 1)
      object.error = doubled(folders, entry.object).text();
    else
      object.acquired = ObjectStatus::Acquired{entry.set->views().size(), entry.set->complete()};
  }
  if (const auto model = models_.current()) {
    for (std::size_t i = 0; i < model->objects.size(); ++i) {
      ObjectStatus& object = found[model->objects[i].name];
      object.name = model->objects[i].name;
      object.learned_as = i;
    }
  }
  std::vector<ObjectStatus> result;
  result.reserve(found.size());
  for (auto& [name, object] : found) result.push_back(std::move(object));
  return result;
}

NewestFrame Service::newest_frame() const {
  std::optional<Frame> frame = camera_.latest();
  const std::optional<std::string> error = camera_.status().error;
  const std::string hint =
      watcher_.status().paused
          ? "an acquisition takes pictures only where its plan needs one; try again when it has ended"
          : "`eigenpose status` shows the camera; try again when it runs";
  if (!frame)
    throw ServiceError(Fault::unavailable, error.value_or("the camera has not taken a picture yet"), hint);
  const Duration age = age_of(frame->exposure_start);
  if (age > options_.stale_frame)
    throw ServiceError(
        Fault::unavailable,
        fmt::format("the newest frame is {:.0f} s old{}{}", std::chrono::duration<double>(age).count(),
                    error ? ": " : "", error.value_or("")),
        hint);
  return {*std::move(frame), age};
}

bool Service::is_current(std::uint64_t result_frame) const {
  return watcher_.status().current_result == result_frame && !camera_.status().error;
}

ServiceActivity Service::activity() const {
  if (const auto job = jobs_.running(JobKind::acquire)) return {ServiceState::acquiring, job->started};
  const bool watches = options_.watch.enabled && models_.current();
  return {watches ? ServiceState::watching : ServiceState::idle, started_};
}

}  // namespace eigenpose
