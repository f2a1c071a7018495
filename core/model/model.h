#pragma once

/// The model: everything recognition needs, in one value and one file.

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/workspace.h"
#include "core/image/normalization.h"
#include "core/manifold/manifold.h"
#include "core/model/decision_model.h"
#include "core/model/object_eigenspace.h"
#include "core/model/parts_model.h"
#include "core/subspace/eigenspace.h"

namespace eigenpose {

/// One learned object.
struct ModelObject {
  std::string name;
  Workspace workspace;
  Manifold manifold;  ///< in the universal eigenspace
  /// Root mean square distance of new views of this object from its manifold, after alignment where the model
  /// aligns.
  double typical_distance = 0.0;
  /// For each DOF: views left out of learning are found again at about their true value.
  std::vector<bool> dof_observable = {};
  /// dof_observable of the first DOF, which is the object's turn: false where turning the object does not
  /// change its appearance, or makes it look the same several times a turn.
  bool pose_observable = true;
  /// The object's own eigenspace, where the model was learned with one.
  std::optional<ObjectEigenspace> space = std::nullopt;
  std::size_t views = 0;  ///< how many views it was learned from
};

/// Where a model comes from; shown by `eigenpose inspect`.
struct Provenance {
  std::string program_version;
  std::string created;     ///< ISO 8601, UTC
  std::string image_sets;  ///< folder learned from
  std::string solver;
  double energy = 0.0;        ///< share of the scatter that the eigenspace keeps
  double energy_bound = 0.0;  ///< how far off that may be, by the solver's report; 0: exact
};

/// A learned model. Immutable once made: share it as std::shared_ptr<const Model>.
struct Model {
  NormalizationOptions normalization;
  Eigenspace eigenspace;
  std::vector<ModelObject> objects;
  /// Windows and pose spaces, in the order of `objects`; null where only the whole region is matched.
  std::shared_ptr<const PartsModel> parts;
  DecisionModel decision;
  Provenance provenance;

  /// A whole region farther from object `o`, with the colours of a usual view, is unknown, unless its windows
  /// say more.
  [[nodiscard]] double rejection_distance(std::size_t o) const {
    const bool colors = parts && !parts->colors.empty();
    return decision.distance_of(decision.required, objects[o].typical_distance,
                                colors ? std::optional(parts->calibration[o].typical_color) : std::nullopt);
  }
  /// Bytes held for object `o` alone: windows, pose space, own eigenspace.
  [[nodiscard]] std::size_t memory(std::size_t o) const {
    std::size_t bytes = parts ? parts->memory(o) : 0;
    if (const auto& own = objects[o].space)
      bytes += static_cast<std::size_t>(own->eigenspace.basis.size() + own->eigenspace.mean.size()) *
               sizeof(float);
    return bytes;
  }
};

}  // namespace eigenpose
