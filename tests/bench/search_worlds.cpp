#include "tests/bench/search_worlds.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/search/search.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solver.h"
#include "tests/support/byte_source.h"

namespace eigenpose::bench {

namespace {

constexpr Eigen::Index dimensions = 20;
constexpr int learned_views = 36;
constexpr int all_views = 72;
constexpr int side = 64;

/// A closed curve as Fourier series, so that it is known between the samples.
struct Curve {
  Eigen::VectorXd centre;
  std::vector<Eigen::VectorXd> cosine;
  std::vector<Eigen::VectorXd> sine;

  explicit Curve(std::mt19937& random) {
    std::normal_distribution<double> normal;
    const auto draw = [&](double size) {
      Eigen::VectorXd v(dimensions);
      for (Eigen::Index k = 0; k < dimensions; ++k)
        v[k] = size / std::sqrt(1.0 + static_cast<double>(k)) * normal(random);
      return v;
    };
    centre = draw(0.2);
    for (int h = 1; h <= 8; ++h) {
      cosine.push_back(draw(0.16 / h));
      sine.push_back(draw(0.16 / h));
    }
  }
  [[nodiscard]] Eigen::VectorXd at(double degrees) const {
    Eigen::VectorXd v = centre;
    const double angle = degrees * std::numbers::pi / 180.0;
    for (std::size_t h = 0; h < cosine.size(); ++h) {
      const double phase = static_cast<double>(h + 1) * angle;
      v += std::cos(phase) * cosine[h] + std::sin(phase) * sine[h];
    }
    return v;
  }
};

SampleAxis table_axis() {
  SampleAxis axis{Dof{"table", "deg", 0.0, 360.0, true}, {}};
  for (int i = 0; i < learned_views; ++i) axis.samples.push_back(360.0 / learned_views * i);
  return axis;
}

void set_rejection(SearchWorld& world) {
  const auto search = make_search(world.manifolds);
  std::vector<double> distances;
  for (const auto& point : world.perturbed) distances.push_back(search->nearest(point)[0].distance);
  std::sort(distances.begin(), distances.end());
  world.rejection_distance = distances[distances.size() * 99 / 100];
}

/// Axis signs and rotations of neighbouring axes: keeps how the coordinates decay.
Eigen::MatrixXd random_copy(std::mt19937& random) {
  std::uniform_real_distribution<double> angle(0.0, 2.0 * std::numbers::pi);
  Eigen::MatrixXd copy = Eigen::MatrixXd::Identity(dimensions, dimensions);
  for (Eigen::Index k = 0; k < dimensions; ++k)
    if (random() % 2 == 0) copy(k, k) = -1.0;
  for (Eigen::Index k = 0; k + 1 < dimensions; ++k) {
    const double a = angle(random);
    const Eigen::RowVectorXd upper = copy.row(k);
    const Eigen::RowVectorXd lower = copy.row(k + 1);
    copy.row(k) = std::cos(a) * upper - std::sin(a) * lower;
    copy.row(k + 1) = std::sin(a) * upper + std::cos(a) * lower;
  }
  return copy;
}

cv::Mat load(const std::filesystem::path& folder, int object, int view) {
  const auto file = folder / ("obj" + std::to_string(object) + "__" + std::to_string(5 * view) + ".png");
  const cv::Mat image = cv::imread(file.string(), cv::IMREAD_COLOR);
  if (image.empty()) throw std::runtime_error(file.string() + ": cannot be read");
  cv::Mat small;
  cv::resize(image, small, {side, side}, 0, 0, cv::INTER_AREA);
  return small;
}

cv::Mat moved(const cv::Mat& image, std::mt19937& random) {
  std::uniform_real_distribution<double> shift(-2.0, 2.0);
  std::uniform_real_distribution<double> scale(0.97, 1.03);
  const double s = scale(random);
  const double c = 0.5 * side;
  const cv::Matx23d map(s, 0.0, c - s * c + shift(random), 0.0, s, c - s * c + shift(random));
  cv::Mat result;
  cv::warpAffine(image, result, map, image.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return result;
}

Eigen::VectorXf appearance(const cv::Mat& image) {
  Eigen::VectorXf x(static_cast<Eigen::Index>(image.total() * 3));
  for (Eigen::Index i = 0; i < x.size(); ++i) x[i] = static_cast<float>(image.data[i]);
  return x.normalized();
}

}  // namespace

SearchWorld synthetic_world(std::size_t objects, std::size_t queries) {
  std::mt19937 random(42);
  std::normal_distribution<double> normal;
  SearchWorld world;
  world.name = "synthetic";
  std::vector<Curve> curves;
  const SampleAxis axis = table_axis();
  Eigen::MatrixXd points(dimensions, learned_views);
  for (std::size_t i = 0; i < objects; ++i) {
    curves.emplace_back(random);
    for (int v = 0; v < learned_views; ++v)
      points.col(v) = curves.back().at(axis.samples[static_cast<std::size_t>(v)]);
    world.manifolds.push_back(Manifold::interpolate({axis}, points));
  }
  std::uniform_real_distribution<double> turn(0.0, 360.0);
  const auto noise = [&](double size) {
    Eigen::VectorXd v(dimensions);
    double energy = 0.0;
    for (Eigen::Index k = 0; k < dimensions; ++k) {
      const double scale = 1.0 / std::sqrt(1.0 + static_cast<double>(k));
      v[k] = scale * normal(random);
      energy += scale * scale;
    }
    return Eigen::VectorXd(size / std::sqrt(energy) * v);
  };
  for (std::size_t i = 0; i < queries; ++i) {
    const Curve& curve = curves[random() % objects];
    const double angle = turn(random);
    world.known.push_back((curve.at(angle) + noise(0.01)).cast<float>());
    world.perturbed.push_back((curve.at(angle) + noise(0.045)).cast<float>());
    world.unknown.push_back(Curve(random).at(turn(random)).cast<float>());
  }
  set_rejection(world);
  return world;
}

SearchWorld coil_world(const std::filesystem::path& folder, std::size_t objects, std::size_t queries) {
  constexpr int learned_objects = 40;
  constexpr int all_objects = 50;
  std::vector<std::uint8_t> bytes;
  for (int object = 1; object <= learned_objects; ++object)
    for (int view = 0; view < all_views; view += all_views / learned_views) {
      const cv::Mat image = load(folder, object, view);
      bytes.insert(bytes.end(), image.data, image.data + image.total() * 3);
    }
  const std::size_t length = std::size_t{3} * side * side;
  const ByteSource source(bytes, length);
  const Eigenspace space = solve_eigenspace(source, SolverOptions{});
  std::vector<Eigen::MatrixXd> learned;
  for (int object = 0; object < learned_objects; ++object) {
    Eigen::MatrixXf tile(static_cast<Eigen::Index>(length), learned_views);
    source.read(static_cast<std::size_t>(object * learned_views), tile);
    Eigen::MatrixXd points(dimensions, learned_views);
    for (int v = 0; v < learned_views; ++v) points.col(v) = space.project(tile.col(v)).cast<double>();
    learned.push_back(points);
  }
  std::mt19937 random(7);
  struct Views {
    std::vector<Eigen::VectorXf> known, perturbed;
  };
  std::vector<Views> views(learned_objects);
  for (int object = 0; object < learned_objects; ++object)
    for (int view = 1; view < all_views; view += 2) {
      const cv::Mat image = load(folder, object + 1, view);
      views[static_cast<std::size_t>(object)].known.push_back(space.project(appearance(image)));
      views[static_cast<std::size_t>(object)].perturbed.push_back(
          space.project(appearance(moved(image, random))));
    }
  std::vector<Eigen::VectorXf> strangers;
  for (int object = learned_objects + 1; object <= all_objects; ++object)
    for (int view = 0; view < all_views; ++view)
      strangers.push_back(space.project(appearance(load(folder, object, view))));

  SearchWorld world;
  world.name = "COIL-100";
  std::vector<Eigen::MatrixXf> copies;
  const SampleAxis axis = table_axis();
  for (std::size_t i = 0; i < objects; ++i) {
    const Eigen::MatrixXd copy = i < learned_objects
                                     ? Eigen::MatrixXd(Eigen::MatrixXd::Identity(dimensions, dimensions))
                                     : random_copy(random);
    copies.push_back(copy.cast<float>());
    world.manifolds.push_back(Manifold::interpolate({axis}, copy * learned[i % learned_objects]));
  }
  for (std::size_t i = 0; i < queries; ++i) {
    const std::size_t object = random() % objects;
    const Views& of = views[object % learned_objects];
    const std::size_t view = random() % of.known.size();
    world.known.push_back(copies[object] * of.known[view]);
    world.perturbed.push_back(copies[object] * of.perturbed[view]);
    world.unknown.push_back(strangers[random() % strangers.size()]);
  }
  set_rejection(world);
  return world;
}

}  // namespace eigenpose::bench
