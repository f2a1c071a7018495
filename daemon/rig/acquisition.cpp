#include "daemon/rig/acquisition.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

/// Positions that differ by less are the same pose: far below the resolution of any axis, far above rounding.
constexpr double same_position = 1e-6;

/// Why a picture may not show what it should.
struct Disturbance {
  std::string device;
  std::string operation;  ///< what the device did not do
  std::string cause;
  std::string advice;
};

/// The positions of one axis of a plan, by value.
class PositionIndex {
 public:
  PositionIndex(const Dof& dof, const std::vector<double>& positions) : dof_(dof) {
    for (std::size_t i = 0; i < positions.size(); ++i) sorted_.emplace_back(dof.canonical(positions[i]), i);
    std::sort(sorted_.begin(), sorted_.end());
  }
  /// Which position `value` is; nothing if it is none.
  [[nodiscard]] std::optional<std::size_t> find(double value) const {
    const auto above = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair(value, std::size_t{0}));
    // The nearest is one of its neighbours, or across the seam of a turn.
    const auto near = [&](auto candidate) {
      return candidate != sorted_.end() &&
             std::abs(dof_.difference(candidate->first, value)) <= same_position;
    };
    if (near(above)) return above->second;
    if (above != sorted_.begin() && near(std::prev(above))) return std::prev(above)->second;
    if (near(sorted_.begin())) return sorted_.begin()->second;
    if (near(std::prev(sorted_.end()))) return std::prev(sorted_.end())->second;
    return std::nullopt;
  }

 private:
  const Dof& dof_;
  std::vector<std::pair<double, std::size_t>> sorted_;  ///< canonical position, its number in the plan
};

std::string record_key(const ActuatorPosition& actuator) {
  return actuator.name + "_" + actuator.unit;
}

/// Where the set comes from, as it stands in set.json.
nlohmann::json source_of(const AcquisitionRequest& request, const std::vector<ActuatorPosition>& actuators) {
  nlohmann::json record = nlohmann::json::object();
  for (const ActuatorPosition& actuator : actuators)
    record[record_key(actuator)] =
        actuator.position ? nlohmann::json(*actuator.position) : nlohmann::json(nullptr);
  return {{"acquired_by", "eigenposed"}, {"plan", request.plan.name}, {"actuators", record}};
}

