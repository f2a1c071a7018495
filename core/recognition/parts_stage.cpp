#include "core/recognition/parts_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/image/normalization.h"

namespace eigenpose {
namespace {

/// The second object gets this share of the first one's votes, or more: which of them it is cannot be said.
constexpr double tie = 0.97;
/// A covered object is accepted when no other has more than this share of its votes,
constexpr double clear_lead = 0.6;
/// and at most this share of it is covered.
constexpr double most_covered = 0.5;
/// Poses this much less likely than the best (natural logarithm) are not worth telling: a factor of 20.
constexpr double likely_pose = 3.0;
/// The curvature of the cost promises more than left-out views keep: 68 % lie within this many times its
/// sigma.
constexpr double sigma_inflation = 1.8;

}  // namespace

PartsStage::PartsStage(const Model& model)
    : model_(model),
      recognizer_(*model.parts),
      picture_(model.normalization.size, model.normalization.size,
               picture_bands(model.normalization) == 3 ? CV_8UC3 : CV_8UC1) {}

bool PartsStage::accepted(const PartsAnswer& answer, double runner_up_share) const {
  const PartsCalibration& calibration = model_.parts->calibration[answer.object];
  if (answer.score <= calibration.rejection_score) return true;
  if (answer.covered <= calibration.covered_share || answer.covered > most_covered ||
      runner_up_share > clear_lead)
    return false;
  // What is covered cannot vote: the rest must be as good as a whole region's.
  const double rest = (answer.score - answer.covered) / (1.0 - answer.covered);
  return rest <= calibration.rejection_score;
}

void PartsStage::judge(std::span<const float> picture, std::optional<std::size_t> sure, Outcome& outcome) {
  quantize(picture, {picture_.ptr<std::uint8_t>(), picture.size()});
  recognizer_.look(picture_);
  if (sure) {
    recognizer_.vote({&*sure, 1});
    const PartsAnswer answer = recognizer_.settle(*sure);
    const PartsCalibration& calibration = model_.parts->calibration[*sure];
    if (answer.score <= calibration.rejection_score && answer.covered <= calibration.covered_share) {
      describe(answer, 0.0, outcome);
      return;
    }
  }
  const auto votes = recognizer_.vote();
  const double share = votes.size() > 1 && votes[0].score > 0.0F
                           ? static_cast<double>(votes[1].score) / static_cast<double>(votes[0].score)
                           : 0.0;
  const std::optional<PartialVote> second = votes.size() > 1 ? std::optional(votes[1]) : std::nullopt;
  const PartsAnswer answer = recognizer_.settle(votes[0].object);
  describe(answer, share, outcome);
  if (second && second->score > 0.0F) {
    const PartsAnswer other = recognizer_.settle(second->object);
    outcome.runner_up = {model_.objects[other.object].name, other.poses.front().q, other.score};
  }
}

void PartsStage::describe(const PartsAnswer& answer, double runner_up_share, Outcome& outcome) const {
  const ModelObject& object = model_.objects[answer.object];
  const PartsCalibration& calibration = model_.parts->calibration[answer.object];
  const PartsPose& best = answer.poses.front();
  outcome.best = {object.name, best.q, answer.score};
  outcome.rejection_distance = calibration.rejection_score;
  outcome.q_sigma.clear();
  for (std::size_t d = 0; d < best.q_sigma.size(); ++d)
    outcome.q_sigma.push_back(object.dof_observable[d] ? sigma_inflation * best.q_sigma[d]
                                                       : std::numeric_limits<double>::infinity());
  if (!accepted(answer, runner_up_share)) {
    outcome.verdict = Verdict::unknown;
    outcome.confidence = 0.0;
    return;
  }
  outcome.verdict = runner_up_share > tie ? Verdict::ambiguous : Verdict::recognized;
  const double lead = 1.0 - runner_up_share;
  outcome.confidence =
      std::clamp((1.0 - answer.covered) * (runner_up_share > 0.0 ? 0.5 + 0.5 * lead : 1.0), 0.0, 1.0);
  for (std::size_t p = 1; p < answer.poses.size(); ++p) {
    const PartsPose& pose = answer.poses[p];
    bool apart = false;
    for (std::size_t d = 0; d < pose.q.size(); ++d)
      apart = apart || std::abs(object.workspace[d].difference(pose.q[d], best.q[d])) >
                           poses_apart * object.workspace[d].period();
    if (apart && pose.merit > best.merit - likely_pose) {
      outcome.other_pose = {object.name, pose.q, 1.0 - pose.votes};
      break;
    }
  }
}

}  // namespace eigenpose
