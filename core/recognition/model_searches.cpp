#include "core/recognition/model_searches.h"

namespace eigenpose {
namespace {

std::vector<Manifold> manifolds_of(const Model& model) {
  std::vector<Manifold> manifolds;
  for (const ModelObject& object : model.objects) manifolds.push_back(object.manifold);
  return manifolds;
}

}  // namespace

SeparateSearches::SeparateSearches(std::span<const Manifold> manifolds) {
  searches_.reserve(manifolds.size());
  for (const Manifold& manifold : manifolds) searches_.push_back(make_search("tree", {&manifold, 1}));
}

ModelSearches::ModelSearches(const Model& model, std::string_view kind)
    : manifolds(manifolds_of(model)),
      all(make_search(kind, manifolds)),
      separate(manifolds),
      mean_point(model.eigenspace.basis.transpose() * model.eigenspace.mean) {}

}  // namespace eigenpose