/// What a set was begun with: the number under `key`, nothing when it was not known or not there.
std::optional<double> recorded_position(const nlohmann::json& actuators, const std::string& key) {
  const auto found = actuators.find(key);
  if (found == actuators.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

/// "stood at -30 deg and stands at 30 deg now"; nothing when `actuator` stands where it stood.
std::optional<std::string> difference_of(const ActuatorPosition& actuator, std::optional<double> before) {
  const std::optional<double>& now = actuator.position;
  if (!before && !now) return std::nullopt;
  // Once for how it stood then, once for how it was moved back.
  if (before && now && actuator.distance_from(*before) <= std::max(2.0 * actuator.tolerance, same_position))
    return std::nullopt;
  const auto in_words = [&](const char* verb, const std::optional<double>& position) {
    return position ? fmt::format("{} at {:.6g} {}", verb, *position, actuator.unit)
                    : fmt::format("{} at a position that is not known", verb);
  };
  return fmt::format("{} {} and {} now", actuator.name, in_words("stood", before), in_words("stands", now));
}

/// Refuses to continue a set that was begun with another state of the rig.
/// @throws FileError saying what differs and what to do.
void check_alike(const ImageSetWriter& set, const Plan& plan,
                 const std::vector<ActuatorPosition>& actuators) {
  const nlohmann::json source = set.source();
  if (!source.empty() &&
      (!source.is_object() || source.value("acquired_by", nlohmann::json()) != "eigenposed"))
    throw FileError(
        set.folder(),
        "is an unfinished image set that no acquisition has begun; finish or remove it, or give the "
        "object another name");
  if (!source.contains("actuators") || !source["actuators"].is_object()) return;  // it says nothing of them
  const nlohmann::json& before = source["actuators"];
  std::vector<std::string> differences;
  nlohmann::json gone = before;
  for (const ActuatorPosition& actuator : actuators) {
    gone.erase(record_key(actuator));
    const bool moved_by_plan = std::any_of(plan.axes.begin(), plan.axes.end(),
                                           [&](const PlanAxis& axis) { return axis.axis == actuator.name; });
    if (moved_by_plan) continue;
    if (auto difference = difference_of(actuator, recorded_position(before, record_key(actuator))))
      differences.push_back(std::move(*difference));
  }
  for (const auto& [key, position] : gone.items())
    if (position.is_number())
      differences.push_back(fmt::format("{} stood at {} and is not configured now", key, position.dump()));
  if (differences.empty()) return;
  throw FileError(
      set.folder(),
      fmt::format("was begun with another state of the rig, and its views would not be alike: {}; put "
                  "back what differs ('eigenpose jog' with eigenposed stopped; a lamp's level in the "
                  "configuration) and acquire again, or remove the set",
                  fmt::join(differences, ", ")));
}

/// One run, on the rig's thread.
class Run {
 public:
  Run(const AcquisitionRequest& request, const AcquisitionDevices& devices, Rig::Control& axes,
      AcquisitionReport& report, const std::stop_token& stop)
      : request_(request), devices_(devices), axes_(axes), report_(report), stop_(stop) {}

  /// Moves the axes whose position changes, waits until all have come to rest, and takes the picture; again
  /// when an axis has moved or a lamp was interrupted meanwhile.
  Frame take(const std::vector<double>& q) {
    for (int retakes = 0;; ++retakes) {
      move_to(q);
      const TimePoint rest = devices_.clock.now();
      axes_.allow(request_.frame_timeout);
      Frame frame = devices_.camera.exposed_after(rest, rest + request_.frame_timeout, stop_);
      const std::optional<Disturbance> disturbance = find_disturbance(q);
      if (!disturbance) return frame;
      const auto& [device, operation, cause, advice] = *disturbance;
      if (retakes == request_.most_retakes)
        throw DeviceError(device, operation, fmt::format("{}, {} times: {}", cause, retakes + 1, advice));
      spdlog::warn("event=view_retaken device={} cause=\"{}\"", device, cause);
      ++report_.retaken;
    }
  }
  /// The pose read back after the last picture.
  [[nodiscard]] const std::vector<double>& measured() const { return measured_; }

  /// Remembers where the axes of the plan stand before they are moved.
  void note_start(const std::vector<ActuatorPosition>& actuators) {
    for (const ActuatorPosition& actuator : actuators) start_[actuator.name] = actuator.position;
  }
  /// Moves each axis of the plan back, whatever becomes of the others, until a stop is requested.
  /// @return why some do not stand there; nothing when all do.
  std::optional<std::string> return_axes() {
    const std::vector<double> first = request_.workspace.canonical(request_.plan.at(0));
    std::vector<std::string> failures;
    for (std::size_t i = 0; i < first.size() && (failures.empty() || !stop_.stop_requested()); ++i) {
      const std::string& axis = request_.plan.axes[i].axis;
      const Dof& dof = request_.workspace[i];
      double target = start_[axis].value_or(first[i]);
      // An axis at its end may be read back a little beyond it.
      if (!dof.periodic) target = std::clamp(target, dof.lower, dof.upper);
      try {
        axes_.move_to(axis, target, stop_);
      } catch (const std::exception& error) {
        failures.emplace_back(error.what());
      }
    }
    if (failures.empty()) return std::nullopt;
    return fmt::format("{}", fmt::join(failures, "; "));
  }

 private:
  void move_to(const std::vector<double>& q) {
    Duration settle{0};
    for (std::size_t i = 0; i < q.size(); ++i) {
      if (!now_.empty() && now_[i] == q[i]) continue;
      const std::string& axis = request_.plan.axes[i].axis;
      axes_.move_to(axis, q[i], stop_);
      settle = std::max(settle, axes_.settle_time(axis));
    }
    now_ = q;
    axes_.allow(settle);
    if (!devices_.clock.sleep_for(settle, stop_)) throw Interrupted();
  }

  /// Looks after a picture at `q` whether it may be kept.
  std::optional<Disturbance> find_disturbance(const std::vector<double>& q) {
    const std::vector<std::string> interrupted = axes_.light_lamps();
    const std::optional<std::size_t> strayed = find_strayed(q);
    if (strayed) now_.clear();  // where the axes stand is not known: all are moved again
    if (!interrupted.empty())
      return Disturbance{interrupted.front(), "hold its level",
                         "may have been dark during the picture: it had lost its level or its connection",
                         "check its power and cable"};
    if (!strayed) return std::nullopt;
    return Disturbance{
        request_.plan.axes[*strayed].axis, "hold its position",
        fmt::format("stood at {} after the picture, not at {}", measured_[*strayed], q[*strayed]),
        "check its brake and load"};
  }

  /// Reads every axis of the plan again. @return the first one that does not stand at `q`.
  std::optional<std::size_t> find_strayed(const std::vector<double>& q) {
    std::optional<std::size_t> strayed;
    measured_.resize(q.size());
    for (std::size_t i = 0; i < q.size(); ++i) {
      const std::string& axis = request_.plan.axes[i].axis;
      const AxisState state = axes_.state(axis);
      if (state.alarm) throw DeviceError(axis, "take a picture", *state.alarm);
      measured_[i] = state.position;
      const double tolerance = std::max(axes_.arrival_tolerance(axis), same_position);
      const bool stands = state.homed && !state.moving &&
                          std::abs(request_.workspace[i].difference(state.position, q[i])) <= tolerance;
      if (!stands && !strayed) strayed = i;
    }
    return strayed;
  }

  const AcquisitionRequest& request_;
  const AcquisitionDevices& devices_;
  Rig::Control& axes_;
  AcquisitionReport& report_;
  const std::stop_token& stop_;
  std::vector<double> now_;       ///< the pose the axes were last moved to; empty: not known
  std::vector<double> measured_;  ///< the pose read back
  std::map<std::string, std::optional<double>> start_;
};

}  // namespace

std::vector<std::vector<double>> missing_poses(const Plan& plan, const Workspace& workspace,
                                               std::span<const ViewRecord> views) {
  std::vector<PositionIndex> axes;
  for (std::size_t a = 0; a < plan.axes.size(); ++a) axes.emplace_back(workspace[a], plan.axes[a].positions);
  std::vector<bool> taken(plan.size(), false);
  for (const ViewRecord& view : views) {
    std::size_t number = 0;
    bool on_grid = view.q.size() == axes.size();
    for (std::size_t a = 0; on_grid && a < axes.size(); ++a) {
      const std::optional<std::size_t> position = axes[a].find(view.q[a]);
      on_grid = position.has_value();
      number = number * plan.axes[a].positions.size() + position.value_or(0);
    }
    if (on_grid) taken[number] = true;
  }
  std::vector<std::vector<double>> poses;
  for (std::size_t i = 0; i < taken.size(); ++i)
    if (!taken[i]) poses.push_back(workspace.canonical(plan.at(i)));
  return poses;
}

void acquire(const AcquisitionRequest& request, const AcquisitionDevices& devices, AcquisitionReport& report,
             const Progress& progress, const std::stop_token& stop) {
  report.total = request.plan.size();
  const FrameHub::OnDemand on_demand(devices.camera);
  devices.rig.run([&](Rig::Control& axes) {
    axes.light_lamps();
    const std::vector<ActuatorPosition> actuators = axes.actuators();
    ImageSetWriter set(request.image_sets, request.object, request.workspace, source_of(request, actuators));
    check_alike(set, request.plan, actuators);
    report.folder = set.folder();
    const std::vector<std::vector<double>> poses =
        missing_poses(request.plan, request.workspace, set.views());
    report.kept = report.total - poses.size();
    spdlog::info("event=acquisition_started object={} plan={} views={} kept={}", request.object,
                 request.plan.name, report.total, report.kept);
    Run run(request, devices, axes, report, stop);
    run.note_start(actuators);
    for (const std::vector<double>& q : poses) {
      if (progress) progress({"acquiring", report.kept + report.taken, report.total});
      const Frame frame = run.take(q);
      set.add(frame.image, q, nlohmann::json{{"measured_q", run.measured()}});
      ++report.taken;
    }
    set.finish();
    if (progress) progress({"acquiring", report.total, report.total});
    if (poses.empty()) return;
    report.not_returned = run.return_axes();
    if (report.not_returned)
      spdlog::warn("event=axes_not_returned object={} error=\"{}\"", request.object, *report.not_returned);
  });
  spdlog::info("event=acquisition_done object={} views={} retaken={}", request.object, report.total,
               report.retaken);
}

}  // namespace eigenpose
