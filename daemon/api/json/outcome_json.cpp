#include "daemon/api/json/outcome_json.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>

#include <nlohmann/json.hpp>

namespace eigenpose {
namespace {

using nlohmann::json;

const ModelObject* find_object(const Model& model, const std::string& name) {
  const auto found = std::find_if(model.objects.begin(), model.objects.end(),
                                  [&](const ModelObject& object) { return object.name == name; });
  return found == model.objects.end() ? nullptr : &*found;
}

bool is_observable(const ModelObject* object, std::size_t dof) {
  return object == nullptr || dof >= object->dof_observable.size() || object->dof_observable[dof];
}

json finite_or_null(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

/// {"table_deg": 12.3}: each value under its DOF's name and unit.
json by_name(const json& values, const ModelObject* object) {
  json named = json::object();
  if (object == nullptr) return named;
  for (std::size_t d = 0; d < values.size() && d < object->workspace.size(); ++d)
    named[object->workspace[d].name + "_" + object->workspace[d].unit] = values[d];
  return named;
}

/// q, a value that cannot be observed as null. @param sigma infinite says so too; empty: not known.
json observed(const Hypothesis& hypothesis, const ModelObject* object, std::span<const double> sigma) {
  json values = json::array();
  for (std::size_t d = 0; d < hypothesis.q.size(); ++d) {
    const bool known = is_observable(object, d) && (d >= sigma.size() || std::isfinite(sigma[d]));
    values.push_back(known ? json(hypothesis.q[d]) : json(nullptr));
  }
  return values;
}

json alternative(const std::optional<Hypothesis>& hypothesis, const Model& model) {
  if (!hypothesis) return nullptr;
  const ModelObject* object = find_object(model, hypothesis->object);
  const json q = observed(*hypothesis, object, {});
  return {{"object", hypothesis->object},
          {"q", q},
          {"pose", by_name(q, object)},
          {"distance", hypothesis->distance}};
}

}  // namespace

json outcome_json(const Outcome& outcome, const Model& model) {
  json sigma = json::array();
  for (const double value : outcome.q_sigma) sigma.push_back(finite_or_null(value));
  json result = {{"verdict", verdict_name(outcome.verdict)},
                 {"box", {outcome.box.x, outcome.box.y, outcome.box.width, outcome.box.height}},
                 {"object", nullptr},
                 {"q", json::array()},
                 {"pose", json::object()},
                 {"pose_sigma", json::object()},
                 {"q_sigma", sigma},
                 {"q_covariance", covariance_rows(outcome)},  // infinite values become null
                 {"distance", nullptr},
                 {"evidence", outcome.evidence},
                 {"required_evidence", outcome.required_evidence},
                 {"covered_share", outcome.covered_share},
                 {"confidence", outcome.confidence},
                 {"unfinished", outcome.unfinished},
                 {"runner_up", alternative(outcome.runner_up, model)},
                 {"other_pose", alternative(outcome.other_pose, model)}};
  if (outcome.best) {
    const ModelObject* object = find_object(model, outcome.best->object);
    result["object"] = outcome.best->object;
    result["q"] = observed(*outcome.best, object, outcome.q_sigma);
    result["pose"] = by_name(result["q"], object);
    result["pose_sigma"] = by_name(sigma, object);
    result["distance"] = outcome.best->distance;
  }
  return result;
}

}  // namespace eigenpose
