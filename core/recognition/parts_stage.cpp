#include "core/recognition/parts_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/image/normalization.h"
#include "core/recognition/decision.h"
#include "core/recognition/likelihood.h"

namespace eigenpose {
namespace {

/// A second pose is reported if its log-likelihood is at most this much below the best: a factor of 20.
constexpr double likely_pose = 3.0;
/// The best pose is not in doubt if all others are this much less likely (log-likelihood).
constexpr double sure_pose = 8.0;
/// The curvature of the cost underestimates σ: 68 % of left-out views lie within this many times of it.
constexpr double sigma_inflation = 1.8;
/// Other objects farther than this do not put a match in doubt.
double reach_of_others(const Model& model) {
  double largest = 0.0;
  for (const PartsCalibration& own : model.parts->calibration)
    largest = std::max(largest, own.rejection_distance);
  return largest / std::sqrt(std::max(model.parts->sure_ratio, 1e-3));
}

}  // namespace

PartsStage::PartsStage(const Model& model, const ManifoldSearch& all, const SeparateSearches& separate,
                       HypothesisPool& pool)
    : model_(model),
      pool_(pool),
      recognizer_(*model.parts),
      match_(model, all, separate, reach_of_others(model)),
      touching_(model.normalization, *model.parts, recognizer_),
      picture_(model.normalization.size, model.normalization.size,
               picture_bands(model.normalization) == 3 ? CV_8UC3 : CV_8UC1) {}

bool PartsStage::accepted(const PartsIdentification& found, const RealignedDistance& distance) const {
  const PartsAnswer& best = found.best;
  const PartsCalibration& calibration = model_.parts->calibration[best.object];
  if (distance.own <= calibration.sure_distance) return true;
  if (distance.own <= calibration.rejection_distance && best.score <= calibration.rejection_score)
    return true;
  return best.occluded > calibration.covered_share && best.occluded <= max_occluded_share &&
         found.evidence > model_.parts->covered_evidence;
}

bool PartsStage::apart(std::size_t object, std::span<const double> a, std::span<const double> b) const {
  const Workspace& workspace = model_.objects[object].workspace;
  for (std::size_t d = 0; d < a.size(); ++d)
    if (std::abs(workspace[d].difference(a[d], b[d])) > poses_apart * workspace[d].period()) return true;
  return false;
}

std::size_t PartsStage::judge(std::span<const float> picture, std::size_t nearest, Outcome& outcome) {
  quantize(picture, {picture_.ptr<std::uint8_t>(), picture.size()});
  const PartsRecognizer::Look look = recognizer_.look(picture_);
  return settle(look, picture, nearest, outcome) ? nearest : vote(look, picture, outcome);
}

bool PartsStage::settle(const PartsRecognizer::Look& look, std::span<const float> picture, std::size_t object,
                        Outcome& outcome) {
  const PartsCalibration& calibration = model_.parts->calibration[object];
  const std::vector<AlignedPose>& aligned = match_.align(look.pose_picture(), object);
  Finding finding;
  finding.object = object;
  finding.distance = match_.distance(picture, aligned.front().misalignment, object);
  const double own = finding.distance.own;
  if (own > calibration.sure_distance) return false;
  if (const auto& other = finding.distance.other;
      other && own * own > model_.parts->sure_ratio * other->distance * other->distance)
    return false;
  poses_.clear();
  bool clear = true;
  for (const AlignedPose& found : aligned) {
    PartsPose pose{found.q, found.q_covariance, found.misalignment, 0.5 * (found.cost + found.fine_cost), 0.0,
                   0.0};
    pose.merit = -0.5 * pose.cost / model_.parts->noise;
    if (!poses_.empty() && apart(object, pose.q, poses_.front().q))
      clear = clear && pose.merit < poses_.front().merit - sure_pose;
    poses_.push_back(pose);
  }
  if (clear) {
    finding.poses = poses_;
    describe(finding, true, outcome);
    return true;
  }
  // The object is certain, its pose is not: the windows decide.
  const PartsAnswer answer = look.vote({&object, 1}).settle(object);
  if (answer.occluded > calibration.covered_share) return false;
  finding.poses = answer.poses;
  describe(finding, true, outcome);
  return true;
}

RealignedDistance PartsStage::distance_of(std::span<const float> picture, const PartsAnswer& answer) {
  return match_.distance(picture, answer.poses.front().misalignment, answer.object);
}

std::size_t PartsStage::vote(const PartsRecognizer::Look& look, std::span<const float> picture,
                             Outcome& outcome) {
  PartsIdentification found = look.identify();
  RealignedDistance distance = distance_of(picture, found.best);
  if (found.tie && found.best.occluded <= model_.parts->calibration[found.best.object].covered_share) {
    // The windows cannot distinguish the two; the whole region, aligned with each, may.
    RealignedDistance second = distance_of(picture, *found.second);
    if (second.own < distance.own) {
      std::swap(found.best, *found.second);
      std::swap(distance, second);
    }
    found.tie =
        is_ambiguous(likelihood(second.own, distance.own, model_.typical_distance(found.best.object)));
  }
  describe(found, distance, accepted(found, distance), picture, outcome);
  return found.best.object;
}

void PartsStage::describe(const TouchingObject& object, Outcome& outcome) {
  describe(object.found, distance_of(object.picture, object.found.best), true, object.picture, outcome);
}

void PartsStage::describe(const PartsIdentification& found, const RealignedDistance& distance, bool accepted,
                          std::span<const float> picture, Outcome& outcome) {
  Finding finding;
  finding.object = found.best.object;
  finding.poses = found.best.poses;
  finding.distance = distance;
  finding.occluded = found.best.occluded;
  finding.runner_up_share = found.second_share;
  finding.tie = found.tie;
  const PartsCalibration& calibration = model_.parts->calibration[finding.object];
  const double beyond =
      distance.own <= calibration.rejection_distance
          ? likelihood(calibration.rejection_distance, distance.own, calibration.typical_distance)
          : std::exp(model_.parts->covered_evidence - found.evidence);
  finding.margin = 1.0 / (1.0 + beyond);
  describe(finding, accepted, outcome);
  if (found.second) {
    pool_.fill(outcome.runner_up, model_.objects[found.second->object].name, found.second->poses.front().q,
               distance_of(picture, *found.second).own);
  }
}

void PartsStage::describe(const Finding& finding, bool accepted, Outcome& outcome) {
  const ModelObject& object = model_.objects[finding.object];
  const PartsCalibration& calibration = model_.parts->calibration[finding.object];
  const PartsPose& best = finding.poses.front();
  pool_.fill(outcome.best, object.name, best.q, finding.distance.own);
  outcome.rejection_distance = calibration.rejection_distance;
  outcome.covered_share = finding.occluded;
  outcome.set_covariance(best.q_covariance, sigma_inflation * sigma_inflation, object.dof_observable);
  if (const auto& other = finding.distance.other) {
    const ModelObject& second = model_.objects[other->manifold];
    pool_.fill(outcome.runner_up, second.name, std::span(other->q).first(second.workspace.size()),
               other->distance);
  }
  if (!accepted) {
    outcome.verdict = Verdict::unknown;
    outcome.confidence = 0.0;
    return;
  }
  outcome.verdict = finding.tie ? Verdict::ambiguous : Verdict::recognized;
  if (finding.runner_up_share > 0.0) {
    outcome.confidence =
        finding.margin *
        std::clamp((1.0 - finding.occluded) * (1.0 - 0.5 * finding.runner_up_share), 0.0, 1.0);
  } else {
    const auto beside = [&](double distance) {
      return likelihood(distance, finding.distance.own, calibration.typical_distance);
    };
    const double second = finding.distance.other ? beside(finding.distance.other->distance) : 0.0;
    outcome.confidence = 1.0 / (1.0 + second + beside(calibration.rejection_distance));
  }
  for (const PartsPose& pose : finding.poses.subspan(1)) {
    if (pose.merit > best.merit - likely_pose && apart(finding.object, pose.q, best.q)) {
      pool_.fill(outcome.other_pose, object.name, pose.q, finding.distance.own);
      break;
    }
  }
}

}  // namespace eigenpose
