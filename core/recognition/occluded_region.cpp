#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "core/base/insertion_sort.h"
#include "core/recognition/parts_recognizer_impl.h"

namespace eigenpose {
namespace {

constexpr double window_count = QueryWindows::count;  // each window counts as one observation
constexpr std::size_t most_occluded_starts = 6;       // peaks of the votes that are approached
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
constexpr int trust_side = 32;  // pixels of the visible part

}  // namespace

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
  constexpr int side = trust_side;
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

std::optional<ColorMatch> PartsRecognizer::Impl::color_match_of_visible(std::size_t object,
                                                                        std::span<const float> trust) {
  if (model.colors.empty()) return std::nullopt;
  make_colors();
  constexpr int block = trust_side / ChromaticityMap::side;
  std::array<float, ChromaticityMap::pixels> visible{};
  for (int y = 0; y < trust_side; ++y)
    for (int x = 0; x < trust_side; ++x)
      visible[static_cast<std::size_t>(y / block * ChromaticityMap::side + x / block)] +=
          trust[static_cast<std::size_t>(y * trust_side + x)] / static_cast<float>(block * block);
  const std::span<const int> left_out =
      object == left_out_object ? std::span<const int>(left_out_views) : std::span<const int>();
  return ColorMatch{model.colors[object].distance(colors, visible, left_out),
                    model.calibration[object].typical_color};
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
  found.answer.foreign_likeness = foreign_windows(object, peaks.front()).mean_likeness;
  found.trust = pixel_trust();
  masked_aligner.look(posed(), model.poses[object], found.trust);
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
  const PartsPose& pose = found.best.poses.front();
  found.match = {match_of(found.best.object, votes_of(found.best.object)),
                 found.best.occluded,
                 pose.merit,
                 pose.unexplained,
                 found.best.foreign_likeness,
                 color_match_of_visible(found.best.object, rivals[0].trust)};
  found.evidence = evidence_of(decision.weights, found.match);
  found.second_evidence = -std::numeric_limits<double>::infinity();
  if (rivals.size() > 1) {
    found.second = rivals[1].answer;
    found.second_evidence = found.evidence - (pose.merit - found.second->poses.front().merit);
  }
  return found;
}

PartsAnswer PartsRecognizer::Impl::find_occluded_poses(std::size_t object, const std::vector<float>& plain,
                                                       double occluded) {
  OccludedAnswer found = approach_occluded(object, plain, occluded);
  refine_occluded(found, found.starts.front().merit - hopeless_merit);
  return found.answer;
}

}  // namespace eigenpose
