#include "core/recognition/parts_recognizer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

#include "core/alignment/misalignment.h"
#include "core/base/insertion_sort.h"
#include "core/recognition/parts_recognizer_impl.h"

namespace eigenpose {
namespace {

constexpr double close_merit = 40.0;  // poses this close in merit are voted on again after alignment
constexpr std::size_t most_revoted = 3;

/// Votes of the learned views next to a pose: the best of those within one step in every DOF; where the views
/// leave a gap there, of the nearest view.
/// @param poses of the learned views.
double votes_near(const std::vector<float>& votes, const PartsObject& object,
                  const AlignmentEigenspace& space, const Eigen::MatrixXd& poses, std::span<const double> q) {
  const auto axes = space.coarse_manifold().axes();
  constexpr double one_step = 1.01;  // with room for rounded ones
  double best = 0.0;
  double nearest = 0.0;  // votes of the nearest view
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < object.candidates.size(); ++c) {
    if (object.candidates[c].mirrored) continue;
    double steps = 0.0;
    for (std::size_t a = 0; a < axes.size(); ++a) {
      const double learned = poses(static_cast<Eigen::Index>(a), object.candidates[c].view);
      steps = std::max(steps, std::fabs(axes[a].dof.difference(q[a], learned)) *
                                  static_cast<double>(axes[a].samples.size()) / axes[a].dof.period());
    }
    if (steps <= one_step) best = std::max(best, static_cast<double>(votes[c]));
    if (steps < least) {
      least = steps;
      nearest = votes[c];
    }
  }
  return least <= one_step ? best : nearest;
}

}  // namespace

const PosePicture& PartsRecognizer::Impl::posed() {
  if (!pose_picture_made) make_pose_picture(picture, pose_picture);
  pose_picture_made = true;
  return pose_picture;
}

void PartsRecognizer::Impl::make_colors() {
  if (colors_made) return;
  colors = chromaticity_map(picture, model.background);
  color_roots = chromaticity_roots(colors);
  colors_made = true;
}

std::optional<ColorMatch> PartsRecognizer::Impl::color_match(std::size_t object,
                                                             std::span<const int> left_out) {
  if (model.colors.empty()) return std::nullopt;
  make_colors();
  return ColorMatch{model.colors[object].distance(color_roots, left_out),
                    model.calibration[object].typical_color};
}

const std::vector<float>& PartsRecognizer::Impl::votes_of(std::size_t object) {
  matcher.plain_votes(object, plain_votes);
  return plain_votes;
}

double PartsRecognizer::Impl::share_after_alignment(std::size_t object, const PartsPose& pose) {
  if (!pixels_made) picture.convertTo(pixels, CV_32F);
  pixels_made = true;
  aligned_pixels.create(pixels.size(), pixels.type());
  const std::size_t count = pixels.total() * static_cast<std::size_t>(pixels.channels());
  undo_misalignment({pixels.ptr<float>(), count}, pixels.cols, pixels.channels(), pose.misalignment,
                    {aligned_pixels.ptr<float>(), count});
  aligned_pixels.convertTo(aligned, CV_8U);
  mapper.compute(aligned, map);
  make_query_windows(map, model.space, model.scale, model.voting, aligned_windows);
  rematcher.match(aligned_windows, {&object, 1});
  rematcher.plain_votes(object, aligned_votes);
  return votes_near(aligned_votes, model.objects[object], model.poses[object], model.view_poses[object],
                    pose.q) /
         aligned_windows.total_weight;
}

ForeignWindows PartsRecognizer::Impl::foreign_windows(std::size_t object, int candidate) {
  matcher.window_likeness(object, candidate, likeness, background);
  double count = 0.0;
  double sum = 0.0;
  for (const float kappa : likeness) {
    if (kappa >= foreign_likeness) continue;
    count += 1.0;
    sum += static_cast<double>(kappa);
  }
  return {count / static_cast<double>(likeness.size()), count > 0.0 ? sum / count : 0.0};
}

double PartsRecognizer::Impl::occluded_share(std::size_t object, const std::vector<float>& plain) {
  const PartsObject& parts = model.objects[object];
  int best = 0;
  for (std::size_t c = 0; c < plain.size(); ++c) {
    if (!parts.candidates[c].mirrored && plain[c] > plain[static_cast<std::size_t>(best)]) {
      best = static_cast<int>(c);
    }
  }
  return foreign_windows(object, best).share;
}

PartsAnswer PartsRecognizer::Impl::find_poses(std::size_t object, const std::vector<float>& plain,
                                              double occluded) {
  PartsAnswer answer;
  answer.object = object;
  answer.occluded = occluded;
  const PartsObject& parts = model.objects[object];
  const AlignmentEigenspace& space = model.poses[object];
  const auto merit = [&](const PartsPose& pose) {
    return QueryWindows::count * pose.votes - 0.5 * pose.cost / model.noise;
  };
  for (const AlignedPose& found : aligner.align(posed(), space)) {
    PartsPose pose{found.q, found.q_covariance, found.misalignment, 0.5 * (found.cost + found.fine_cost), 0.0,
                   0.0};
    pose.votes = votes_near(plain, parts, space, model.view_poses[object], pose.q) / windows.total_weight;
    pose.merit = merit(pose);
    answer.poses.push_back(pose);
  }
  const auto better = [](const PartsPose& a, const PartsPose& b) { return a.merit > b.merit; };
  insertion_sort(answer.poses, better);
  const double best = answer.poses.front().merit;
  for (std::size_t i = 0; i < std::min(answer.poses.size(), most_revoted); ++i) {
    PartsPose& pose = answer.poses[i];
    if (pose.merit < best - close_merit) {
      break;
    }
    const double share = share_after_alignment(object, pose);
    pose.votes = 0.5 * (pose.votes + share);
    pose.merit = merit(pose);
  }
  insertion_sort(answer.poses, better);
  return answer;
}

