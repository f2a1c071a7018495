#include "core/recognition/parts_recognizer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <opencv2/imgproc.hpp>

#include "core/alignment/masked_alignment.h"
#include "core/alignment/misalignment.h"
#include "core/base/insertion_sort.h"

namespace eigenpose {
namespace {

constexpr double window_count = QueryWindows::count;  // each window counts as one observation
constexpr double close_merit = 40.0;  // poses this close in merit are voted on again after alignment
constexpr std::size_t most_revoted = 3;
constexpr std::size_t most_occluded_starts = 6;  // peaks of the votes that are approached
/// Starts that are refined: at most this many, and those within this merit of the best of all objects.
constexpr std::size_t most_occluded_poses = 3;
constexpr double hopeless_merit = 20.0;
/// Weights of the merit of an occluded pose: see the header.
constexpr double vote_merit = 2.0 * window_count;
constexpr double visible_merit = 0.15 * window_count;
constexpr double unexplained_merit = 0.1;
/// Objects compared pixel by pixel in an occluded region: at most this many, with at least this share of the
/// most votes.
constexpr std::size_t most_rivals = 4;
constexpr double rival_votes = 0.8;
constexpr float familiar_likeness = 0.6F;                 // a window with this κ is fully trusted
constexpr double most_unexplained = 0.5 * 9.0 * 32 * 32;  // every pixel 3 σ off
constexpr double masked_reach = 12.0 / 360.0;

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

/// A pose of an occluded object that is being followed.
struct OccludedStart {
  MaskedPose pose;
  double votes = 0.0;
  double merit = 0.0;
};

/// An object that may be partly visible in an occluded region.
struct OccludedAnswer {
  PartsAnswer answer;
  std::vector<float> trust;           ///< of the pixels, by the object's best view
  std::vector<OccludedStart> starts;  ///< best first, not empty
};

struct PartsRecognizer::Impl {
  Impl(const PartsModel& learned, const DecisionModel& rule)
      : model(learned),
        decision(rule),
        mapper(learned.background),
        matcher(learned.objects, learned.scale, learned.voting),
        rematcher(learned.objects, learned.scale, learned.voting),
        aligner([&] {
          options.noise = learned.noise;
          return options;
        }()),
        masked_aligner(options) {
    everything.resize(learned.objects.size());
    std::iota(everything.begin(), everything.end(), std::size_t{0});
  }

  const PartsModel& model;
  const DecisionModel& decision;
  AlignmentOptions options;
  OrientationGridMaker mapper;
  PartialMatcher matcher;    ///< of the picture as it is
  PartialMatcher rematcher;  ///< of the picture aligned with one pose
  PoseAligner aligner;
  MaskedAligner masked_aligner;
  std::vector<std::size_t> everything;
  cv::Mat picture;
  cv::Mat pixels;  ///< the picture as floats, once they were asked for
  bool pixels_made = false;
  cv::Mat aligned_pixels;
  cv::Mat aligned;
  OrientationGrid map;
  QueryWindows windows;  ///< of the picture, once they were asked for
  bool windows_made = false;
  QueryWindows aligned_windows;
  PosePicture pose_picture;  ///< likewise
  bool pose_picture_made = false;
  std::uint64_t pictures = 0;  ///< looked at so far
  std::uint64_t votes = 0;     ///< taken so far
  std::span<const PartialVote> ranked;
  std::vector<float> plain_votes;    ///< of one object's views, in the picture
  std::vector<float> aligned_votes;  ///< the same in the aligned one
  std::vector<float> likeness;
  std::vector<float> background;
  double mean_foreign = 0.0;  ///< mean κ of the windows that foreign_share counted last

