#include "core/model/parts_file.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace eigenpose {
namespace {

void write_scale(const Hdf5Group& group, const PoseScale& scale, const Manifold& manifold) {
  group.write("side", std::int64_t{scale.side});
  group.write("basis", scale.basis);
  group.write("mean", Eigen::MatrixXf(scale.mean));
  group.write("degree", std::int64_t{manifold.degree()});
  group.write("coefficients", manifold.coefficients());
}

PoseScale read_scale(const Hdf5Group& group) {
  PoseScale scale;
  scale.side = static_cast<int>(group.read_integer("side", 1, PosePicture::side));
  scale.basis = group.read_floats("basis");
  scale.mean = group.read_floats("mean");
  return scale;
}

Manifold read_manifold(const Hdf5Group& group, const Manifold& like) {
  const auto axes = like.axes();
  return Manifold::from_coefficients({axes.begin(), axes.end()}, group.read_doubles("coefficients"),
                                     static_cast<int>(group.read_integer("degree", 1, 3)));
}

/// An index as files keep them. @throws Hdf5Failure for one out of range, or none at all.
int whole_number(double value, int lower, int upper) {
  if (!(value >= lower && value <= upper)) throw Hdf5Failure("has windows that do not fit together");
  return static_cast<int>(value);
}

void write_voting(const Hdf5Group& group, const VotingOptions& voting) {
  group.write("tolerance_cells", std::int64_t{voting.tolerance.cells});
  group.write("tolerance_penalty", static_cast<double>(voting.tolerance.penalty));
  group.write("width", static_cast<double>(voting.width));
  group.write("pooling", static_cast<double>(voting.pooling));
  group.write("background_rank", std::int64_t{voting.background_rank});
  group.write("floor_weight", static_cast<double>(voting.floor_weight));
}

VotingOptions read_voting(const Hdf5Group& group) {
  VotingOptions voting;
  voting.tolerance.cells = static_cast<int>(group.read_integer("tolerance_cells", 0, WindowGrid::side));
  voting.tolerance.penalty = static_cast<float>(group.read_double("tolerance_penalty"));
  voting.width = static_cast<float>(group.read_double("width"));
  voting.pooling = static_cast<float>(group.read_double("pooling"));
  voting.background_rank = static_cast<int>(group.read_integer("background_rank", 1, 1'000'000));
  voting.floor_weight = static_cast<float>(group.read_double("floor_weight"));
  return voting;
}

void write_windows(const Hdf5Group& group, const PartsObject& object) {
  // One row a candidate: view, mirrored, its two neighbours.
  Eigen::MatrixXd candidates(4, static_cast<Eigen::Index>(object.candidates.size()));
  for (std::size_t c = 0; c < object.candidates.size(); ++c) {
    candidates.col(static_cast<Eigen::Index>(c)) << object.candidates[c].view,
        object.candidates[c].mirrored ? 1.0 : 0.0, object.neighbours[c][0], object.neighbours[c][1];
  }
  group.write("candidates", candidates);
  Eigen::MatrixXd lanes(1, static_cast<Eigen::Index>(object.lane_candidate.size()));
  for (std::size_t i = 0; i < object.lane_candidate.size(); ++i) {
    lanes(0, static_cast<Eigen::Index>(i)) = object.lane_candidate[i];
  }
  group.write("lanes", lanes);
  group.write("windows", object.store.values());
}

PartsObject read_windows(const Hdf5Group& group, const WindowScale& scale) {
  PartsObject object;
  const Eigen::MatrixXd candidates = group.read_doubles("candidates");
  const Eigen::MatrixXd lanes = group.read_doubles("lanes");
  if (candidates.rows() != 4 || candidates.cols() == 0 || lanes.rows() != 1) {
    throw Hdf5Failure("has windows that do not fit together");
  }
  const auto count = static_cast<int>(candidates.cols());
  for (int c = 0; c < count; ++c) {
    object.candidates.push_back({whole_number(candidates(0, c), 0, count - 1), candidates(1, c) != 0.0});
    object.neighbours.push_back(
        {whole_number(candidates(2, c), -1, count - 1), whole_number(candidates(3, c), -1, count - 1)});
  }
  for (Eigen::Index i = 0; i < lanes.cols(); ++i)
    object.lane_candidate.push_back(static_cast<std::uint32_t>(whole_number(lanes(0, i), 0, count - 1)));
  object.store = WindowStore(object.lane_candidate.size(), group.read_bytes("windows"), scale);
  return object;
}

/// 2 × views: zeros of an object whose views came ready-cut, one column of zeros where those of all objects
/// did.
Eigen::MatrixXd extents_matrix(const std::vector<cv::Size>& extents) {
  Eigen::MatrixXd matrix =
      Eigen::MatrixXd::Zero(2, std::max<Eigen::Index>(1, static_cast<Eigen::Index>(extents.size())));
  for (std::size_t v = 0; v < extents.size(); ++v)
    matrix.col(static_cast<Eigen::Index>(v)) << extents[v].width, extents[v].height;
  return matrix;
}

std::vector<cv::Size> read_extents(const Eigen::MatrixXd& matrix, const PartsObject& object) {
  if (matrix.rows() == 2 && matrix.cols() == 1 && matrix.isZero(0.0)) return {};
  const auto views = std::count_if(object.candidates.begin(), object.candidates.end(),
                                   [](const Candidate& candidate) { return !candidate.mirrored; });
  const bool ready_cut = matrix.isZero(0.0);
  if (matrix.rows() != 2 || matrix.cols() != views ||
      !(ready_cut || (matrix.minCoeff() >= 1.0 && matrix.maxCoeff() <= 1e5)))
    throw Hdf5Failure("has views of sizes that cannot be");
  std::vector<cv::Size> extents;
  for (Eigen::Index v = 0; v < matrix.cols(); ++v)
    extents.emplace_back(static_cast<int>(matrix(0, v)), static_cast<int>(matrix(1, v)));
  return extents;
}

/// m × views: as written, or of the grid.
Eigen::MatrixXd read_view_poses(const Hdf5Group& group, const AlignmentEigenspace& pose,
                                const PartsObject& object) {
  const auto axes = pose.coarse_manifold().axes();
  Eigen::MatrixXd poses = group.has("poses") ? group.read_doubles("poses") : grid_poses(axes);
  const bool fits =
      std::all_of(object.candidates.begin(), object.candidates.end(),
                  [&](const Candidate& one) { return one.view >= 0 && one.view < poses.cols(); });
  if (poses.rows() != static_cast<Eigen::Index>(axes.size()) || !fits || !poses.allFinite())
    throw Hdf5Failure("has views whose poses do not fit together");
  return poses;
}

/// One row a view: u, v and brightness of each pixel.
void write_colors(const Hdf5Group& group, const ColorViews& colors) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(colors.maps().size() * ChromaticityMap::bytes);
  for (const ChromaticityMap& map : colors.maps())
    for (const auto* plane : {&map.u, &map.v, &map.brightness})
      bytes.insert(bytes.end(), plane->begin(), plane->end());
  group.write("colors", bytes);
}

