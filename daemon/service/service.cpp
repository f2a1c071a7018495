#include "daemon/service/service.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <spdlog/spdlog.h>

#include "core/base/error.h"
#include "core/dataset/image_set.h"
#include "core/learning/learning.h"
#include "daemon/api/errors.h"
#include "daemon/rig/acquisition.h"

namespace eigenpose {
namespace {

constexpr int jpeg_quality = 85;

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
      throw RequestError(409, "the image set of \"" + set.object() + "\" is incomplete",
                         "acquire it again: it continues where it was");
    else
      spdlog::warn("event=set_left_out object={} reason=incomplete", set.object());
  }
  if (named < wanted.size())
    throw RequestError(404, "an object that was named has no image set", "GET /v1/objects lists them");
  if (sets.empty())
    throw RequestError(409, "no image set is complete yet",
                       "acquire an object first: eigenpose acquire NAME");
  return sets;
}

/// @throws ConfigError for an image type that is not known.
NormalizationOptions normalization_options(const LearnOptions& learn) {
  NormalizationOptions options;
  options.size = learn.size;
  options.color = learn.color;
  try {
    if (!learn.type.empty()) set_image_type(options, learn.type);
  } catch (const std::invalid_argument& wrong) {
    throw ConfigError(std::string("[learn] type: ") + wrong.what());
  }
  return options;
}

}  // namespace

Service::Service(Config config, Devices devices, const Clock& clock)
    : config_(std::move(config)),
      clock_(clock),
      devices_(std::move(devices)),
      models_(config_.model_file()),
      results_(std::make_shared<EventLog>(static_cast<std::size_t>(config_.api.event_buffer))),
      rig_(std::move(devices_.axes), std::move(devices_.lamps), clock),
      camera_(std::move(devices_.camera), clock),
      watcher_(config_.watch, camera_, models_, *results_) {
  (void)normalization_options(config_.learn);  // a wrong image type stops the start
  models_.load();
}

Service::~Service() = default;

JobStatus Service::acquire(const std::string& object, const Plan& plan) {
  check_plan(plan, config_.dofs());
  AcquisitionRequest request{object, plan, plan_workspace(plan, config_.dofs()), config_.image_sets()};
  return jobs_.start("acquire", object, [this, request = std::move(request)](const Jobs::Context& job) {
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
    return nlohmann::json{{"folder", report.folder.string()}, {"views", report.total}, {"kept", report.kept}}
        .dump();
  });
}

JobStatus Service::learn(const LearnRequest& request) {
  LearningOptions options;
  options.normalization = normalization_options(config_.learn);
  options.solver.components = static_cast<std::size_t>(request.components.value_or(config_.learn.components));
  options.solver.energy = config_.learn.energy;
  options.image_sets = config_.image_sets().string();
  options.program_version = EIGENPOSE_VERSION;
  return jobs_.start("learn", "", [this, options, wanted = request.objects](const Jobs::Context& job) {
    const std::vector<ImageSet> sets = learning_sets(config_.image_sets(), wanted);
    LearningReport report;
    const auto model = std::make_shared<const Model>(
        eigenpose::learn(all_views(sets), options, &report, job.progress, job.stop));
    models_.replace(model);
    spdlog::info("event=model_learned objects={} views={} components={} energy={:.4f} seconds={:.2f}",
                 model->objects.size(), report.views, report.solver.components, report.solver.energy,
                 std::chrono::duration<double>(report.total_time).count());
    return nlohmann::json{{"objects", model->objects.size()},
                          {"views", report.views},
                          {"components", report.solver.components},
                          {"energy", report.solver.energy},
                          {"seconds", std::chrono::duration<double>(report.total_time).count()},
                          {"file", models_.file().string()}}
        .dump();
  });
}

const Plan& Service::plan(const std::string& name) const {
  for (const Plan& plan : config_.plans)
    if (plan.name == name) return plan;
  std::string names;
  for (const Plan& plan : config_.plans) names += (names.empty() ? "" : ", ") + plan.name;
  throw RequestError(404, "there is no plan \"" + name + "\"",
                     names.empty() ? "add a [[plan]] to the configuration" : "plans: " + names);
}

std::vector<ObjectStatus> Service::objects() const {
  std::map<std::string, ObjectStatus> found;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(config_.image_sets(), error)) {
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

std::string Service::frame_jpeg() const {
  const std::optional<Frame> frame = camera_.latest();
  if (!frame)
    throw RequestError(503, camera_.status().error.value_or("the camera has not taken a picture yet"),
                       "`eigenpose status` shows the camera; try again when it runs");
  cv::Mat image = frame->image;
  // JPEG has 8 bits; a 16-bit camera keeps its upper ones.
  if (image.depth() == CV_16U) image.convertTo(image, CV_8U, 1.0 / 256.0);
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality});
  return {bytes.begin(), bytes.end()};
}

std::string Service::state() const {
  if (jobs_.running("acquire")) return "acquiring";
  return config_.watch.enabled && models_.current() ? "watching" : "idle";
}

}  // namespace eigenpose
