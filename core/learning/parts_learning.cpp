#include "core/learning/parts_learning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <stdexcept>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/statistics.h"
#include "core/base/work_meter.h"
#include "core/manifold/sample_grid.h"
#include "core/windows/foreshortened_views.h"

namespace eigenpose {
namespace {

constexpr double foreshortenings[] = {1.0, 0.8, 1.25};
/// The interpolation error at a left-out view is that of twice the learned step; halfway between learned
/// views it is this many times smaller.
constexpr double left_out_over_between = 40.0;
constexpr double default_noise = 5e-3;  // where too few views can be left out, and for several DOFs

/// True where the views of some axis are farther apart than `step` of its range.
bool sparse(const std::vector<SampleAxis>& axes, double step) {
  return std::any_of(axes.begin(), axes.end(), [step](const SampleAxis& axis) {
    return axis.samples.size() > 1 && axis.dof.periodic &&
           1.0 / static_cast<double>(axis.samples.size()) > step * 1.0001;
  });
}

/// The two neighbours of a view along the axis that runs fastest and has more than one view; −1 for none.
std::array<int, 2> neighbours_of(std::span<const SampleAxis> axes, const Grid& grid, std::size_t view) {
  for (std::size_t a = axes.size(); a-- > 0;) {
    if (grid.count(a) < 2) continue;
    const auto beside = [&](int steps) {
      const auto found = grid.neighbour(view, a, steps, ends_of(axes[a]));
      return found ? static_cast<int>(*found) : -1;
    };
    return {beside(1), beside(-1)};
  }
  return {-1, -1};
}

/// The two nearest views of each, where views are no grid: near in steps of each axis. −1 where there are
/// fewer.
std::vector<std::array<int, 2>> nearest_views(const PartsViews& views) {
  const auto count = static_cast<int>(views.count);
  std::vector<std::array<int, 2>> result;
  for (int v = 0; v < count; ++v) {
    std::array<int, 2> near{-1, -1};
    std::array<double, 2> distance{};
    for (int other = 0; other < count; ++other) {
      if (other == v) continue;
      double squared = 0.0;
      for (std::size_t a = 0; a < views.axes.size(); ++a) {
        const auto& [dof, samples] = views.axes[a];
        const auto row = static_cast<Eigen::Index>(a);
        const double steps = dof.difference(views.poses(row, other), views.poses(row, v)) *
                             static_cast<double>(samples.size()) / dof.period();
        squared += steps * steps;
      }
      for (std::size_t place = 0; place < near.size(); ++place) {
        if (near[place] >= 0 && squared >= distance[place]) continue;
        if (place == 0) {
          near[1] = near[0];
          distance[1] = distance[0];
        }
        near[place] = other;
        distance[place] = squared;
        break;
      }
    }
    result.push_back(near);
  }
  return result;
}

/// A picture that regions are compared with: a learned view, or a copy made of it.
struct Lane {
  std::size_t view = 0;
  cv::Mat picture;  ///< empty: the view itself
};

/// Which copies of the views are learned beside them.
enum class Copies { none, foreshortened_and_mirrored };

/// Lanes of one object; sets its candidates and their neighbours.
std::vector<Lane> make_lanes(const PartsViews& views, Copies copies, PartsObject& object) {
  const bool companions = copies == Copies::foreshortened_and_mirrored;
  std::vector<Lane> lanes;
  const int count = static_cast<int>(views.count);
  std::vector<std::array<int, 2>> neighbours;
  if (views.poses.size() > 0) {
    neighbours = nearest_views(views);
  } else {
    const Grid grid = grid_of(views.axes);
    for (std::size_t v = 0; v < views.count; ++v) neighbours.push_back(neighbours_of(views.axes, grid, v));
  }
  for (int copy = 0; copy < (companions ? 2 : 1); ++copy) {
    for (int v = 0; v < count; ++v) {
      object.candidates.push_back({v, copy == 1});
      std::array<int, 2> near = neighbours[static_cast<std::size_t>(v)];
      for (int& n : near) n = n < 0 ? n : n + copy * count;
      object.neighbours.push_back(near);
      cv::Mat picture;
      if (companions) {
        const cv::Mat view = views.view(static_cast<std::size_t>(v));
        picture = copy == 1 ? mirrored(view) : view;
      }
      for (const double factor : foreshortenings) {
        if (factor != 1.0 && !companions) continue;
        lanes.push_back(
            {static_cast<std::size_t>(v), factor == 1.0 ? picture : foreshortened(picture, factor)});
        object.lane_candidate.push_back(static_cast<std::uint32_t>(object.candidates.size() - 1));
      }
    }
  }
  return lanes;
}

AlignmentEigenspace learn_alignment(const PartsViews& views) {
  if (views.alignment != nullptr) return views.alignment->with_left_out_errors(views.left_out_errors);
  std::vector<PosePicture> pictures(views.count);
  for (std::size_t v = 0; v < views.count; ++v) make_pose_picture(views.view(v), pictures[v]);
  return AlignmentEigenspace::learn(views.axes, pictures, views.poses);
}

ColorViews learn_colors(const PartsViews& views, const std::array<float, 3>& background) {
  std::vector<ChromaticityMap> maps;
  for (std::size_t v = 0; v < views.count; ++v) maps.push_back(chromaticity_map(views.view(v), background));
  return ColorViews(std::move(maps));
}

double median_left_out_error(const std::vector<AlignmentEigenspace>& spaces) {
  std::vector<double> medians;
  for (const AlignmentEigenspace& space : spaces) {
    std::vector<double> errors = space.left_out_errors();
    if (!errors.empty()) medians.push_back(upper_median(errors));
  }
  return medians.empty() ? default_noise * left_out_over_between : upper_median(medians);
}

/// The orientation grids of all views, object after object.
struct Grids {
  std::vector<std::size_t> first;  ///< view of each object
  std::vector<OrientationGrid> grids;
};

/// Computes the orientation grids of all views; takes the background level off, which goes into the model.
Grids compute_grids(const std::vector<PartsViews>& objects, const PartsLearningOptions& options,
                    WorkMeter& meter, PartsModel& model) {
  Grids result;
  std::size_t views = 0;
  for (const PartsViews& object : objects) {
    result.first.push_back(views);
    views += object.count;
  }
  result.grids.resize(views);
  parallel_for(objects.size(), options.threads, [&](std::size_t o) {
    meter.check_stop();
    OrientationGridMaker mapper;
    for (std::size_t v = 0; v < objects[o].count; ++v)
      mapper.compute(objects[o].view(v), result.grids[result.first[o] + v]);
    meter.finished(1);
  });
  model.background = background_level(result.grids);
  for (OrientationGrid& grid : result.grids) take_off(model.background, grid);
  return result;
}

/// Coordinates of the windows of every lane, object by object; sets the model's candidates and lanes, and the
/// scale for all coordinates.
std::vector<std::vector<Eigen::MatrixXf>> project_windows(const std::vector<PartsViews>& objects,
                                                          const Grids& grids,
                                                          const PartsLearningOptions& options,
                                                          WorkMeter& meter, PartsModel& model) {
  std::vector<std::vector<Eigen::MatrixXf>> windows(objects.size());
  std::vector<float> largest(objects.size(), 0.0F);
  parallel_for(objects.size(), options.threads, [&](std::size_t o) {
    meter.check_stop();
    OrientationGridMaker mapper(model.background);
    OrientationGrid made;
    const Copies copies =
        sparse(objects[o].axes, options.sparse_step) ? Copies::foreshortened_and_mirrored : Copies::none;
    for (const Lane& lane : make_lanes(objects[o], copies, model.objects[o])) {
      if (!lane.picture.empty()) mapper.compute(lane.picture, made);
      windows[o].emplace_back();
      model.space.project(lane.picture.empty() ? grids.grids[grids.first[o] + lane.view] : made, 1,
                          windows[o].back(), nullptr);
      largest[o] = std::max(largest[o], windows[o].back().cwiseAbs().maxCoeff());
    }
    meter.finished(1);
  });
  model.scale = WindowScale::for_range(*std::ranges::max_element(largest));
  return windows;
}

}  // namespace

PartsModel learn_parts(const std::vector<PartsViews>& objects, const PartsLearningOptions& options,
                       const Progress& progress, const std::stop_token& stop) {
  if (objects.empty() || objects.front().count == 0) {
    throw std::invalid_argument("learning windows needs at least one object with a view");
  }
  PartsModel model;
  model.bands = objects.front().view(0).channels();
  const std::size_t count = objects.size();
  model.objects.resize(count);
  model.poses.resize(count);
  model.calibration.resize(count);  // yardsticks come from core/learning/calibration
  model.view_poses.resize(count);
  if (model.bands == 3) model.colors.resize(count);

  WorkMeter orientations_meter(progress, stop, "computing orientations", count);
  Grids grids = compute_grids(objects, options, orientations_meter, model);
  model.space = WindowSpace::learn(grids.grids, options.threads);
  WorkMeter windows_meter(progress, stop, "learning windows", count);
  auto windows = project_windows(objects, grids, options, windows_meter, model);
  grids = {};
  WorkMeter alignment_meter(progress, stop, "learning alignment", count);
  parallel_for(count, options.threads, [&](std::size_t o) {
    alignment_meter.check_stop();
    model.objects[o].store = WindowStore(windows[o], model.scale);
    windows[o].clear();
    model.poses[o] = learn_alignment(objects[o]);
    if (model.bands == 3) model.colors[o] = learn_colors(objects[o], model.background);
    model.view_poses[o] = objects[o].poses.size() > 0 ? objects[o].poses : grid_poses(objects[o].axes);
    alignment_meter.finished(1);
  });
  model.noise = median_left_out_error(model.poses) / left_out_over_between;
  return model;
}

}  // namespace eigenpose