ColorViews read_colors(const Hdf5Group& group, std::size_t views) {
  std::vector<std::uint8_t> bytes(views * ChromaticityMap::bytes);
  group.read_bytes("colors", bytes);
  std::vector<ChromaticityMap> maps(views);
  auto from = bytes.begin();
  for (ChromaticityMap& map : maps)
    for (auto* plane : {&map.u, &map.v, &map.brightness}) {
      std::copy_n(from, plane->size(), plane->begin());
      from += static_cast<std::ptrdiff_t>(plane->size());
    }
  return ColorViews(std::move(maps));
}

}  // namespace

void write_parts(const Hdf5Group& group, const PartsModel& parts) {
  group.write("bands", std::int64_t{parts.bands});
  group.write("background",
              Eigen::MatrixXf(Eigen::Map<const Eigen::MatrixXf>(parts.background.data(), 3, 1)));
  group.write("mean", Eigen::MatrixXf(parts.space.mean()));
  group.write("basis", parts.space.basis());
  group.write("mean_mass", static_cast<double>(parts.space.mean_mass()));
  group.write("learned_step", static_cast<double>(parts.scale.learned));
  group.write("query_step", static_cast<double>(parts.scale.query));
  write_voting(group.make_group("voting"), parts.voting);
  group.write("noise", parts.noise);
  const Hdf5Group objects = group.make_group("objects");
  for (std::size_t o = 0; o < parts.objects.size(); ++o) {
    const Hdf5Group object = objects.make_group(numbered(o));
    write_windows(object, parts.objects[o]);
    object.write("typical_votes", parts.calibration[o].typical_votes);
    object.write("foreign_share", parts.calibration[o].foreign_share);
    object.write("typical_color", parts.calibration[o].typical_color);
    if (!parts.colors.empty()) write_colors(object, parts.colors[o]);
    object.write("extents",
                 extents_matrix(o < parts.extents.size() ? parts.extents[o] : std::vector<cv::Size>()));
    const AlignmentEigenspace& pose = parts.poses[o];
    if (o < parts.view_poses.size() && parts.view_poses[o] != grid_poses(pose.coarse_manifold().axes()))
      object.write("poses", parts.view_poses[o]);
    object.write("pixel_mean", Eigen::MatrixXf(pose.pixel_mean()));
    write_scale(object.make_group("coarse"), pose.coarse(), pose.coarse_manifold());
    write_scale(object.make_group("fine"), pose.fine(), pose.fine_manifold());
  }
}