PartsRecognizer::PartsRecognizer(const PartsModel& model, const DecisionModel& decision)
    : impl_(std::make_unique<Impl>(model, decision)) {}
PartsRecognizer::~PartsRecognizer() = default;
PartsRecognizer::PartsRecognizer(PartsRecognizer&&) noexcept = default;
PartsRecognizer& PartsRecognizer::operator=(PartsRecognizer&&) noexcept = default;

PartsRecognizer::Look PartsRecognizer::look(const cv::Mat& picture) {
  if (picture.rows == OrientationGrid::pixels) {
    picture.copyTo(impl_->picture);
  } else {
    cv::resize(picture, impl_->picture, cv::Size(OrientationGrid::pixels, OrientationGrid::pixels), 0.0, 0.0,
               cv::INTER_AREA);
  }
  impl_->windows_made = false;
  impl_->pixels_made = false;
  impl_->pose_picture_made = false;
  impl_->colors_made = false;
  ++impl_->votes;  // those of the picture before are no longer valid
  return {*impl_, ++impl_->pictures};
}

PartsRecognizer::Impl& PartsRecognizer::Look::impl() const {
  if (picture_ != impl_->pictures)
    throw std::logic_error(
        "the recogniser has looked at another picture since; use what look() returned last");
  return *impl_;
}

const PosePicture& PartsRecognizer::Look::pose_picture() const {
  return impl().posed();
}

std::optional<ColorMatch> PartsRecognizer::Look::color_match(std::size_t object,
                                                             std::span<const int> left_out) const {
  return impl().color_match(object, left_out);
}

PartsRecognizer::Votes PartsRecognizer::Look::vote(std::span<const std::size_t> shortlist) const {
  impl().vote(shortlist);
  return {*impl_, impl_->votes};
}

PartsRecognizer::Impl& PartsRecognizer::Votes::impl() const {
  if (vote_ != impl_->votes)
    throw std::logic_error("the recogniser has taken other votes since; use what vote() returned last");
  return *impl_;
}

std::span<const PartialVote> PartsRecognizer::Votes::ranked() const {
  return impl().ranked;
}

WindowsMatch PartsRecognizer::Votes::match(std::size_t object) const {
  const std::vector<float>& plain = impl().votes_of(object);
  return impl_->match_of(object, plain);
}

double PartsRecognizer::Votes::occluded_share(std::size_t object) const {
  const std::vector<float>& plain = impl().votes_of(object);
  return impl_->occluded_share(object, plain);
}

PartsAnswer PartsRecognizer::Votes::settle(std::size_t object) const {
  const std::vector<float>& plain = impl().votes_of(object);
  const double share = impl_->occluded_share(object, plain);
  if (share <= impl_->model.calibration[object].foreign_share) return impl_->find_poses(object, plain, share);
  return impl_->find_occluded_poses(object, plain, share);
}

PartsIdentification PartsRecognizer::Votes::identify_occluded() const {
  return impl().identify_occluded();
}

double PartsRecognizer::Votes::gain_of_masking(const PartsAnswer& answer) const {
  return impl().gain_of_masking(answer);
}

PartsRecognizer::Votes PartsRecognizer::Votes::without(std::size_t object, std::span<const int> views) const {
  impl().vote_without(object, views);
  return {*impl_, impl_->votes};
}

void PartsRecognizer::Impl::vote(std::span<const std::size_t> shortlist) {
  if (!windows_made) {
    mapper.compute(picture, map);
    make_query_windows(map, model.space, model.scale, model.voting, windows);
    windows_made = true;
  }
  ++votes;
  left_out_views.clear();
  ranked = matcher.match(windows, shortlist.empty() ? std::span<const std::size_t>(everything) : shortlist);
}

void PartsRecognizer::Impl::vote_without(std::size_t object, std::span<const int> views) {
  std::vector<int> candidates;
  const PartsObject& parts = model.objects[object];
  for (std::size_t c = 0; c < parts.candidates.size(); ++c)
    if (std::ranges::find(views, parts.candidates[c].view) != views.end())
      candidates.push_back(static_cast<int>(c));
  ranked = matcher.match_without(object, candidates);
  left_out_object = object;
  left_out_views.assign(views.begin(), views.end());
  ++votes;
}

WindowsMatch PartsRecognizer::Impl::match_of(std::size_t object, const std::vector<float>& plain) const {
  const auto share = [this](float sum) { return static_cast<double>(sum / windows.total_weight); };
  WindowsMatch match;
  match.votes = share(*std::ranges::max_element(plain));
  match.typical_votes = model.calibration[object].typical_votes;
  match.discriminating = share(std::ranges::find(ranked, object, &PartialVote::object)->score);
  const auto next =
      std::ranges::find_if(ranked, [object](const PartialVote& vote) { return vote.object != object; });
  if (next != ranked.end()) match.next = share(next->score);
  return match;
}

}  // namespace eigenpose