  const PosePicture& posed();
  void vote(std::span<const std::size_t> shortlist);
  void vote_without(std::size_t object, std::span<const int> views);
  WindowsMatch match_of(std::size_t object, const std::vector<float>& plain) const;
  PartsIdentification identify_occluded();
  /// ln of the cost of the best pose over all pixels, over that of the best pose over the visible ones.
  double gain_of_masking(const PartsAnswer& answer);
  const std::vector<float>& votes_of(std::size_t object);
  double share_after_alignment(std::size_t object, const PartsPose& pose);
  double foreign_share(std::size_t object, int candidate);
  /// The same of the view with most votes.
  double occluded_share(std::size_t object, const std::vector<float>& plain);
  PartsAnswer find_poses(std::size_t object, const std::vector<float>& plain, double occluded);
  OccludedAnswer approach_occluded(std::size_t object, const std::vector<float>& plain, double occluded);
  /// Follows the starts of this merit and more to the end.
  void refine_occluded(OccludedAnswer& found, double hopeless);
  /// Objects that may be occluded here, best first, each with a pose. The second is there if any other was
  /// voted for.
  std::vector<OccludedAnswer> find_rivals();
  /// The pose of a candidate, moved by the parabola through its neighbours' votes.
  [[nodiscard]] PoseVector voted_pose(std::size_t object, const std::vector<float>& plain,
                                      int candidate) const;
  [[nodiscard]] std::vector<float> pixel_trust() const;
};

const PosePicture& PartsRecognizer::Impl::posed() {
  if (!pose_picture_made) make_pose_picture(picture, pose_picture);
  pose_picture_made = true;
  return pose_picture;
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

double PartsRecognizer::Impl::foreign_share(std::size_t object, int candidate) {
  matcher.window_likeness(object, candidate, likeness, background);
  double count = 0.0;
  double sum = 0.0;
  for (const float kappa : likeness) {
    if (kappa >= foreign_likeness) continue;
    count += 1.0;
    sum += static_cast<double>(kappa);
  }
  mean_foreign = count > 0.0 ? sum / count : 0.0;
  return count / static_cast<double>(likeness.size());
}

double PartsRecognizer::Impl::occluded_share(std::size_t object, const std::vector<float>& plain) {
  const PartsObject& parts = model.objects[object];
  int best = 0;
  for (std::size_t c = 0; c < plain.size(); ++c) {
    if (!parts.candidates[c].mirrored && plain[c] > plain[static_cast<std::size_t>(best)]) {
      best = static_cast<int>(c);
    }
  }
  return foreign_share(object, best);
}

std::vector<float> PartsRecognizer::Impl::pixel_trust() const {
  // The trust of a cell is the mean over the windows that contain it; a pixel has its cell's, squared.
  constexpr int cells = OrientationGrid::cells;
  std::array<float, cells * cells> sum{};
  std::array<float, cells * cells> count{};
  for (std::size_t w = 0; w < likeness.size(); ++w) {
    const float trust =
        std::clamp((likeness[w] - foreign_likeness) / (familiar_likeness - foreign_likeness), 0.0F, 1.0F);
    const int row =
        static_cast<int>(w) / QueryWindows::per_side * QueryWindows::stride - OrientationGrid::pad;
    const int column =
        static_cast<int>(w) % QueryWindows::per_side * QueryWindows::stride - OrientationGrid::pad;
    for (int r = std::max(row, 0); r < std::min(row + WindowGrid::window, cells); ++r) {
      for (int c = std::max(column, 0); c < std::min(column + WindowGrid::window, cells); ++c) {
        sum[static_cast<std::size_t>(r * cells + c)] += trust;
        count[static_cast<std::size_t>(r * cells + c)] += 1.0F;
      }
    }
  }
  constexpr int side = 32;
  std::vector<float> weights(static_cast<std::size_t>(side) * side);
  for (int r = 0; r < side; ++r) {
    for (int c = 0; c < side; ++c) {
      const auto cell = static_cast<std::size_t>(r * cells / side * cells + c * cells / side);
      const float mean = sum[cell] / std::max(count[cell], 1.0F);
      weights[static_cast<std::size_t>(r * side + c)] = mean * mean;
    }
  }
  return weights;
}

PartsAnswer PartsRecognizer::Impl::find_poses(std::size_t object, const std::vector<float>& plain,
                                              double occluded) {
  PartsAnswer answer;
  answer.object = object;
  answer.occluded = occluded;
  const PartsObject& parts = model.objects[object];
  const AlignmentEigenspace& space = model.poses[object];
  const auto merit = [&](const PartsPose& pose) {
    return window_count * pose.votes - 0.5 * pose.cost / model.noise;
  };
  for (const AlignedPose& found : aligner.align(posed(), space)) {
    PartsPose pose{
        found.q, found.q_covariance, found.misalignment, 0.5 * (found.cost + found.fine_cost), 0.0, 0.0, 0.0};
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

PoseVector PartsRecognizer::Impl::voted_pose(std::size_t object, const std::vector<float>& plain,
                                             int candidate) const {
  const PartsObject& parts = model.objects[object];
  const auto axes = model.poses[object].coarse_manifold().axes();
  PoseVector q;
  q.resize(axes.size());
  const int view = parts.candidates[static_cast<std::size_t>(candidate)].view;
  for (std::size_t a = 0; a < axes.size(); ++a)
    q[a] = model.view_poses[object](static_cast<Eigen::Index>(a), view);
  const auto& near = parts.neighbours[static_cast<std::size_t>(candidate)];
  if (axes.size() == 1 && near[0] >= 0 && near[1] >= 0) {
    const double after = plain[static_cast<std::size_t>(near[0])];
    const double before = plain[static_cast<std::size_t>(near[1])];
    const double curvature = after - 2.0 * plain[static_cast<std::size_t>(candidate)] + before;
    if (curvature < 0.0) {
      const double step = axes[0].dof.period() / static_cast<double>(axes[0].samples.size());
      q[0] = axes[0].dof.canonical(q[0] + step * std::clamp(0.5 * (before - after) / curvature, -1.0, 1.0));
    }
  }
  return q;
}

OccludedAnswer PartsRecognizer::Impl::approach_occluded(std::size_t object, const std::vector<float>& plain,
                                                        double occluded) {
  const PartsObject& parts = model.objects[object];
  OccludedAnswer found;
  found.answer.object = object;
  found.answer.occluded = occluded;
  // Views with more votes than their neighbours, most votes first.
  std::vector<int> peaks;
  for (std::size_t c = 0; c < plain.size(); ++c) {
    const auto& near = parts.neighbours[c];
    if (!parts.candidates[c].mirrored &&
        (near[0] < 0 || plain[c] >= plain[static_cast<std::size_t>(near[0])]) &&
        (near[1] < 0 || plain[c] >= plain[static_cast<std::size_t>(near[1])])) {
      peaks.push_back(static_cast<int>(c));
    }
  }
  std::sort(peaks.begin(), peaks.end(), [&](int a, int b) {
    return plain[static_cast<std::size_t>(a)] > plain[static_cast<std::size_t>(b)];
  });
  peaks.resize(std::min(peaks.size(), most_occluded_starts));
  // All poses are compared on the pixels that the best view trusts.
  foreign_share(object, peaks.front());
  found.trust = pixel_trust();
  masked_aligner.look(posed(), model.poses[object], found.trust);
  found.answer.foreign_likeness = mean_foreign;
  found.starts.reserve(peaks.size());
  for (const int peak : peaks) {
    OccludedStart start{masked_aligner.approach(voted_pose(object, plain, peak), masked_reach),
                        plain[static_cast<std::size_t>(peak)] / windows.total_weight, 0.0};
    start.merit =
        vote_merit * start.votes - visible_merit * std::log(std::max(start.pose.aligned.cost, model.noise));
    found.starts.push_back(start);
  }
  std::ranges::stable_sort(found.starts, std::greater<>(), &OccludedStart::merit);
  return found;
}

void PartsRecognizer::Impl::refine_occluded(OccludedAnswer& found, double hopeless) {
  PartsAnswer& answer = found.answer;
  masked_aligner.look(posed(), model.poses[answer.object], found.trust);
  for (OccludedStart& start : found.starts) {
    const bool followed = start.merit >= hopeless && answer.poses.size() < most_occluded_poses;
    if (!followed) break;
    masked_aligner.refine(start.pose, masked_reach);
    const AlignedPose& pose = start.pose.aligned;
    const double merit = vote_merit * start.votes -
                         visible_merit * std::log(std::max(pose.cost, model.noise)) -
                         unexplained_merit * start.pose.unexplained;
    answer.poses.push_back({pose.q, pose.q_covariance, pose.misalignment, pose.cost, start.votes, merit,
                            start.pose.unexplained / most_unexplained});
  }
  insertion_sort(answer.poses, [](const PartsPose& a, const PartsPose& b) { return a.merit > b.merit; });
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
  OccludedAnswer found = impl_->approach_occluded(object, plain, share);
  impl_->refine_occluded(found, found.starts.front().merit - hopeless_merit);
  return found.answer;
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
  ranked = matcher.match(windows, shortlist.empty() ? std::span<const std::size_t>(everything) : shortlist);
}

void PartsRecognizer::Impl::vote_without(std::size_t object, std::span<const int> views) {
  std::vector<int> candidates;
  const PartsObject& parts = model.objects[object];
  for (std::size_t c = 0; c < parts.candidates.size(); ++c)
    if (std::ranges::find(views, parts.candidates[c].view) != views.end())
      candidates.push_back(static_cast<int>(c));
  ranked = matcher.match_without(object, candidates);
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

std::vector<OccludedAnswer> PartsRecognizer::Impl::find_rivals() {
  std::vector<OccludedAnswer> rivals;
  const auto approach = [&](const PartialVote& vote) {
    const std::vector<float>& plain = votes_of(vote.object);
    rivals.push_back(approach_occluded(vote.object, plain, occluded_share(vote.object, plain)));
  };
  for (std::size_t i = 0; i < std::min(most_rivals, ranked.size()); ++i) {
    if (ranked[i].score < rival_votes * ranked[0].score) break;
    approach(ranked[i]);
  }
  double most = -std::numeric_limits<double>::infinity();
  for (const OccludedAnswer& rival : rivals) most = std::max(most, rival.starts.front().merit);
  double best = -std::numeric_limits<double>::infinity();
  for (OccludedAnswer& rival : rivals) {
    refine_occluded(rival, most - hopeless_merit);
    if (!rival.answer.poses.empty()) best = std::max(best, rival.answer.poses.front().merit);
  }
  // The second object is reported in any case, by its approached pose if it was not refined.
  const std::size_t contenders = rivals.size();
  if (rivals.size() == 1 && ranked.size() > 1 && ranked[1].score > 0.0F) approach(ranked[1]);
  for (OccludedAnswer& rival : rivals) {
    if (!rival.answer.poses.empty()) continue;
    const OccludedStart& start = rival.starts.front();
    const AlignedPose& pose = start.pose.aligned;
    rival.answer.poses.push_back({pose.q, pose.q_covariance, pose.misalignment, pose.cost, start.votes,
                                  best - std::max(most - start.merit, hopeless_merit)});
  }
  const auto refined = std::span(rivals).first(contenders);
  std::ranges::stable_sort(refined, std::greater<>(),
                           [](const OccludedAnswer& rival) { return rival.answer.poses.front().merit; });
  return rivals;
}

double PartsRecognizer::Impl::gain_of_masking(const PartsAnswer& answer) {
  const auto above_noise = [this](double cost) { return std::log(std::max(cost, model.noise)); };
  return above_noise(aligner.align(posed(), model.poses[answer.object]).front().cost) -
         above_noise(answer.poses.front().cost);
}

PartsIdentification PartsRecognizer::Impl::identify_occluded() {
  const std::vector<OccludedAnswer> rivals = find_rivals();
  PartsIdentification found;
  found.best = rivals[0].answer;
  const double merit = found.best.poses.front().merit;
  found.match = {match_of(found.best.object, votes_of(found.best.object)), found.best.occluded, merit,
                 found.best.poses.front().unexplained, found.best.foreign_likeness};
  found.evidence = evidence_of(decision.weights, found.match);
  found.second_evidence = -std::numeric_limits<double>::infinity();
  if (rivals.size() > 1) {
    found.second = rivals[1].answer;
    found.second_evidence = found.evidence - (merit - found.second->poses.front().merit);
  }
  return found;
}

}  // namespace eigenpose
