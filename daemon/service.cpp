#include "daemon/service.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <spdlog/spdlog.h>

#include "core/base/error.h"
#include "core/image/image_set.h"
#include "daemon/acquisition.h"
#include "daemon/api/errors.h"

namespace eigenpose {
namespace {

constexpr int jpeg_quality = 85;

}  // namespace

Service::Service(Config config, Devices devices, const Clock& clock)
    : config_(std::move(config)),
      clock_(clock),
      devices_(std::move(devices)),
      models_(config_.model_file()),
      results_(std::make_shared<EventLog>(static_cast<std::size_t>(config_.api.event_buffer))),
      rig_(std::move(devices_.axes), std::move(devices_.lamps), clock),
      camera_(std::move(devices_.camera), clock) {}

Service::~Service() = default;

JobStatus Service::acquire(const std::string& object, const Plan& plan) {
  check_plan(plan, config_.dofs());
  AcquisitionRequest request{object, plan, plan_workspace(plan, config_.dofs()), config_.image_sets()};
  return jobs_.start("acquire", object, [this, request = std::move(request)](const Jobs::Context& job) {
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
