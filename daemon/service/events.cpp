#include "daemon/service/events.h"

#include <fmt/format.h>

namespace eigenpose {

const Workspace* workspace_of(const SceneResult& result, std::string_view object) {
  if (result.model == nullptr) return nullptr;
  for (const ModelObject& learned : result.model->objects)
    if (learned.name == object) return &learned.workspace;
  return nullptr;
}

std::string log_text(const SceneResult& result) {
  std::string text;
  for (const Outcome& outcome : result.outcomes) {
    text += fmt::format("{}verdict={}", text.empty() ? "" : " ", verdict_name(outcome.verdict));
    if (outcome.verdict != Verdict::recognized || !outcome.best) continue;
    text += " object=" + outcome.best->object;
    const Workspace* workspace = workspace_of(result, outcome.best->object);
    for (std::size_t i = 0; workspace != nullptr && i < outcome.best->q.size() && i < workspace->size(); ++i)
      text += fmt::format(" {}_{}={:.1f}", (*workspace)[i].name, (*workspace)[i].unit, outcome.best->q[i]);
  }
  return text;
}

}  // namespace eigenpose
