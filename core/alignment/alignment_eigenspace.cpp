#include "core/alignment/alignment_eigenspace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "core/base/linear_algebra.h"
#include "core/simd/similarity_warp.h"

namespace eigenpose {
namespace {

constexpr int coarse_side = 32;
constexpr int fine_side = 48;        // finer gains nothing and costs memory: 0.3 MB for 36 views
constexpr double coarse_blur = 1.5;  // pixels of the 64×64 picture
constexpr std::size_t most_samples = 4096;

using Brightness = std::array<float, std::size_t{PosePicture::side} * PosePicture::side>;

/// Gaussian of σ = coarse_blur; beyond its edge the picture goes on as it ends.
void blur(const Brightness& in, Brightness& out) {
  constexpr int n = PosePicture::side;
  constexpr int reach = 4;
  std::array<float, 2 * reach + 1> kernel;
  float sum = 0.0F;
  for (int k = -reach; k <= reach; ++k)
    sum += kernel[static_cast<std::size_t>(k + reach)] =
        static_cast<float>(std::exp(-0.5 * k * k / (coarse_blur * coarse_blur)));
  for (float& weight : kernel) weight /= sum;
  Brightness across;
  std::array<float, n + 2 * reach> row;
  for (int r = 0; r < n; ++r) {
    const float* from = in.data() + r * n;
    std::copy_n(from, n, row.data() + reach);
    std::fill_n(row.data(), reach, from[0]);
    std::fill_n(row.data() + reach + n, reach, from[n - 1]);
    float* to = across.data() + r * n;
    std::fill_n(to, n, 0.0F);
    for (std::size_t k = 0; k < kernel.size(); ++k)
      for (int c = 0; c < n; ++c) to[c] += kernel[k] * row[static_cast<std::size_t>(c) + k];
  }
  for (int r = 0; r < n; ++r) {
    float* to = out.data() + r * n;
    std::fill_n(to, n, 0.0F);
    for (int k = -reach; k <= reach; ++k) {
      const float* from = across.data() + std::clamp(r + k, 0, n - 1) * n;
      const float weight = kernel[static_cast<std::size_t>(k + reach)];
      for (int c = 0; c < n; ++c) to[c] += weight * from[c];
    }
  }
}

/// Texels of a 64×64 picture.
void fill_texels(const Brightness& picture, std::vector<float>& texels) {
  constexpr int n = PosePicture::side;
  texels.resize(static_cast<std::size_t>(n) * n * 4);
  float* out = texels.data();
  for (int r = 0; r < n; ++r) {
    const float* here = picture.data() + r * n;
    const float* above = picture.data() + std::max(r - 1, 0) * n;
    const float* below = picture.data() + std::min(r + 1, n - 1) * n;
    for (int c = 0; c < n; ++c, out += 4) {
      out[0] = here[c];
      out[1] = 0.5F * (here[std::min(c + 1, n - 1)] - here[std::max(c - 1, 0)]);
      out[2] = 0.5F * (below[c] - above[c]);
      out[3] = 0.0F;
    }
  }
}

/// Eigenvectors of all dimensions that centred unit-energy pictures span.
void span_of(const Eigen::MatrixXf& pictures, int side, PoseScale& scale, Eigen::MatrixXd& points) {
  const Eigen::VectorXf mean = pictures.rowwise().mean();
  const Eigen::MatrixXd centred = (pictures.colwise() - mean).cast<double>();
  const SymmetricEigen found = symmetric_eigen(centred.transpose() * centred);
  const Eigen::Index views = pictures.cols();
  const double largest = std::max(found.values(0), 1e-12);
  Eigen::Index kept = 0;
  while (kept < views - 1 && found.values(kept) > 1e-6 * largest) {
    ++kept;
  }
  kept = std::max<Eigen::Index>(kept, 1);
  scale.side = side;
  scale.basis.resize(pictures.rows(), kept);
  for (Eigen::Index k = 0; k < kept; ++k) {
    const Eigen::VectorXd vector = centred * found.vectors.col(k);
    scale.basis.col(k) = (vector / std::max(vector.norm(), 1e-12)).cast<float>();
  }
  scale.mean = scale.basis.transpose() * mean;
  points = scale.basis.cast<double>().transpose() * centred;
}

/// Where the samples of an axis lie. Several between neighbouring views, as many as `room` allows for each,
/// but at most 360 an axis, or one a view where there are more views: 1° on a turntable.
std::vector<double> sample_places(const SampleAxis& axis, double room) {
  constexpr std::size_t most_an_axis = 360;
  const std::size_t views = axis.samples.size();
  if (views < 2) return {axis.samples.front()};
  const auto wanted = static_cast<std::size_t>(static_cast<double>(views) * room);
  const std::size_t count = std::max(views, std::min(wanted, most_an_axis));
  const bool closed = axis.dof.periodic;
  const double first = closed ? axis.dof.lower : axis.samples.front();
  const double range = closed ? axis.dof.period() : axis.samples.back() - axis.samples.front();
  std::vector<double> places;
  places.reserve(count);
  for (std::size_t i = 0; i < count; ++i)
    places.push_back(first +
                     range * static_cast<double>(i) / static_cast<double>(closed ? count : count - 1));
  return places;
}

}  // namespace

void make_pose_picture(const cv::Mat& picture, PosePicture& out) {
  constexpr int n = PosePicture::side;
  const cv::Mat* source = &picture;
  cv::Mat resized;
  if (picture.rows != n || picture.cols != n) {
    cv::resize(picture, resized, cv::Size(n, n), 0.0, 0.0, cv::INTER_AREA);
    source = &resized;
  }
  // On the stack: once a frame, no memory is taken.
  std::array<std::uint8_t, std::size_t{n} * n> bytes;
  cv::Mat grey(n, n, CV_8UC1, bytes.data());
  source->channels() == 3 ? cv::cvtColor(*source, grey, cv::COLOR_BGR2GRAY) : source->copyTo(grey);
  Brightness sharp;
  for (std::size_t i = 0; i < sharp.size(); ++i) sharp[i] = static_cast<float>(bytes[i]) * (1.0F / 255.0F);
  Brightness blurred;
  blur(sharp, blurred);
  fill_texels(sharp, out.sharp);
  fill_texels(blurred, out.blurred);
}

void PoseScale::warp(const PosePicture& picture, const Misalignment& misalignment, bool derivatives,
                     Eigen::MatrixXf& out) const {
  const GradientPicture gradients{side > coarse_side ? picture.sharp.data() : picture.blurred.data(),
                                  PosePicture::side};
  const auto n = static_cast<float>(PosePicture::side);
  const float enlarge = static_cast<float>(1.0 + misalignment.scale);
  const float middle = 0.5F * n;
  const SimilaritySampling sampling{side,
                                    n / static_cast<float>(side),
                                    middle,
                                    middle + n * static_cast<float>(misalignment.dx) - 0.5F,
                                    middle + n * static_cast<float>(misalignment.dy) - 0.5F,
                                    enlarge * static_cast<float>(std::cos(misalignment.rotation)),
                                    enlarge * static_cast<float>(std::sin(misalignment.rotation))};
  out.resize(static_cast<Eigen::Index>(side) * side, 1 + Misalignment::unknowns);
  if (derivatives) {
    sample_similarity(gradients, sampling, out.col(0).data(),
                      {out.col(2).data(), out.col(3).data(), out.col(4).data(), out.col(5).data()});
  } else {
    sample_similarity(gradients, sampling, out.col(0).data());
  }
  const float energy = out.col(0).norm();
  const auto gain = static_cast<float>(1.0 + misalignment.gain);
  const float scale = gain / std::max(energy, 1e-9F);
  out.col(0) *= scale;
  if (derivatives) {
    out.col(1) = out.col(0) / gain;
    out.middleCols(2, 2) *= scale * n;  // the shift is in sides of the picture
    out.col(4) *= scale / enlarge;      // the scale itself, not its logarithm
    out.col(5) *= scale;
  }
}

AlignmentEigenspace AlignmentEigenspace::learn(const std::vector<SampleAxis>& axes,
                                               const std::vector<PosePicture>& views,
                                               const Eigen::MatrixXd& poses) {
  if (views.size() < 2) {
    throw std::invalid_argument("an alignment eigenspace needs at least 2 views, got " +
                                std::to_string(views.size()));
  }
  AlignmentEigenspace space;
  Eigen::MatrixXd points;
  for (const int side : {coarse_side, fine_side}) {
    PoseScale& scale = side == coarse_side ? space.coarse_ : space.fine_;
    scale.side = side;
    Eigen::MatrixXf pictures(static_cast<Eigen::Index>(side) * side, static_cast<Eigen::Index>(views.size()));
    Eigen::MatrixXf warped;
    for (std::size_t v = 0; v < views.size(); ++v) {
      scale.warp(views[v], {}, false, warped);
      pictures.col(static_cast<Eigen::Index>(v)) = warped.col(0);
    }
    if (side == coarse_side) {
      space.pixel_mean_ = pictures.rowwise().mean();
    }
    span_of(pictures, side, scale, points);
    (side == coarse_side ? space.coarse_manifold_ : space.fine_manifold_) =
        Manifold::fit(axes, poses, points);
    if (side == coarse_side && poses.size() == 0 && axes.size() == 1 && views.size() >= 4) {
      for (std::size_t v = 0; v < views.size(); ++v) {
        std::vector<SampleAxis> fewer = axes;
        fewer[0].samples.erase(fewer[0].samples.begin() + static_cast<std::ptrdiff_t>(v));
        Eigen::MatrixXd rest(points.rows(), points.cols() - 1);
        const auto at = static_cast<Eigen::Index>(v);
        rest << points.leftCols(at), points.rightCols(points.cols() - 1 - at);
        const Manifold manifold = Manifold::interpolate(fewer, rest);
        const double q = axes[0].samples[v];
        space.left_out_errors_.push_back((manifold.evaluate({&q, 1}) - points.col(at)).squaredNorm());
      }
    }
  }
  space.make_samples();
  return space;
}

AlignmentEigenspace AlignmentEigenspace::from_parts(PoseScale coarse, PoseScale fine,
                                                    Eigen::VectorXf pixel_mean, Manifold coarse_manifold,
                                                    Manifold fine_manifold) {
  const auto fits = [](const PoseScale& scale, const Manifold& manifold) {
    return scale.basis.rows() == static_cast<Eigen::Index>(scale.side) * scale.side &&
           scale.mean.size() == scale.basis.cols() && manifold.dimensions() == scale.basis.cols();
  };
  if (coarse.side != coarse_side || fine.side > PosePicture::side || !fits(coarse, coarse_manifold) ||
      !fits(fine, fine_manifold) || pixel_mean.size() != coarse.basis.rows()) {
    throw std::invalid_argument("has an alignment eigenspace whose parts do not fit together");
  }
  AlignmentEigenspace space;
  space.coarse_ = std::move(coarse);
  space.fine_ = std::move(fine);
  space.pixel_mean_ = std::move(pixel_mean);
  space.coarse_manifold_ = std::move(coarse_manifold);
  space.fine_manifold_ = std::move(fine_manifold);
  space.make_samples();
  return space;
}

AlignmentEigenspace AlignmentEigenspace::with_left_out_errors(std::vector<double> errors) const {
  AlignmentEigenspace space = *this;
  space.left_out_errors_ = std::move(errors);
  return space;
}

void AlignmentEigenspace::make_samples() {
  const auto axes = coarse_manifold_->axes();
  const double room = std::pow(static_cast<double>(most_samples) / static_cast<double>(grid_of(axes).size()),
                               1.0 / static_cast<double>(axes.size()));
  std::vector<std::vector<double>> places;
  std::vector<std::size_t> counts;
  for (const SampleAxis& axis : axes) {
    places.push_back(sample_places(axis, room));
    counts.push_back(places.back().size());
  }
  sample_grid_ = Grid(std::move(counts));
  const auto total = static_cast<Eigen::Index>(sample_grid_.size());
  sample_poses_.resize(static_cast<Eigen::Index>(axes.size()), total);
  samples_.resize(coarse_manifold_->dimensions(), total);
  std::vector<double> q(axes.size());
  for (std::size_t t = 0; t < sample_grid_.size(); ++t) {
    for (std::size_t a = 0; a < axes.size(); ++a) q[a] = places[a][sample_grid_.index(t, a)];
    const auto column = static_cast<Eigen::Index>(t);
    sample_poses_.col(column) =
        Eigen::Map<const Eigen::VectorXd>(q.data(), static_cast<Eigen::Index>(q.size()));
    samples_.col(column) = coarse_manifold_->evaluate(q).cast<float>();
  }
}

void AlignmentEigenspace::render(std::span<const double> q, Eigen::VectorXf& out) const {
  out.noalias() = coarse_.basis * coarse_manifold_->evaluate(q).cast<float>();
  out += pixel_mean_;
}

std::size_t AlignmentEigenspace::memory() const {
  const auto floats = coarse_.basis.size() + fine_.basis.size() + samples_.size();
  return static_cast<std::size_t>(floats) * sizeof(float);
}

}  // namespace eigenpose
