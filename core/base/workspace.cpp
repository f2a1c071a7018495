#include "core/base/workspace.h"

#include <set>
#include <stdexcept>

#include "core/base/angle.h"

namespace eigenpose {

double Dof::canonical(double value) const {
  return periodic ? wrap(value, lower, period()) : value;
}

double Dof::difference(double a, double b) const {
  return periodic ? circular_difference(a, b, period()) : a - b;
}

Workspace::Workspace(std::vector<Dof> dofs) : dofs_(std::move(dofs)) {
  if (dofs_.empty()) throw std::invalid_argument("a workspace needs at least one degree of freedom, got 0");
  std::set<std::string> names;
  for (const Dof& dof : dofs_) {
    if (dof.name.empty()) throw std::invalid_argument("a degree of freedom needs a name");
    if (!names.insert(dof.name).second)
      throw std::invalid_argument("two degrees of freedom are named \"" + dof.name + "\"");
    if (!(dof.lower < dof.upper))
      throw std::invalid_argument("degree of freedom \"" + dof.name + "\": lower " +
                                  std::to_string(dof.lower) + " is not below upper " +
                                  std::to_string(dof.upper));
  }
}

std::vector<double> Workspace::canonical(std::span<const double> q) const {
  if (q.size() != dofs_.size())
    throw std::invalid_argument("a point of this workspace has " + std::to_string(dofs_.size()) +
                                " values, got " + std::to_string(q.size()));
  std::vector<double> result(q.begin(), q.end());
  for (std::size_t i = 0; i < result.size(); ++i) result[i] = dofs_[i].canonical(result[i]);
  return result;
}

Workspace turntable_workspace() {
  return Workspace({Dof{"table", "deg", 0.0, 360.0, true}});
}

}  // namespace eigenpose
