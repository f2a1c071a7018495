#include "core/learning/parts_learning.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/windows/foreshortened_views.h"

namespace eigenpose {
namespace {

constexpr double foreshortenings[] = {1.0, 0.8, 1.25};
/// The spline's error at a view that was left out is measured over twice the learned step; between learned
/// views it is this many times smaller.
constexpr double left_out_over_between = 40.0;
constexpr double default_noise = 5e-3;  // where too few views can be left out

void check_stop(const std::stop_token& stop) {
  if (stop.stop_requested()) {
    throw Interrupted();
  }
}

/// True where the views of some axis are farther apart than `step` of its range.
bool sparse(const std::vector<SampleAxis>& axes, double step) {
  return std::any_of(axes.begin(), axes.end(), [step](const SampleAxis& axis) {
    return axis.samples.size() > 1 && axis.dof.periodic &&
           1.0 / static_cast<double>(axis.samples.size()) > step * 1.0001;
  });
}

/// The two neighbours of a view along the axis that runs fastest and has more than one view.
std::array<int, 2> neighbours_of(const std::vector<SampleAxis>& axes, int view) {
  int stride = 1;
  for (std::size_t a = axes.size(); a-- > 0;) {
    const int count = static_cast<int>(axes[a].samples.size());
    if (count > 1 && axes[a].dof.periodic) {
      const int place = view / stride % count;
      const auto moved = [&](int to) { return view + ((to + count) % count - place) * stride; };
      return {moved(place + 1), moved(place - 1)};
    }
    if (count > 1) {
      const int place = view / stride % count;
      return {place + 1 < count ? view + stride : -1, place > 0 ? view - stride : -1};
    }
    stride *= count;
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

/// What a learned view is compared with: itself, or a picture made of it.
struct Lane {
  std::size_t view = 0;
  cv::Mat picture;  ///< empty: the view itself
};

/// Candidates and lanes of one object.
std::vector<Lane> make_lanes(const PartsViews& views, bool companions, PartsObject& object) {
  std::vector<Lane> lanes;
  const int count = static_cast<int>(views.count);
  std::vector<std::array<int, 2>> neighbours;
  if (views.poses.size() > 0)
    neighbours = nearest_views(views);
  else
    for (int v = 0; v < count; ++v) neighbours.push_back(neighbours_of(views.axes, v));
  for (int copy = 0; copy < (companions ? 2 : 1); ++copy) {
    for (int v = 0; v < count; ++v) {
      object.candidates.push_back({v, copy == 1});
      std::array<int, 2> near = neighbours[static_cast<std::size_t>(v)];
      for (int& n : near) {
        n = n < 0 ? n : n + copy * count;
      }
      object.neighbours.push_back(near);
      cv::Mat picture;
      if (companions) {
        const cv::Mat view = views.view(static_cast<std::size_t>(v));
        picture = copy == 1 ? mirrored(view) : view;
      }
      for (const double factor : foreshortenings) {
        if (factor != 1.0 && !companions) {
          continue;
        }
        lanes.push_back(
            {static_cast<std::size_t>(v), factor == 1.0 ? picture : foreshortened(picture, factor)});
        object.lane_candidate.push_back(static_cast<std::uint32_t>(object.candidates.size() - 1));
      }
    }
  }
  return lanes;
}

double median_left_out_error(const std::vector<AlignmentEigenspace>& spaces) {
  std::vector<double> medians;
  for (const AlignmentEigenspace& space : spaces) {
    std::vector<double> errors = space.left_out_errors();
    if (errors.empty()) {
      continue;
    }
    const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
    std::nth_element(errors.begin(), middle, errors.end());
    medians.push_back(*middle);
  }
  if (medians.empty()) {
    return default_noise * left_out_over_between;
  }
  const auto middle = medians.begin() + static_cast<std::ptrdiff_t>(medians.size() / 2);
  std::nth_element(medians.begin(), middle, medians.end());
  return *middle;
}

}  // namespace

PartsModel learn_parts(const std::vector<PartsViews>& objects, const PartsLearningOptions& options,
                       const Progress& progress, std::stop_token stop) {
  if (objects.empty() || objects.front().count == 0) {
    throw std::invalid_argument("learning parts needs at least one object with a view");
  }
  PartsModel model;
  model.bands = objects.front().view(0).channels();
  const std::size_t count = objects.size();
  model.objects.resize(count);
  model.poses.resize(count);
  model.calibration.resize(count);
  model.view_poses.resize(count);

  // Cell maps of the plain views give background and window eigenspace.
  std::vector<std::size_t> first(count);  // view of each object
  std::size_t views = 0;
  for (std::size_t o = 0; o < count; ++o) {
    first[o] = views;
    views += objects[o].count;
  }
  std::vector<OrientationGrid> maps(views);
  parallel_for(count, options.threads, [&](std::size_t o) {
    check_stop(stop);
    OrientationGridMaker mapper;
    for (std::size_t v = 0; v < objects[o].count; ++v) {
      mapper.compute(objects[o].view(v), maps[first[o] + v]);
    }
  });
  model.background = background_level(maps);
  for (OrientationGrid& map : maps) {
    take_off(model.background, map);
  }
  model.space = WindowSpace::learn(maps, options.threads);

  std::vector<std::vector<Eigen::MatrixXf>> windows(count);
  std::vector<float> largest(count, 0.0F);
  parallel_for(count, options.threads, [&](std::size_t o) {
    check_stop(stop);
    OrientationGridMaker mapper(model.background);
    OrientationGrid made;
    for (const Lane& lane :
         make_lanes(objects[o], sparse(objects[o].axes, options.sparse_step), model.objects[o])) {
      if (!lane.picture.empty()) mapper.compute(lane.picture, made);
      windows[o].emplace_back();
      model.space.project(lane.picture.empty() ? maps[first[o] + lane.view] : made, 1, windows[o].back(),
                          nullptr);
      largest[o] = std::max(largest[o], windows[o].back().cwiseAbs().maxCoeff());
    }
    if (progress && o % 8 == 0) {
      progress({"learning windows", o, count});
    }
  });
  maps = {};
  model.scale = WindowScale::for_range(*std::max_element(largest.begin(), largest.end()));
  parallel_for(count, options.threads, [&](std::size_t o) {
    check_stop(stop);
    model.objects[o].store = WindowStore(windows[o], model.scale);
    windows[o].clear();
    std::vector<PosePicture> pictures(objects[o].count);
    for (std::size_t v = 0; v < objects[o].count; ++v) {
      make_pose_picture(objects[o].view(v), pictures[v]);
    }
    model.poses[o] = AlignmentEigenspace::learn(objects[o].axes, pictures, objects[o].poses);
    model.view_poses[o] = objects[o].poses.size() > 0 ? objects[o].poses : grid_poses(objects[o].axes);
    if (progress && o % 8 == 0) {
      progress({"learning pose spaces", o, count});
    }
  });
  model.noise = median_left_out_error(model.poses) / left_out_over_between;
  return model;
}

}  // namespace eigenpose
