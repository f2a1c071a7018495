#include "core/model/model_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>

#include "core/base/object_name.h"
#include "core/model/object_eigenspace.h"

namespace eigenpose {
namespace {

constexpr double unlimited = std::numeric_limits<double>::infinity();

[[noreturn]] void refuse(const std::string& what) {
  throw std::invalid_argument(what);
}

/// @param what "object \"mug\": the rejection distance"; NaN is never in range, an infinite value only where
/// `upper` is.
void check_range(const std::string& what, double value, double lower, double upper) {
  if (value >= lower && value <= upper) return;
  refuse(what + " is " + std::to_string(value) + "; allowed are " + std::to_string(lower) + " to " +
         std::to_string(upper));
}

/// Finite and not negative. Distances, shares and masses are far below the bound.
void check_not_negative(const std::string& what, double value) {
  if (!(value >= 0.0 && value <= 1e12))
    refuse(what + " is " + std::to_string(value) + "; allowed are finite numbers that are not negative");
}

template <typename Matrix>
void check_finite(const std::string& what, const Matrix& matrix) {
  if (!matrix.allFinite()) refuse(what + ": not every number is finite");
}

void check_normalization(const NormalizationOptions& options) {
  check_range("the size of normalised views", options.size, 8, 256);
  check_range("the least contrast", options.segmentation.least_contrast, 1, 200);
  check_range("the noise bound of segmentation (sigmas)", options.segmentation.noise_sigmas, 0, 1000);
  check_range("the bridged gap", options.segmentation.bridged_gap, 0, 16);
  check_range("the share of dirt", options.segmentation.dirt_share, 0, 1);
}

void check_eigenspace(const std::string& of, const Eigenspace& space, Eigen::Index length) {
  if (space.mean.size() != length || space.basis.rows() != length || space.components() < 1 ||
      space.eigenvalues.size() != space.components())
    refuse(of + "the parts of the eigenspace do not fit together");
  check_finite(of + "the mean", space.mean);
  check_finite(of + "the basis", space.basis);
  check_finite(of + "the eigenvalues", space.eigenvalues);
  check_not_negative(of + "the total scatter", space.total_scatter);
}

void check_manifold(const std::string& of, const Manifold& manifold, Eigen::Index dimensions) {
  if (manifold.dimensions() != dimensions) refuse(of + "the manifold does not fit its eigenspace");
  check_finite(of + "the manifold", manifold.coefficients());
  for (const SampleAxis& axis : manifold.axes())
    if (!std::isfinite(axis.dof.lower) || !std::isfinite(axis.dof.upper))
      refuse(of + "the range of a degree of freedom is not finite");
}

void check_object(const Model& model, const ModelObject& object) {
  const std::string of = "object \"" + object.name + "\": ";
  check_manifold(of, object.manifold, model.eigenspace.components());
  check_not_negative(of + "the typical distance", object.typical_distance);
  if (object.workspace.size() != object.manifold.dofs() ||
      object.dof_observable.size() != object.workspace.size())
    refuse(of + "the degrees of freedom do not fit together");
  if (!object.space) return;
  const auto side = static_cast<Eigen::Index>(reduced_side(model.normalization));
  const Eigenspace& space = object.space->eigenspace;
  check_eigenspace(of, space, side * side * appearance_bands(model.normalization));
  check_manifold(of, object.space->manifold, space.components());
}

/// The poses of the learned views. @return how many there are.
std::size_t check_views(const std::string& of, const PartsModel& parts, std::size_t o, std::size_t dofs) {
  const Eigen::MatrixXd& poses = parts.view_poses[o];
  check_finite(of + "the poses of views", poses);
  if (static_cast<std::size_t>(poses.rows()) != dofs)
    refuse(of + "the poses of views do not fit its degrees of freedom");
  return static_cast<std::size_t>(poses.cols());
}

void check_windows(const std::string& of, const PartsObject& object, std::size_t views) {
  if (object.candidates.empty() || object.neighbours.size() != object.candidates.size() ||
      object.store.views() != object.lane_candidate.size())
    refuse(of + "the windows do not fit together");
  for (const Candidate& candidate : object.candidates)
    if (candidate.view < 0 || static_cast<std::size_t>(candidate.view) >= views)
      refuse(of + "windows of a view that was not learned");
}

void check_calibration(const std::string& of, const PartsCalibration& calibration) {
  check_range(of + "the typical votes", calibration.typical_votes, 0, 1);
  check_range(of + "the share of foreign windows", calibration.foreign_share, 0, 1);
  check_range(of + "the typical distance of colours", calibration.typical_color, 0, 1);
}

void check_alignment(const std::string& of, const AlignmentEigenspace& space) {
  check_finite(of + "the mean picture", space.pixel_mean());
  for (const PoseScale* scale : {&space.coarse(), &space.fine()}) {
    check_finite(of + "the basis of alignment", scale->basis);
    check_finite(of + "the mean of alignment", scale->mean);
  }
  check_manifold(of, space.coarse_manifold(), space.coarse().basis.cols());
  check_manifold(of, space.fine_manifold(), space.fine().basis.cols());
}

/// Of all views, or of none of any object.
void check_extents(const std::string& of, const PartsModel& parts, std::size_t o, std::size_t views) {
  if (parts.extents.empty()) return;
  if (parts.extents[o].size() != (parts.extents[0].empty() ? 0 : views))
    refuse(of + "the sizes of regions do not fit the views");
}

void check_colors(const std::string& of, const PartsModel& parts, std::size_t o, std::size_t views) {
  if (!parts.colors.empty() && parts.colors[o].maps().size() != views)
    refuse(of + "the colours do not fit the views");
}

void check_voting(const VotingOptions& voting) {
  check_range("the reach of windows (cells)", voting.tolerance.cells, 0, WindowGrid::side);
  check_not_negative("the penalty of moved windows", voting.tolerance.penalty);
  check_range("the width of likeness", voting.width, 1e-6, 1e6);
  check_range("the pooling of neighbours", voting.pooling, 0, 1);
  check_range("the rank of the background", voting.background_rank, 1, 1e6);
  check_not_negative("the weight of windows without gradient", voting.floor_weight);
}

void check_parts(const Model& model, const PartsModel& parts) {
  const std::size_t count = model.objects.size();
  if (parts.objects.size() != count || parts.poses.size() != count || parts.calibration.size() != count ||
      parts.view_poses.size() != count || (!parts.extents.empty() && parts.extents.size() != count) ||
      parts.colors.size() != (parts.bands == 3 ? count : 0))
    refuse("the windows do not fit the objects");
  if (parts.bands != 1 && parts.bands != 3) refuse("the windows are neither of colour nor of grey pictures");
  for (const float level : parts.background) check_not_negative("the background of windows", level);
  check_finite("the mean window", parts.space.mean());
  check_finite("the basis of windows", parts.space.basis());
  check_range("the mean mass of windows", parts.space.mean_mass(), 0, 1e12);
  check_range("the step of learned windows", parts.scale.learned, 1e-12, 1e6);
  check_range("the step of query windows", parts.scale.query, 1e-12, 1e6);
  check_voting(parts.voting);
  check_not_negative("the noise of alignment", parts.noise);
  for (std::size_t o = 0; o < count; ++o) {
    const std::string of = "object \"" + model.objects[o].name + "\": ";
    const std::size_t views = check_views(of, parts, o, model.objects[o].workspace.size());
    check_windows(of, parts.objects[o], views);
    check_calibration(of, parts.calibration[o]);
    check_alignment(of, parts.poses[o]);
    check_extents(of, parts, o, views);
    check_colors(of, parts, o, views);
  }
}

template <typename Values>
void check_all_finite(const std::string& what, const Values& values) {
  for (const double value : values)
    if (!std::isfinite(value)) refuse(what + " are not finite");
}

void check_rates(const std::string& what, const DecisionRates& rates) {
  check_range("the " + what + " rate of false rejections", rates.false_rejection, 0, 1);
  check_range("the " + what + " rate of false acceptances", rates.false_acceptance, 0, 1);
}

void check_decision(const DecisionModel& decision) {
  check_all_finite("the weights of the whole region", decision.weights.whole);
  check_all_finite("the weights of windows", decision.weights.windows);
  check_all_finite("the weights of occluded regions", decision.weights.occluded);
  check_range("the required evidence", decision.required, -1e12, unlimited);
  check_range("the required evidence of occluded regions", decision.required_occluded, -1e12, unlimited);
  check_range("the evidence that settles", decision.settled, decision.required, unlimited);
  check_rates("set", decision.set);
  check_rates("expected", decision.expected);
  for (const auto* evidence : {&decision.known, &decision.unknown}) {
    check_all_finite("the evidence of learned views", *evidence);
    if (!std::ranges::is_sorted(*evidence)) refuse("the evidence of learned views is not in order");
  }
  for_each_constant(decision.tuning, [](const char* name, double value) {
    if (!std::isfinite(value)) refuse("the constant " + std::string(name) + " is not finite");
  });
  check_range("the effective dimensions", decision.tuning.effective_dimensions, 1e-6, 1e6);
}

}  // namespace

void check_model(const Model& model) {
  check_normalization(model.normalization);
  check_eigenspace("", model.eigenspace, static_cast<Eigen::Index>(appearance_length(model.normalization)));
  if (model.objects.empty()) refuse("it has no object");
  std::set<std::string> names;
  for (const ModelObject& object : model.objects) {
    check_object_name(object.name);
    if (!names.insert(object.name).second) refuse("two objects are named \"" + object.name + "\"");
    check_object(model, object);
  }
  check_decision(model.decision);
  if (model.parts) check_parts(model, *model.parts);
}

}  // namespace eigenpose
