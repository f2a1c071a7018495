#include "daemon/composition.h"

#include <stdexcept>

#include <fmt/format.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

PlanRequest plan_request(const PlanOptions& plan) {
  PlanRequest request{plan.name, {}};
  for (const PlanAxisOptions& axis : plan.axes) {
    PlanAxisRequest asked{axis.axis, axis.at, std::nullopt};
    if (axis.spaced) asked.spacing = Spacing{axis.from, axis.to, axis.count};
    request.axes.push_back(std::move(asked));
  }
  return request;
}

Plan plan_of(const PlanOptions& plan, const std::vector<Dof>& dofs) {
  try {
    return make_plan(plan_request(plan), dofs);
  } catch (const ConfigError& error) {
    throw ConfigError(fmt::format("{}: {}", plan.place, error.what()));
  }
}

LearningOptions learning_options(const Config& config) {
  LearningOptions options;
  options.normalization.size = config.learn.size;
  options.normalization.color = config.learn.color;
  try {
    if (!config.learn.type.empty()) set_image_type(options.normalization, config.learn.type);
  } catch (const std::invalid_argument& error) {
    throw ConfigError(fmt::format("{}: [learn] type: {}", config.file.string(), error.what()));
  }
  options.solver.components = static_cast<std::size_t>(config.learn.components);
  options.solver.energy = config.learn.energy;
  options.rates = {config.learn.false_rejection, config.learn.false_acceptance};
  options.image_sets = config.image_sets().string();
  options.program_version = EIGENPOSE_VERSION;
  return options;
}

}  // namespace

ServiceOptions service_options(const Config& config) {
  ServiceOptions options;
  for (const PlanOptions& plan : config.plans) options.plans.push_back(plan_of(plan, config.dofs()));
  options.image_sets = config.image_sets();
  options.model_file = config.model_file();
  options.watch.enabled = config.watch.enabled;
  options.watch.scene.settle = config.watch.settle;
  options.watch.scene.threshold = config.watch.threshold;
  options.learning = learning_options(config);
  return options;
}

ServerOptions server_options(const ApiOptions& api) {
  ServerOptions options;
  options.limits.max_body = static_cast<std::size_t>(api.max_body_kib) * 1024;
  options.request_timeout = api.request_timeout;
  return options;
}

}  // namespace eigenpose
