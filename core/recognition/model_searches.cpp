#include "core/recognition/model_searches.h"

namespace eigenpose {
namespace {

std::vector<Manifold> manifolds_of(const Model& model) {
  std::vector<Manifold> manifolds;
  for (const ModelObject& object : model.objects) manifolds.push_back(object.manifold);
  return manifolds;
}

}  // namespace

ModelSearches::ModelSearches(const Model& model, std::string_view kind)
    : manifolds(manifolds_of(model)), all(make_search(kind, manifolds)), separate(manifolds) {}

}  // namespace eigenpose
