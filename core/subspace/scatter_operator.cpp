#include "core/subspace/scatter_operator.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/work_meter.h"
#include "core/subspace/tile_products.h"

namespace eigenpose {

ScatterOperator::ScatterOperator(const AppearanceSource& source, Space space, unsigned threads,
                                 std::size_t tile_memory, Progress progress, std::stop_token stop)
    : source_(source),
      space_(space),
      threads_(threads),
      progress_(std::move(progress)),
      stop_(std::move(stop)),
      reader_(source),
      strip_(reader_.resident() ? 16 * kViewDepth : reader_.views_in(tile_memory)) {
  if (strip_ > kViewDepth) strip_ -= strip_ % kViewDepth;
  const auto count = static_cast<Eigen::Index>(source.count());
  norms_.resize(count);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(source.length()), 1);
  Eigen::VectorXd energies(count);
  for_each_block([&](const ViewBlock& block, Eigen::Index first) {
    parallel_for(block.count, threads_, [&](std::size_t v) {
      std::vector<double> view(block.length);
      block.widen(v, 0, block.length, view.data());
      const auto j = first + static_cast<Eigen::Index>(v);
      const double energy =
          Eigen::Map<const Eigen::VectorXd>(view.data(), static_cast<Eigen::Index>(view.size()))
              .squaredNorm();
      if (!std::isfinite(energy) || energy <= 0.0) {
        throw std::invalid_argument("view " + std::to_string(j) +
                                    " has no energy, or a number in it is not finite: leave it out");
      }
      norms_[j] = source_.has_bytes() ? std::sqrt(energy) : 1.0;
      energies[j] = source_.has_bytes() ? 1.0 : energy;
    });
    const auto n = static_cast<Eigen::Index>(block.count);
    const Eigen::MatrixXd weights = norms_.segment(first, n).cwiseInverse();
    add_weighted_views(block, weights, 0, threads_, sum);
  });
  mean_ = sum / static_cast<double>(count);
  total_scatter_ = energies.sum() - static_cast<double>(count) * mean_.squaredNorm();
}

template <typename Work>
void ScatterOperator::for_each_block(const Work& work) {
  WorkMeter meter(progress_, stop_, "passing over the views", source_.count());
  for (std::size_t first = 0; first < source_.count(); first += strip_) {
    const std::size_t n = std::min(strip_, source_.count() - first);
    work(reader_.read(first, n), static_cast<Eigen::Index>(first));
    meter.finished(n);
  }
  ++passes_;
}

Eigen::Index ScatterOperator::size() const {
  return space_ == Space::pixels ? mean_.size() : norms_.size();
}

void ScatterOperator::apply(const Eigen::MatrixXd& x, Eigen::MatrixXd& y) {
  const Eigen::VectorXd scale = norms_.cwiseInverse();
  if (space_ == Space::pixels) {
    const Eigen::RowVectorXd along_mean = mean_.transpose() * x;
    Eigen::RowVectorXd sums = Eigen::RowVectorXd::Zero(x.cols());
    y.setZero();
    for_each_block([&](const ViewBlock& block, Eigen::Index first) {
      const auto n = static_cast<Eigen::Index>(block.count);
      Eigen::MatrixXd products = scale.segment(first, n).asDiagonal() * view_products(block, x, threads_);
      products.rowwise() -= along_mean;
      sums += products.colwise().sum();
      products = (scale.segment(first, n).asDiagonal() * products).eval();
      add_weighted_views(block, products, 0, threads_, y);
    });
    y -= mean_ * sums;
    return;
  }
  const Eigen::MatrixXd weights = scale.asDiagonal() * (x.rowwise() - x.colwise().mean());
  Eigen::MatrixXd pixels = Eigen::MatrixXd::Zero(mean_.size(), x.cols());
  for_each_block([&](const ViewBlock& block, Eigen::Index first) {
    add_weighted_views(block, weights, static_cast<std::size_t>(first), threads_, pixels);
  });
  for_each_block([&](const ViewBlock& block, Eigen::Index first) {
    const auto n = static_cast<Eigen::Index>(block.count);
    y.middleRows(first, n) = scale.segment(first, n).asDiagonal() * view_products(block, pixels, threads_);
  });
  y.rowwise() -= y.colwise().mean().eval();
}

}  // namespace eigenpose
