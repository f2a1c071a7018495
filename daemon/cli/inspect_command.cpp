/// `eigenpose inspect`: what a model file holds.

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/base/printable.h"
#include "core/model/model_file.h"
#include "daemon/cli/commands.h"
#include "daemon/cli/geometry_report.h"
#include "daemon/cli/learning_options.h"
#include "daemon/cli/resemblance_report.h"

namespace eigenpose::cli {
namespace {

using nlohmann::json;

constexpr const char* inspect_examples = R"(
The file is checked as a whole first; a damaged one is refused. It is HDF5: Python, MATLAB and h5dump open it too.

Examples:
  eigenpose inspect lab.model
  eigenpose inspect lab.model --geometry
  eigenpose inspect lab.model --json)";

struct InspectOptions {
  std::string model;
  bool geometry = false;
  bool as_json = false;
};

/// Thresholds at which the curve is shown: the one in use, and nine along the evidence of all probes.
std::vector<double> curve_points(const DecisionModel& decision) {
  std::vector<double> all = decision.known;
  all.insert(all.end(), decision.unknown.begin(), decision.unknown.end());
  std::ranges::sort(all);
  std::vector<double> points{decision.required};
  constexpr std::size_t shown = 9;
  for (std::size_t i = 0; !all.empty() && i < shown; ++i)
    points.push_back(all[i * (all.size() - 1) / (shown - 1)]);
  std::ranges::sort(points);
  points.erase(std::unique(points.begin(), points.end()), points.end());
  return points;
}

json decision_json(const DecisionModel& decision) {
  const auto rates = [](const DecisionRates& some) {
    return json{{"false_rejection", some.false_rejection}, {"false_acceptance", some.false_acceptance}};
  };
  json curve = json::array();
  for (const double required : curve_points(decision)) {
    json point = rates(rates_at(decision, required));
    point["evidence"] = required;
    curve.push_back(std::move(point));
  }
  return {{"required_evidence", decision.required},
          {"settled_evidence", decision.settled},
          {"set", rates(decision.set)},
          {"expected", rates(decision.expected)},
          {"smallest_rate", decision.smallest_rate()},
          {"curve", curve}};
}

json to_json(const Model& model) {
  json objects = json::array();
  for (std::size_t o = 0; o < model.objects.size(); ++o) {
    const ModelObject& object = model.objects[o];
    json axes = json::array();
    for (std::size_t d = 0; d < object.workspace.size(); ++d) {
      const Dof& dof = object.workspace[d];
      axes.push_back({{"name", dof.name},
                      {"unit", dof.unit},
                      {"lower", dof.lower},
                      {"upper", dof.upper},
                      {"periodic", dof.periodic},
                      {"values", object.manifold.axes()[d].samples.size()},
                      {"observable", static_cast<bool>(object.dof_observable[d])}});
    }
    objects.push_back({{"name", object.name},
                       {"views", object.views},
                       {"rejection_distance", model.rejection_distance(o)},
                       {"typical_distance", model.objects[o].typical_distance},
                       {"bytes", model.memory(o)},
                       {"pose_observable", object.pose_observable},
                       {"spline_degree", object.manifold.degree()},
                       {"workspace", axes}});
  }
  const Eigen::VectorXd& values = model.eigenspace.eigenvalues;
  return {{"size", model.normalization.size},
          {"color", model.normalization.color},
          {"type", image_type_name(model.normalization)},
          {"cropped", model.normalization.cropped},
          {"components", model.eigenspace.components()},
          {"appearance_length", model.eigenspace.length()},
          {"eigenvalues", std::vector<double>(values.data(), values.data() + values.size())},
          {"total_scatter", model.eigenspace.total_scatter},
          {"provenance",
           {{"program_version", model.provenance.program_version},
            {"created", model.provenance.created},
            {"image_sets", model.provenance.image_sets},
            {"solver", model.provenance.solver},
            {"energy", model.provenance.energy},
            {"energy_bound", model.provenance.energy_bound}}},
          {"decision", decision_json(model.decision)},
          {"objects", objects}};
}

/// Both rates along the evidence that may be required; the threshold in use is marked.
void print_curve(const DecisionModel& decision) {
  std::printf("\n%9s %17s %18s   by %zu views as known, %zu as unknown\n", "evidence", "false rejections",
              "false acceptances", decision.known.size(), decision.unknown.size());
  for (const double required : curve_points(decision)) {
    const DecisionRates rates = rates_at(decision, required);
    std::printf("%9.1f %15.2f %% %16.2f %%%s\n", required, 100.0 * rates.false_rejection,
                100.0 * rates.false_acceptance, required == decision.required ? "   <- required" : "");
  }
}

void print(const Model& model) {
  std::printf("learned   %s by eigenpose %s from %s\n", printable(model.provenance.created).c_str(),
              printable(model.provenance.program_version).c_str(),
              printable(model.provenance.image_sets).c_str());
  std::printf("views     %dx%d %s, %s\n", model.normalization.size, model.normalization.size,
              image_type_name(model.normalization).c_str(),
              model.normalization.cropped ? "each picture taken whole" : "objects cut out of each picture");
  std::printf("space     %td dimensions by %s keep %s\n", model.eigenspace.components(),
              model.provenance.solver.c_str(),
              energy_text(model.provenance.energy, model.provenance.energy_bound).c_str());
  std::printf("\n%-16s %6s %18s %9s %8s  %s\n", "object", "views", "rejection distance", "typical", "memory",
              "degrees of freedom");
  for (std::size_t o = 0; o < model.objects.size(); ++o) {
    const ModelObject& object = model.objects[o];
    std::printf("%-16s %6zu %18.4f %9.4f %5.2f MB  ", object.name.c_str(), object.views,
                model.rejection_distance(o), model.objects[o].typical_distance,
                static_cast<double>(model.memory(o)) / 1e6);
    for (std::size_t d = 0; d < object.workspace.size(); ++d) {
      const Dof& dof = object.workspace[d];
      std::printf("%s%s: %zu values in %g…%g %s%s%s", d > 0 ? "; " : "", printable(dof.name).c_str(),
                  object.manifold.axes()[d].samples.size(), dof.lower, dof.upper, printable(dof.unit).c_str(),
                  dof.periodic ? ", periodic" : "", object.dof_observable[d] ? "" : ", not observable");
    }
    std::printf("\n");
  }
  print_curve(model.decision);
}

int run_inspect(const InspectOptions& options) {
  const Model model = load_model(options.model);
  if (options.as_json) {
    json all = to_json(model);
    all["alike"] = resemblance_json(model);
    if (options.geometry)
      for (std::size_t o = 0; o < model.objects.size(); ++o)
        all["objects"][o]["geometry"] = geometry_json(model.objects[o]);
    std::printf("%s\n", all.dump(2, ' ', false, json::error_handler_t::replace).c_str());
  } else {
    print(model);
    print_resemblance(model);
    if (options.geometry) print_geometry(model);
  }
  return exit_done;
}

}  // namespace

void add_inspect_command(CLI::App& app, CommandLine& line) {
  auto options = std::make_shared<InspectOptions>();
  CLI::App* command = app.add_subcommand("inspect", "Show what a model file holds");
  command->footer(inspect_examples);
  command->add_option("model", options->model, "The model file")->required();
  command->add_flag("--geometry", options->geometry,
                    "Tangent, normal and curvature of the manifolds (all vectors with --json)");
  command->add_flag("--json", options->as_json, "Print it as JSON");
  command->callback([options, &line] { line.action = [options] { return run_inspect(*options); }; });
}

}  // namespace eigenpose::cli
