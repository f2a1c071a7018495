#include "core/dataset/workspace_json.h"

#include <nlohmann/json.hpp>

namespace eigenpose {

nlohmann::json workspace_json(const Workspace& workspace) {
  nlohmann::json list = nlohmann::json::array();
  for (const Dof& dof : workspace.dofs())
    list.push_back({{"name", dof.name},
                    {"unit", dof.unit},
                    {"lower", dof.lower},
                    {"upper", dof.upper},
                    {"periodic", dof.periodic}});
  return list;
}

}  // namespace eigenpose
