#include "daemon/cli/outcome_json.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

namespace eigenpose::cli {
namespace {

using nlohmann::json;

const ModelObject* find_object(const Model& model, const std::string& name) {
  const auto found = std::find_if(model.objects.begin(), model.objects.end(),
                                  [&](const ModelObject& object) { return object.name == name; });
  return found == model.objects.end() ? nullptr : &*found;
}

/// {"table_deg": 12.3}
json named_pose(const Hypothesis& hypothesis, const Model& model) {
  json pose = json::object();
  if (const ModelObject* object = find_object(model, hypothesis.object))
    for (std::size_t d = 0; d < hypothesis.q.size(); ++d)
      pose[object->workspace[d].name + "_" + object->workspace[d].unit] = hypothesis.q[d];
  return pose;
}

json alternative(const std::optional<Hypothesis>& hypothesis, const Model& model) {
  if (!hypothesis) return nullptr;
  return {{"object", hypothesis->object},
          {"q", hypothesis->q},
          {"pose", named_pose(*hypothesis, model)},
          {"distance", hypothesis->distance}};
}

}  // namespace

json to_json(const Outcome& outcome, const Model& model) {
  json sigma = json::array();
  for (const double s : outcome.q_sigma) sigma.push_back(std::isfinite(s) ? json(s) : json(nullptr));
  json result = {{"verdict", verdict_name(outcome.verdict)},
                 {"box", {outcome.box.x, outcome.box.y, outcome.box.width, outcome.box.height}},
                 {"object", nullptr},
                 {"q", json::array()},
                 {"pose", json::object()},
                 {"q_sigma", sigma},
                 {"q_covariance", covariance_rows(outcome)},  // infinite numbers become null
                 {"distance", nullptr},
                 {"rejection_distance", outcome.rejection_distance},
                 {"covered_share", outcome.covered_share},
                 {"confidence", outcome.confidence},
                 {"runner_up", alternative(outcome.runner_up, model)},
                 {"other_pose", alternative(outcome.other_pose, model)}};
  if (outcome.best) {
    result["object"] = outcome.best->object;
    result["q"] = outcome.best->q;
    result["pose"] = named_pose(*outcome.best, model);
    result["distance"] = outcome.best->distance;
  }
  return result;
}

}  // namespace eigenpose::cli
