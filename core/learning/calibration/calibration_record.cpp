#include "core/learning/calibration/calibration_record.h"

#include <algorithm>
#include <array>

#include "core/recognition/model_searches.h"

namespace eigenpose {
namespace {

/// All views are shown again when more than this share of the objects has changed since they were.
constexpr double most_changed = 0.25;

using Places = std::span<const std::optional<std::size_t>>;

/// The same probes, the objects at their new places. @return false where one of them left.
bool move_objects(Places places, ShownProbes& shown) {
  bool all = true;
  const auto move = [&](std::size_t& object) {
    if (places[object])
      object = *places[object];
    else
      all = false;
  };
  move(shown.object);
  for (std::size_t& rival : shown.rivals) move(rival);
  for (Probe& probe : shown.probes) {
    move(probe.object);
    move(probe.taken_for);
    if (probe.windows) move(probe.windows->taken_for);
    if (probe.occluded) move(probe.occluded->taken_for);
  }
  return all;
}

}  // namespace

CalibrationRecord carry_over(const CalibrationRecord& kept, Places places, std::size_t objects) {
  const auto staying = static_cast<std::size_t>(std::ranges::count_if(
      places, [](const std::optional<std::size_t>& place) { return place.has_value(); }));
  CalibrationRecord result;
  result.measured_among = kept.measured_among;
  result.changes = kept.changes + (places.size() - staying) + (objects - staying);
  if (kept.objects.empty() ||
      static_cast<double>(result.changes) > most_changed * static_cast<double>(kept.measured_among))
    return {};
  result.objects.resize(objects);
  for (std::size_t o = 0; o < places.size(); ++o)
    if (places[o]) result.objects[*places[o]] = kept.objects[o];
  for (ShownProbes shown : kept.shown) {
    if (!places[shown.object]) continue;
    if (!move_objects(places, shown)) {
      shown.probes.clear();
      shown.rivals.clear();
    }
    result.shown.push_back(std::move(shown));
  }
  std::ranges::sort(result.shown, {},
                    [](const ShownProbes& shown) { return std::pair(shown.object, shown.view); });
  return result;
}

void drop_within_reach(CalibrationRecord& record, const Model& model, const TrainingViews& views,
                       const Eigen::MatrixXd& points) {
  const auto joined = [&](std::size_t object) { return record.objects[object].misalignments.empty(); };
  const ModelSearches searches(model);
  for (ShownProbes& shown : record.shown) {
    // Its own manifold, and one other.
    std::array<ClosestPoint, 2> near;
    const auto view = static_cast<Eigen::Index>(views.objects()[shown.object].first + shown.view);
    const std::size_t count = searches.all->nearest_into(points.col(view).cast<float>(), near);
    if (std::any_of(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count),
                    [&](const ClosestPoint& point) { return joined(point.manifold); }))
      shown.probes.clear();
  }
}

}  // namespace eigenpose
