#include "core/recognition/recognition_index.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "core/search/pattern_rejector.h"

namespace eigenpose {
namespace {

/// How far beyond the farthest accepted distance the search looks for the runner-up.
constexpr double runner_up_reach = 1.5;

std::shared_ptr<const Model> with_objects(std::shared_ptr<const Model> model) {
  if (model == nullptr || model->objects.empty())
    throw std::invalid_argument("recognition needs a model with at least one object");
  return model;
}

double reach_of(const Model& model) {
  double reach = 0.0;
  for (std::size_t o = 0; o < model.objects.size(); ++o)
    reach = std::max(reach, runner_up_reach * model.rejection_distance(o));
  return reach;
}

}  // namespace

RecognitionIndex::RecognitionIndex(std::shared_ptr<const Model> model, const RecognizerOptions& options)
    : model_(with_objects(std::move(model))),
      searches_(*model_, options.search),
      reach_(reach_of(*model_)),
      object_eigenspaces_(*model_) {
  if (options.rejector && reach_ > 0.0 && std::isfinite(reach_))
    rejector_ = std::make_unique<RejectionSearch>(searches_.manifolds, RejectorOptions{.distance = reach_});
  if (model_->parts) {
    extents_ = ViewExtents(*model_->parts);
    return;
  }
  samples_.reserve(searches_.manifolds.size());
  for (const Manifold& manifold : searches_.manifolds) samples_.emplace_back(manifold);
}

}  // namespace eigenpose
