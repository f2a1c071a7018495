#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/clock.h"
#include "core/base/work_meter.h"
#include "core/subspace/back_projection.h"
#include "core/subspace/orthogonalization.h"
#include "core/subspace/solvers.h"

namespace eigenpose::detail {
namespace {

/// So many directions at least stand side by side before they are made orthogonal together.
constexpr Eigen::Index kFewDirections = 512;

/// Every group in even blocks of at most `most` views.
std::vector<std::size_t> block_sizes(const AppearanceSource& source, std::size_t most) {
  std::vector<std::size_t> sizes;
  for (const std::size_t group : source.groups()) {
    const std::size_t blocks = (group + most - 1) / most;
    for (std::size_t b = 0; b < blocks; ++b) sizes.push_back(group * (b + 1) / blocks - group * b / blocks);
  }
  return sizes;
}

void check_options(const JoinedOptions& options) {
  if (options.block < 2 || !(options.left_out >= 0.0 && options.left_out < 1.0)) {
    throw std::invalid_argument("joined: block = " + std::to_string(options.block) +
                                ", left_out = " + std::to_string(options.left_out) +
                                ": blocks are of 2 views or more, the share left out in [0, 1)");
  }
}

/// @param directions that stand side by side, `views` of them just read.
void check_memory(const SolverTask& task, std::size_t directions, std::size_t views) {
  const std::size_t vectors = 2 * directions + views + 4 * (task.options.components + 1);
  const std::size_t needed = 8 * (task.source.length() * vectors + 4 * directions * directions);
  if (task.options.memory_limit > 0 && needed > task.options.memory_limit) {
    throw std::invalid_argument("the joined solver needs " + std::to_string(needed) + " bytes for " +
                                std::to_string(directions) + " directions, the limit is " +
                                std::to_string(task.options.memory_limit) +
                                ": raise it or use the krylov solver");
  }
}

/// All views, block by block. Blocks leave out half of what may be; the other half is left where many are
/// made orthogonal together.
ScatterFactor joined_views(const SolverTask& task, JoinedReport& report) {
  const JoinedOptions& options = task.options.joined;
  const unsigned threads = task.options.threads;
  WorkMeter meter(task.progress, task.stop, "joining eigenspaces", task.source.count());
  ScatterFactor all;
  Eigen::Index many = kFewDirections;
  std::size_t first = 0;
  for (const std::size_t views : block_sizes(task.source, options.block)) {
    check_memory(task, static_cast<std::size_t>(all.factor.cols()) + views, views);
    ScatterFactor block;
    block.factor = centred_appearances(task.source, first, views, block.mean);
    block.views = views;
    block.total_scatter = block.factor.squaredNorm();
    orthogonalize(block, 0.5 * options.left_out * block.total_scatter, threads);
    join(all, block);
    report.directions = std::max(report.directions, static_cast<std::size_t>(all.factor.cols()));
    if (all.factor.cols() > many) {
      orthogonalize(all, options.left_out * all.total_scatter - all.rest(), threads);
      many = std::max(kFewDirections, 2 * all.factor.cols());
    }
    first += views;
    ++report.blocks;
    meter.finished(views);
  }
  return all;
}

}  // namespace

Eigenspace solve_joined(const SolverTask& task, SolverReport& report) {
  check_options(task.options.joined);
  const SteadyClock clock;
  const TimePoint start = clock.now();
  JoinedReport joined;
  const ScatterFactor all = joined_views(task, joined);
  const EigenPairs pairs = leading_gram_pairs(all.products(task.options.threads), task);
  check_rank(pairs.values.size());
  const Eigen::Index kept = components_for(pairs.values, all.total_scatter, task.options);
  judge(pairs, kept, report);

  const double rest = std::min(all.rest(), all.rest_bound);
  const double next =
      kept < pairs.values.size() ? pairs.values[kept] : pairs.next_value + pairs.next_residual;
  const double gap = pairs.values[kept - 1] - next;
  joined.eigenvalue_error_bound = rest;
  report.energy_bound = std::min(all.rest(), static_cast<double>(kept) * rest) / all.total_scatter;
  joined.angle_sine_bound = rest < gap ? rest / gap : 1.0;
  report.joined = joined;
  const Eigen::VectorXd values = pairs.values.head(kept);
  const Eigen::MatrixXd weights =
      pairs.vectors.leftCols(kept) * values.cwiseSqrt().cwiseInverse().asDiagonal();
  Eigenspace space =
      finished_eigenspace(all.mean, all.combined(weights, task.options.threads), values, all.total_scatter);
  report.solve_time = clock.now() - start;
  return space;
}

}  // namespace eigenpose::detail
