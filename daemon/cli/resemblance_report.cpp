#include "daemon/cli/resemblance_report.h"

#include <cstdio>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/evaluation/resemblance.h"

namespace eigenpose::cli {
namespace {

constexpr std::size_t most_lines = 8;  ///< of each kind

nlohmann::json to_json(const Model& model, const std::vector<Resemblance>& all) {
  nlohmann::json list = nlohmann::json::array();
  for (const Resemblance& one : all)
    list.push_back({{"first", model.objects[one.first].name},
                    {"first_q", one.first_q},
                    {"second", model.objects[one.second].name},
                    {"second_q", one.second_q},
                    {"distance", one.distance},
                    {"share", one.share}});
  return list;
}

std::string pose_text(const ModelObject& object, const std::vector<double>& q) {
  std::string text;
  for (std::size_t d = 0; d < q.size(); ++d)
    text += fmt::format("{}{:.0f} {}", d > 0 ? ", " : "", q[d], object.workspace[d].unit);
  return text;
}

void print(const Model& model, const std::vector<Resemblance>& all, const char* title) {
  if (all.empty()) return;
  std::printf("\n%s\n", title);
  for (std::size_t i = 0; i < std::min(all.size(), most_lines); ++i) {
    const Resemblance& one = all[i];
    const ModelObject& first = model.objects[one.first];
    const ModelObject& second = model.objects[one.second];
    std::printf(
        "  %-34s %-34s distance %.4f, %.0f %% of the poses\n",
        (first.name + " at " + pose_text(first, one.first_q)).c_str(),
        ((one.first == one.second ? "itself" : second.name) + " at " + pose_text(second, one.second_q))
            .c_str(),
        one.distance, 100.0 * one.share);
  }
  if (all.size() > most_lines)
    std::printf("  and %zu more: eigenpose inspect --json has them all\n", all.size() - most_lines);
}

}  // namespace

nlohmann::json resemblance_json(const Model& model) {
  return {{"objects", to_json(model, alike_objects(model))}, {"poses", to_json(model, alike_poses(model))}};
}

void print_resemblance(const Model& model) {
  print(model, alike_objects(model),
        "objects that look alike: a view of one would pass for the other, were it not known itself");
  print(model, alike_poses(model), "poses that look like another of the same object");
}

}  // namespace eigenpose::cli
