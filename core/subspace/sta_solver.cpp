#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/base/clock.h"
#include "core/subspace/back_projection.h"
#include "core/subspace/gram.h"
#include "core/subspace/solvers.h"
#include "core/subspace/sta_code.h"

namespace eigenpose::detail {
namespace {

void check_options(const StaOptions& options) {
  const auto share = [](double value) { return value >= 0.0 && value < 1.0; };
  if (options.block < 2 || options.block > 16 || !share(options.spatial) || !share(options.temporal)) {
    throw std::invalid_argument("sta: block = " + std::to_string(options.block) +
                                ", spatial = " + std::to_string(options.spatial) +
                                ", temporal = " + std::to_string(options.temporal) +
                                ": blocks are 2 to 16 pixels wide, spatial and temporal shares in [0, 1)");
  }
}

StaReport bounds(const StaCode& code, const BlockTransform& transform, const EigenPairs& pairs,
                 Eigen::Index kept) {
  StaReport report;
  const auto views = static_cast<double>(code.changes.size());
  report.largest_change = std::sqrt(std::max(0.0, code.changes.maxCoeff()));
  report.product_error_bound = 2.0 * report.largest_change + report.largest_change * report.largest_change;
  const double all_changes = code.changes.sum();
  report.eigenvalue_error_bound = 2.0 * std::sqrt(pairs.values[0] * all_changes) + all_changes;
  const double next =
      kept < pairs.values.size() ? pairs.values[kept] : pairs.next_value + pairs.next_residual;
  const double change = std::sqrt(all_changes);
  const double gap = std::sqrt(pairs.values[kept - 1]) - std::sqrt(next) - change;
  report.angle_sine_bound = gap > 0.0 ? std::min(1.0, change / gap) : 1.0;
  std::size_t superblocks = 0;
  for (const CodedPosition& position : code.positions) superblocks += position.superblocks.size();
  report.superblock_ratio =
      static_cast<double>(superblocks) / (views * static_cast<double>(code.positions.size()));
  report.coefficient_share =
      static_cast<double>(code.kept) / (views * static_cast<double>(transform.shape().length()));
  return report;
}

/// How far the share of the scatter kept may be off, with the roots of both known within `change`.
double energy_bound(double kept, double total, double change) {
  const double share = kept / total;
  const double least = std::sqrt(total) - change;
  if (least <= 0.0) return 1.0;
  const double high = (std::sqrt(kept) + change) / least;
  const double low = std::max(0.0, std::sqrt(kept) - change) / (std::sqrt(total) + change);
  return std::min(1.0, std::max(high * high - share, share - low * low));
}

}  // namespace

Eigenspace solve_sta(const SolverTask& task, SolverReport& report) {
  const AppearanceSource& source = task.source;
  const SolverOptions& options = task.options;
  check_options(options.sta);
  const std::size_t fixed =
      gram_solver_memory(source.count(), source.length(), options.components) + 600 * source.length();
  if (options.memory_limit > 0 && options.memory_limit <= fixed) {
    throw std::invalid_argument("the sta solver needs " + std::to_string(fixed) +
                                " bytes beside the coded views, the limit is " +
                                std::to_string(options.memory_limit) + ": raise it or use the krylov solver");
  }
  const std::size_t rest = options.memory_limit > 0 ? options.memory_limit - fixed : 0;
  const SteadyClock clock;
  const TimePoint start = clock.now();
  const BlockTransform transform(source.shape(), options.sta.block);
  const StaCode code = sta_code(source, transform, options.sta, {options.threads, rest / 4, rest - rest / 4},
                                task.progress, task.stop);
  Eigen::MatrixXd gram =
      sta_gram(code, source.count(), transform.size(), options.threads, task.progress, task.stop);
  const double total = normalize_and_center(gram, Eigen::VectorXd::Ones(gram.rows()), options.threads);
  const TimePoint solving = clock.now();
  const EigenPairs pairs = leading_gram_pairs(gram, task);
  check_rank(pairs.values.size());
  const Eigen::Index kept = components_for(pairs.values, total, options);
  judge(pairs, kept, report);
  report.sta = bounds(code, transform, pairs, kept);
  report.energy_bound = energy_bound(pairs.values.head(kept).sum(), total, std::sqrt(code.changes.sum()));
  const TimePoint projecting = clock.now();
  const Eigen::VectorXd values = pairs.values.head(kept);
  const Eigen::MatrixXd weights =
      pairs.vectors.leftCols(kept) * values.cwiseSqrt().cwiseInverse().asDiagonal();
  Eigenspace space = finished_eigenspace(
      code.mean, sta_back_project(code, transform, weights, options.threads), values, total);
  report.gram_time = solving - start;
  report.solve_time = projecting - solving;
  report.back_projection_time = clock.now() - projecting;
  return space;
}

}  // namespace eigenpose::detail
