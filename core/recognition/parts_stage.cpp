#include "core/recognition/parts_stage.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/insertion_sort.h"
#include "core/image/normalization.h"
#include "core/recognition/decision.h"

namespace eigenpose {
namespace {

/// Other objects farther than this are no rivals, and terms of the evidence do not depend on them.
constexpr double reach_of_others = 0.5;

/// An object in the pose that fits best, compared with the whole region.
WholeCandidate candidate_at(const AlignedPose& pose, const PartsRecognizer::Look& look, AlignedMatch& match,
                            const WholeRegion& region, std::size_t object, Tint tint = Tint::undone) {
  WholeCandidate candidate{object, pose.q, pose.misalignment, {}, look.color_match(object), {}, 0.0};
  candidate.distance = match.distance(region.picture, candidate.misalignment, {object, region.absent}, tint);
  return candidate;
}

/// Whether the windows see about as much of one object as of the other.
bool tied(const Model& model, const WholeCandidate& a, const WholeCandidate& b) {
  const auto [less, more] = std::minmax(a.windows.discriminating, b.windows.discriminating);
  return less >= model.decision.tuning.tied_votes * more;
}

}  // namespace

WholeMatch whole_match(const Model& model, std::size_t object, const RealignedDistance& distance,
                       const std::optional<ColorMatch>& color) {
  WholeMatch match{distance.own, model.objects[object].typical_distance};
  match.color = color;
  if (distance.other) match.other = distance.other->distance;
  return match;
}

WholeCandidate align_whole(const PartsRecognizer::Look& look, AlignedMatch& match, const WholeRegion& region,
                           std::size_t object) {
  return candidate_at(match.align(look.pose_picture(), object).front(), look, match, region, object);
}

double lead_of(const Model& model, const WholeCandidate& first, const WholeCandidate& second) {
  double lead = QueryWindows::count * (first.windows.discriminating - second.windows.discriminating);
  if (tied(model, first, second))
    lead += lead_of_distance(model.decision.tuning, model.objects[first.object].typical_distance,
                             first.distance.own, second.distance.own);
  return lead;
}

WholeCandidates compare_whole(const Model& model, const PartsRecognizer::Look& look,
                              const PartsRecognizer::Votes& votes, AlignedMatch& match,
                              const WholeRegion& region, const WholeCandidate& aligned) {
  WholeCandidates candidates;
  for (const PartialVote& vote : votes.ranked()) {
    if (candidates.full()) break;
    if (vote.object == region.absent || (vote.score <= 0.0F && !candidates.empty())) continue;
    WholeCandidate candidate =
        vote.object == aligned.object ? aligned : align_whole(look, match, region, vote.object);
    candidate.windows = votes.match(vote.object);
    candidate.evidence =
        evidence_of(model.decision.weights, whole_match(model, candidate), candidate.windows);
    candidates.push_back(candidate);
  }
  if (candidates.full() && lead_of(model, candidates[0], candidates[1]) < 0.0)
    std::swap(candidates[0], candidates[1]);
  return candidates;
}

std::optional<PartsIdentification> identify_if_occluded(const Model& model,
                                                        const PartsRecognizer::Votes& votes) {
  const std::size_t first = votes.ranked().front().object;
  const double occluded = votes.occluded_share(first);
  const Tuning& tuning = model.decision.tuning;
  if (occluded <= model.parts->calibration[first].foreign_share || occluded > tuning.most_occluded)
    return std::nullopt;
  PartsIdentification found = votes.identify_occluded();
  if (votes.gain_of_masking(found.best) < tuning.least_masking_gain) return std::nullopt;
  return found;
}

PartsStage::PartsStage(const RecognitionIndex& index, HypothesisPool& pool)
    : model_(index.model()),
      pool_(pool),
      recognizer_(*model_.parts, model_.decision),
      match_(model_, index.searches(), reach_of_others),
      touching_(model_, index.extents(), recognizer_),
      picture_(model_.normalization.size, model_.normalization.size,
               picture_bands(model_.normalization) == 3 ? CV_8UC3 : CV_8UC1) {}

bool PartsStage::apart(std::size_t object, std::span<const double> a, std::span<const double> b) const {
  const Workspace& workspace = model_.objects[object].workspace;
  for (std::size_t d = 0; d < a.size(); ++d)
    if (std::abs(workspace[d].difference(a[d], b[d])) > poses_apart * workspace[d].period()) return true;
  return false;
}

std::size_t PartsStage::judge(std::span<const float> picture, std::size_t nearest, Outcome& outcome) {
  quantize(picture, {picture_.ptr<std::uint8_t>(), picture.size()});
  const PartsRecognizer::Look look = recognizer_.look(picture_);
  const std::vector<AlignedPose>& aligned = match_.align(look.pose_picture(), nearest);
  // A tint that is undone brings the region nearer: where it is near enough as it is, that settles it.
  WholeCandidate candidate = candidate_at(aligned.front(), look, match_, {picture, {}}, nearest, Tint::kept);
  const bool near_enough =
      evidence_of(model_.decision.weights, whole_match(model_, candidate)) >= model_.decision.settled;
  if (near_enough && settle(look, aligned, candidate, outcome)) return nearest;
  candidate.distance = match_.distance(picture, candidate.misalignment, {nearest});
  if (!near_enough && settle(look, aligned, candidate, outcome)) return nearest;
  return vote(look, picture, candidate, outcome);
}

bool PartsStage::settle(const PartsRecognizer::Look& look, std::span<const AlignedPose> aligned,
                        const WholeCandidate& nearest, Outcome& outcome) {
  const DecisionModel& decision = model_.decision;
  const std::size_t object = nearest.object;
  Finding finding;
  finding.object = object;
  finding.distance = nearest.distance;
  finding.evidence = {.best = evidence_of(decision.weights, whole_match(model_, nearest)),
                      .required = decision.required};
  if (finding.evidence.best < decision.settled) return false;
  if (const auto& other = finding.distance.other)
    finding.evidence.second =
        evidence_of(decision.weights, WholeMatch{.distance = other->distance,
                                                 .typical = model_.objects[other->manifold].typical_distance,
                                                 .color = look.color_match(other->manifold)});
  if (finding.evidence.second > finding.evidence.best - decision.tuning.settled_lead) return false;
  poses_.clear();
  bool clear = true;
  for (const AlignedPose& found : aligned) {
    PartsPose pose{found.q, found.q_covariance, found.misalignment, 0.5 * (found.cost + found.fine_cost), 0.0,
                   0.0};
    pose.merit = -0.5 * pose.cost / model_.parts->noise;
    if (!poses_.empty() && apart(object, pose.q, poses_.front().q))
      clear = clear && pose.merit < poses_.front().merit - decision.tuning.settled_pose_lead;
    poses_.push_back(pose);
  }
  finding.poses = poses_;
  PartsAnswer answer;
  if (!clear) {
    // The object is certain, its pose is not: the windows decide.
    answer = look.vote({&object, 1}).settle(object);
    if (answer.occluded > model_.parts->calibration[object].foreign_share) return false;
    finding.poses = answer.poses;
  }
  describe(finding, outcome);
  return true;
}

std::size_t PartsStage::vote(const PartsRecognizer::Look& look, std::span<const float> picture,
                             const WholeCandidate& nearest, Outcome& outcome) {
  const PartsRecognizer::Votes votes = look.vote();
  const WholeCandidates candidates = compare_whole(model_, look, votes, match_, {picture, {}}, nearest);
  const WholeCandidate& best = candidates.front();
  const DecisionModel& decision = model_.decision;
  if (best.evidence < decision.required) {
    const auto found = identify_if_occluded(model_, votes);
    if (found && found->evidence - decision.required_occluded > best.evidence - decision.required) {
      describe_occluded(*found, picture, decision.required_occluded, outcome);
      return found->best.object;
    }
  }
  const PartsAnswer answer = votes.settle(best.object);
  Finding finding;
  finding.object = best.object;
  finding.poses = answer.poses;
  finding.distance = best.distance;
  finding.occluded = answer.occluded;
  finding.evidence = {.best = best.evidence, .required = decision.required};
  if (candidates.full()) finding.evidence.second = best.evidence - lead_of(model_, best, candidates[1]);
  describe(finding, outcome);
  if (candidates.full()) {
    const WholeCandidate& second = candidates[1];
    pool_.fill(outcome.runner_up, model_.objects[second.object].name, second.q, second.distance.own);
  }
  return best.object;
}

void PartsStage::describe(const TouchingObject& object, Outcome& outcome) {
  describe_occluded(object.found, object.picture, object.required, outcome);
}

void PartsStage::describe_occluded(const PartsIdentification& found, std::span<const float> picture,
                                   double required, Outcome& outcome) {
  const auto distance_of = [&](const PartsAnswer& answer) {
    return match_.distance(picture, answer.poses.front().misalignment, {answer.object});
  };
  Finding finding;
  finding.object = found.best.object;
  finding.poses = found.best.poses;
  finding.distance = distance_of(found.best);
  finding.occluded = found.best.occluded;
  finding.evidence = {found.evidence, found.second_evidence, required};
  describe(finding, outcome);
  if (found.second)
    pool_.fill(outcome.runner_up, model_.objects[found.second->object].name, found.second->poses.front().q,
               distance_of(*found.second).own);
}

void PartsStage::describe(const Finding& finding, Outcome& outcome) {
  const DecisionModel& decision = model_.decision;
  const ModelObject& object = model_.objects[finding.object];
  const PartsPose& best = finding.poses.front();
  pool_.fill(outcome.best, object.name, best.q, finding.distance.own);
  outcome.decide(finding.evidence, decision.tuning);
  outcome.covered_share = finding.occluded;
  outcome.set_covariance(best.q_covariance, decision.tuning.sigma_inflation * decision.tuning.sigma_inflation,
                         object.dof_observable);
  if (const auto& other = finding.distance.other) {
    const ModelObject& second = model_.objects[other->manifold];
    pool_.fill(outcome.runner_up, second.name, std::span(other->q).first(second.workspace.size()),
               other->distance);
  }
  if (outcome.verdict == Verdict::unknown) return;
  for (const PartsPose& pose : finding.poses.subspan(1)) {
    if (pose.merit > best.merit - decision.tuning.pose_lead && apart(finding.object, pose.q, best.q)) {
      pool_.fill(outcome.other_pose, object.name, pose.q, finding.distance.own);
      break;
    }
  }
}

}  // namespace eigenpose
