#include "daemon/rig/acquisition.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "core/base/error.h"
#include "core/dataset/image_set.h"

namespace eigenpose {
namespace {

/// Positions that differ by less are the same pose: far below the resolution of any axis, far above rounding.
constexpr double same_position = 1e-6;

bool same_pose(const Workspace& workspace, const std::vector<double>& a, const std::vector<double>& b) {
  for (std::size_t i = 0; i < workspace.size(); ++i)
    if (std::abs(workspace[i].difference(a[i], b[i])) > same_position) return false;
  return true;
}

/// The poses of the plan that no view shows yet, in the plan's order.
std::vector<std::vector<double>> poses_to_take(const AcquisitionRequest& request, const ImageSetWriter& set) {
  std::vector<std::vector<double>> poses;
  for (std::size_t i = 0; i < request.plan.size(); ++i) {
    std::vector<double> q = request.workspace.canonical(request.plan.at(i));
    const bool there = std::any_of(set.views().begin(), set.views().end(), [&](const ViewRecord& view) {
      return same_pose(request.workspace, view.q, q);
    });
    if (!there) poses.push_back(std::move(q));
  }
  return poses;
}

/// Moves the axes whose position changes, one after the other. @return how long they take to settle.
Duration move_to_pose(const AcquisitionRequest& request, Rig::Control& axes, const std::vector<double>& q,
                      std::vector<double>& now, const std::stop_token& stop) {
  Duration settle{0};
  for (std::size_t i = 0; i < q.size(); ++i) {
    if (!now.empty() && now[i] == q[i]) continue;
    const std::string& axis = request.plan.axes[i].axis;
    axes.move_to(axis, q[i], stop);
    settle = std::max(settle, axes.settle_time(axis));
  }
  now = q;
  return settle;
}

}  // namespace

void acquire(const AcquisitionRequest& request, Rig& rig, FrameHub& camera, const Clock& clock,
             AcquisitionReport& report, const Progress& progress, std::stop_token stop) {
  report.total = request.plan.size();
  ImageSetWriter set(request.image_sets, request.object, request.workspace,
                     nlohmann::json{{"acquired_by", "eigenposed"}, {"plan", request.plan.name}});
  report.folder = set.folder();
  const std::vector<std::vector<double>> poses = poses_to_take(request, set);
  report.kept = report.total - poses.size();
  spdlog::info("event=acquisition_started object={} plan={} views={} kept={}", request.object,
               request.plan.name, report.total, report.kept);
  const FrameHub::OnDemand on_demand(camera);
  rig.run([&](Rig::Control& axes) {
    std::vector<double> now;
    for (const std::vector<double>& q : poses) {
      if (progress) progress({"acquiring", report.kept + report.taken, report.total});
      const Duration settle = move_to_pose(request, axes, q, now, stop);
      if (!clock.sleep_for(settle, stop)) throw Interrupted();
      const TimePoint rest = clock.now();
      const Frame frame = camera.exposed_after(rest, rest + request.frame_timeout, stop);
      set.add(frame.image, q);
      ++report.taken;
    }
    set.finish();
    if (progress) progress({"acquiring", report.total, report.total});
    const std::vector<double> first = request.workspace.canonical(request.plan.at(0));
    if (!poses.empty()) move_to_pose(request, axes, first, now, stop);
  });
  spdlog::info("event=acquisition_done object={} views={}", request.object, report.total);
}

}  // namespace eigenpose