PartsModel read_parts(const Hdf5Group& group, const std::vector<ModelObject>& objects) {
  PartsModel parts;
  parts.bands = static_cast<int>(group.read_integer("bands", 1, 3));
  const Eigen::MatrixXf background = group.read_floats("background");
  const Hdf5Group stored = group.open_group("objects");
  const std::vector<std::string> names = stored.group_names();
  if (background.size() != 3 || names.size() != objects.size() || (parts.bands != 1 && parts.bands != 3)) {
    throw Hdf5Failure("has windows that do not fit its objects");
  }
  std::copy_n(background.data(), 3, parts.background.begin());
  parts.space = WindowSpace::from_parts(group.read_floats("mean"), group.read_floats("basis"),
                                        static_cast<float>(group.read_double("mean_mass")));
  if (parts.space.length() != window_length(parts.bands)) {
    throw Hdf5Failure("has windows of another kind than its bands");
  }
  parts.scale = {static_cast<float>(group.read_double("learned_step")),
                 static_cast<float>(group.read_double("query_step"))};
  parts.voting = read_voting(group.open_group("voting"));
  parts.noise = group.read_double("noise");
  for (std::size_t o = 0; o < names.size(); ++o) {
    const Hdf5Group object = stored.open_group(names[o]);
    parts.objects.push_back(read_windows(object, parts.scale));
    PartsCalibration calibration;
    calibration.typical_votes = object.read_double("typical_votes");
    calibration.foreign_share = object.read_double("foreign_share");
    calibration.typical_color = object.read_double("typical_color");
    parts.calibration.push_back(calibration);
    parts.extents.push_back(read_extents(object.read_doubles("extents"), parts.objects.back()));
    const Hdf5Group coarse = object.open_group("coarse");
    const Hdf5Group fine = object.open_group("fine");
    parts.poses.push_back(AlignmentEigenspace::from_parts(
        read_scale(coarse), read_scale(fine), object.read_floats("pixel_mean"),
        read_manifold(coarse, objects[o].manifold), read_manifold(fine, objects[o].manifold)));
    parts.view_poses.push_back(read_view_poses(object, parts.poses.back(), parts.objects.back()));
    if (parts.bands == 3)
      parts.colors.push_back(read_colors(object, static_cast<std::size_t>(parts.view_poses.back().cols())));
  }
  return parts;
}

}  // namespace eigenpose
