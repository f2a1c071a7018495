#include "daemon/cli/geometry_report.h"

#include <algorithm>
#include <cstdio>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/manifold/geometry.h"

namespace eigenpose::cli {
namespace {

struct Place {
  std::vector<double> q;
  ManifoldGeometry geometry;
};

/// Along DOF `d`, at its learned values, the other DOFs at their first.
std::vector<Place> along(const Manifold& manifold, std::size_t d) {
  std::vector<double> q;
  for (const SampleAxis& axis : manifold.axes()) q.push_back(axis.samples.front());
  std::vector<double> direction(q.size(), 0.0);
  direction[d] = 1.0;
  std::vector<Place> places;
  for (const double value : manifold.axes()[d].samples) {
    q[d] = value;
    places.push_back({q, manifold_geometry(manifold, q, direction)});
  }
  return places;
}

std::vector<double> components(const Eigen::VectorXd& vector) {
  return {vector.data(), vector.data() + vector.size()};
}

}  // namespace

nlohmann::json geometry_json(const ModelObject& object) {
  nlohmann::json axes = nlohmann::json::array();
  for (std::size_t d = 0; d < object.manifold.dofs(); ++d) {
    nlohmann::json places = nlohmann::json::array();
    for (const Place& place : along(object.manifold, d))
      places.push_back({{"q", place.q},
                        {"speed", place.geometry.speed},
                        {"curvature", place.geometry.curvature},
                        {"tangent", components(place.geometry.tangent)},
                        {"normal", components(place.geometry.normal)}});
    axes.push_back(
        {{"dof", object.workspace[d].name}, {"unit", object.workspace[d].unit}, {"places", places}});
  }
  return axes;
}

void print_geometry(const Model& model) {
  std::printf("\n%-16s %-10s %32s %28s\n", "object", "along", "change of appearance, 1/unit",
              "sharpest bend, 1/length");
  std::printf("%-16s %-10s %10s %10s %10s %14s %13s\n", "", "", "least", "mean", "most", "curvature", "at");
  for (const ModelObject& object : model.objects)
    for (std::size_t d = 0; d < object.manifold.dofs(); ++d) {
      const std::vector<Place> places = along(object.manifold, d);
      double least = places.front().geometry.speed;
      double most = least;
      double sum = 0.0;
      const Place* sharpest = places.data();
      for (const Place& place : places) {
        least = std::min(least, place.geometry.speed);
        most = std::max(most, place.geometry.speed);
        sum += place.geometry.speed;
        if (place.geometry.curvature > sharpest->geometry.curvature) sharpest = &place;
      }
      std::printf("%-16s %-10s %10.5f %10.5f %10.5f %14.2f %9.1f %s\n", object.name.c_str(),
                  object.workspace[d].name.c_str(), least, sum / static_cast<double>(places.size()), most,
                  sharpest->geometry.curvature, sharpest->q[d], object.workspace[d].unit.c_str());
    }
}

}  // namespace eigenpose::cli
