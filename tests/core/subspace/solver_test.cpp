#include "core/subspace/solver.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solvers.h"
#include "tests/core/subspace/subspace_samples.h"
#include "tests/support/byte_source.h"
#include "tests/support/dense_solver.h"

namespace eigenpose {
namespace {

/// Owns its bytes, so that one value is a whole set.
class OwnedBytes final : public AppearanceSource {
 public:
  OwnedBytes(std::vector<std::uint8_t> bytes, std::size_t length)
      : bytes_(std::move(bytes)), source_(bytes_, length) {}
  [[nodiscard]] std::size_t count() const override { return source_.count(); }
  [[nodiscard]] std::size_t length() const override { return source_.length(); }
  [[nodiscard]] bool has_bytes() const override { return true; }
  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override { source_.read(first, tile); }
  void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const override {
    source_.read_bytes(first, n, tile);
  }
  [[nodiscard]] const std::uint8_t* resident_bytes() const override { return bytes_.data(); }

 private:
  std::vector<std::uint8_t> bytes_;
  ByteSource source_;
};

struct Sample {
  friend std::ostream& operator<<(std::ostream& out, const Sample& sample) { return out << sample.name; }

  std::string name;
  std::function<std::unique_ptr<AppearanceSource>()> make;
  std::size_t components;           ///< asked for
  std::size_t expected_components;  ///< what the views span, at most that
};

std::unique_ptr<AppearanceSource> bytes_of(std::size_t count, std::size_t length) {
  return std::make_unique<OwnedBytes>(test::smooth_views(count, length, 11), length);
}

std::vector<Sample> samples() {
  return {
      {"FewerViewsThanPixels", [] { return bytes_of(90, 700); }, 10, 10},
      {"MoreViewsThanPixels", [] { return bytes_of(400, 60); }, 10, 10},
      {"ManyViews", [] { return bytes_of(400, 500); }, 20, 20},
      {"EveryDirection", [] { return bytes_of(12, 300); }, 40, 11},
      {"RankDeficient", [] { return std::make_unique<FloatSource>(test::views_of_rank(400, 300, 7, 5)); }, 20,
       8},
      {"RepeatedEigenvalues", [] { return std::make_unique<FloatSource>(test::turned_views(600, 300, 6)); },
       20, 20},
      {"TwoViews", [] { return bytes_of(2, 50); }, 20, 1},
  };
}

/// Several blocks of every set, and nothing left out: then the joined solver is exact like the others.
constexpr JoinedOptions kSmallBlocks{64, 0.0};

SolverOptions options_of(const std::string& solver, const Sample& sample, unsigned threads = 0) {
  return {.solver = solver, .components = sample.components, .threads = threads, .joined = kSmallBlocks};
}

class EverySolver : public testing::TestWithParam<std::tuple<std::string, Sample>> {};

/// Float rounding of the basis: 6e-8 an entry, relative; in degrees, with room for the comparison.
constexpr double kFloatAngleDeg = 5e-5;

TEST_P(EverySolver, FindsTheSubspaceOfTheDenseOracle) {
  const auto& [name, sample] = GetParam();
  const auto source = sample.make();
  SolverReport report;
  const Eigenspace found = solve_eigenspace(*source, options_of(name, sample), &report);
  const Eigenspace oracle = test::dense_eigenspace(*source, sample.components);
  ASSERT_EQ(found.components(), oracle.components());
  EXPECT_LE(report.residual_over_gap, 1e-3);
  EXPECT_EQ(report.components, static_cast<std::size_t>(found.components()));
  EXPECT_EQ(report.components, sample.expected_components);
  const double bound_deg = report.residual_over_gap * 57.3 + kFloatAngleDeg;
  EXPECT_LT(test::largest_angle_deg(found.basis, oracle.basis), bound_deg);
  // Eigenvalue errors are quadratic in the residual; sums of unit-energy views in double otherwise.
  EXPECT_LT((found.eigenvalues - oracle.eigenvalues).cwiseAbs().maxCoeff(), 1e-6 * oracle.eigenvalues[0]);
  EXPECT_NEAR(found.total_scatter, oracle.total_scatter, 1e-9 * static_cast<double>(source->count()));
  EXPECT_LT((found.mean - oracle.mean).cwiseAbs().maxCoeff(), 1e-6F);
}

TEST_P(EverySolver, KeepsTheInvariantsOfAnEigenspace) {
  const auto& [name, sample] = GetParam();
  const auto source = sample.make();
  const Eigenspace space = solve_eigenspace(*source, options_of(name, sample));
  const Eigen::MatrixXf overlap = space.basis.transpose() * space.basis;
  EXPECT_LT((overlap - Eigen::MatrixXf::Identity(overlap.rows(), overlap.cols())).cwiseAbs().maxCoeff(),
            1e-5F);
  for (Eigen::Index k = 0; k < space.components(); ++k) {
    EXPECT_GT(space.eigenvalues[k], 0.0);
    EXPECT_GE(space.eigenvalues[std::max<Eigen::Index>(k - 1, 0)], space.eigenvalues[k]);
    const float large = space.basis.col(k).cwiseAbs().maxCoeff() * (1.0F - 1e-4F);
    Eigen::Index first = 0;
    while (std::abs(space.basis(first, k)) < large) ++first;
    EXPECT_GT(space.basis(first, k), 0.0F);
  }
  EXPECT_LE(space.eigenvalues.sum(), space.total_scatter * (1.0 + 1e-9));
}

TEST_P(EverySolver, GivesTheSameBitsOnAnyNumberOfThreads) {
  const auto& [name, sample] = GetParam();
  const auto source = sample.make();
  const Eigenspace one = solve_eigenspace(*source, options_of(name, sample, 1));
  const Eigenspace three = solve_eigenspace(*source, options_of(name, sample, 3));
  EXPECT_EQ(one.basis, three.basis);
  EXPECT_EQ(one.mean, three.mean);
  EXPECT_EQ(one.eigenvalues, three.eigenvalues);
}

INSTANTIATE_TEST_SUITE_P(Solvers, EverySolver,
                         testing::Combine(testing::Values("gram", "krylov", "conjugate-gradient", "joined"),
                                          testing::ValuesIn(samples())),
                         [](const auto& drawn) {
                           std::string name = std::get<0>(drawn.param) + std::get<1>(drawn.param).name;
                           std::erase(name, '-');
                           return name;
                         });

class JoinedSolver : public testing::TestWithParam<Sample> {};

TEST_P(JoinedSolver, HoldsItsErrorBounds) {
  const Sample& sample = GetParam();
  const auto source = sample.make();
  const Eigenspace oracle = test::dense_eigenspace(*source, sample.components);
  // Sums of unit-energy views in double.
  const double rounding = 1e-12 * static_cast<double>(source->count());
  for (const double left_out : {0.001, 0.02, 0.3}) {
    for (const std::size_t block : {2U, 25U, 256U}) {
      SolverOptions options = options_of("joined", sample);
      options.joined = {block, left_out};
      SolverReport report;
      const Eigenspace found = solve_eigenspace(*source, options, &report);
      ASSERT_TRUE(report.joined);
      const JoinedReport& joined = *report.joined;
      EXPECT_EQ(joined.blocks, (source->count() + block - 1) / block);
      EXPECT_LE(report.energy_bound, left_out + rounding);
      const Eigen::Index k = found.components();
      ASSERT_LE(k, oracle.components());
      const Eigen::VectorXd below = oracle.eigenvalues.head(k) - found.eigenvalues;
      EXPECT_GE(below.minCoeff(), -rounding);
      EXPECT_LE(below.maxCoeff(), joined.eigenvalue_error_bound + rounding);
      EXPECT_LE(below.sum(), report.energy_bound * oracle.total_scatter + rounding);
      if (k < oracle.components()) continue;  // so much is left out that the cut is another
      const double sine = std::min(1.0, joined.angle_sine_bound + report.residual_over_gap);
      EXPECT_LE(test::largest_angle_deg(found.basis, oracle.basis), std::asin(sine) * 57.3 + kFloatAngleDeg);
      EXPECT_LT((found.mean - oracle.mean).cwiseAbs().maxCoeff(), 1e-6F);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, JoinedSolver, testing::ValuesIn(samples()),
                         [](const auto& drawn) { return drawn.param.name; });

/// Smooth views in groups; those of the second are all the same one.
class GroupedViews final : public AppearanceSource {
 public:
  GroupedViews() {
    Eigen::MatrixXf columns(80, 90);
    ByteSource(test::smooth_views(90, 80, 4), 80).read(0, columns);
    columns.middleCols(50, 30).colwise() = columns.col(50).eval();
    source_.emplace(std::move(columns));
  }
  [[nodiscard]] std::size_t count() const override { return source_->count(); }
  [[nodiscard]] std::size_t length() const override { return source_->length(); }
  [[nodiscard]] std::vector<std::size_t> groups() const override { return {50, 30, 9, 1}; }
  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override {
    source_->read(first, tile);
  }

 private:
  std::optional<FloatSource> source_;
};

TEST(Joined, SolvesGroupByGroup) {
  const GroupedViews source;
  SolverOptions options{.solver = "joined", .components = 6};
  options.joined = {40, 0.0};
  SolverReport report;
  const Eigenspace found = solve_eigenspace(source, options, &report);
  EXPECT_EQ(report.joined->blocks, 5U) << "the first group takes two blocks";
  // 24 of each half of the first group, none of equal views, 8 of nine views, none of one; four differences
  // of means.
  EXPECT_EQ(report.joined->directions, 24U + 24U + 8U + 4U);
  const Eigenspace oracle = test::dense_eigenspace(source, 6);
  EXPECT_LT(test::largest_angle_deg(found.basis, oracle.basis),
            report.residual_over_gap * 57.3 + kFloatAngleDeg);
  EXPECT_LT(report.energy_bound, 1e-12);
}

TEST(Joined, HoldsNoMoreThanItsBlocks) {
  // 3000 views in 200 directions: joined again and again, and still within the bound.
  const FloatSource source(test::views_of_rank(200, 3000, 150, 5));
  const SolverOptions options{.solver = "joined", .components = 8};
  SolverReport report;
  const Eigenspace found = solve_eigenspace(source, options, &report);
  EXPECT_LT(report.joined->directions, 800U);
  const Eigenspace oracle = solve_eigenspace(source, {.solver = "krylov", .components = 8});
  EXPECT_LE((oracle.eigenvalues - found.eigenvalues).sum(),
            report.energy_bound * oracle.total_scatter + 1e-9);
  EXPECT_LE(report.energy_bound, 0.01);
}

TEST(Joined, RefusesWrongOptionsAndTooLittleMemory) {
  const auto source = bytes_of(40, 50);
  const auto with = [](std::size_t block, double left_out, std::size_t memory) {
    return SolverOptions{.solver = "joined", .memory_limit = memory, .joined = {block, left_out}};
  };
  EXPECT_THROW(solve_eigenspace(*source, with(1, 0.1, 0)), std::invalid_argument);
  EXPECT_THROW(solve_eigenspace(*source, with(20, 1.0, 0)), std::invalid_argument);
  EXPECT_THROW(solve_eigenspace(*source, with(20, -0.1, 0)), std::invalid_argument);
  EXPECT_THROW(solve_eigenspace(*source, with(20, 0.1, 10'000)), std::invalid_argument);
}

TEST(Solver, ProjectsAndReconstructsWithinTheKeptEnergy) {
  const auto source = bytes_of(80, 300);
  const Eigenspace space = solve_eigenspace(*source, {.components = 79});
  Eigen::MatrixXf views(300, 80);
  source->read(0, views);
  const Eigen::VectorXf point = space.project(views.col(17));
  ASSERT_EQ(point.size(), space.components());
  // All directions are kept, so a learned view comes back up to float rounding.
  EXPECT_LT((space.mean + space.basis * point - views.col(17)).norm(), 1e-5F);
  EXPECT_THROW((void)space.project(Eigen::VectorXf::Zero(299)), std::invalid_argument);
}

TEST(Solver, ChoosesTheFewestComponentsThatKeepTheEnergy) {
  const auto source = bytes_of(300, 500);
  const Eigenspace all = test::dense_eigenspace(*source, 60);
  SolverReport report;
  const Eigenspace some = solve_eigenspace(*source, {.components = 60, .energy = 0.9}, &report);
  const Eigen::Index kept = some.components();
  ASSERT_LT(kept, 60);
  EXPECT_GE(all.eigenvalues.head(kept).sum(), 0.9 * all.total_scatter);
  EXPECT_LT(all.eigenvalues.head(kept - 1).sum(), 0.9 * all.total_scatter);
  EXPECT_GE(report.energy, 0.9);
  EXPECT_EQ(solve_eigenspace(*source, {.components = 3, .energy = 1.0}).components(), 3)
      << "components is the limit";
}

TEST(Solver, SaysSoWhereTheViewsSpanLessThanAskedFor) {
  const FloatSource source(test::views_of_rank(200, 50, 4, 8));
  SolverReport report;
  solve_eigenspace(source, {.components = 20}, &report);
  EXPECT_EQ(report.components, 5U);
  EXPECT_NE(report.note.find("span 5 dimensions"), std::string::npos) << report.note;
}

TEST(Solver, ReportsExactIntegersForBytesOnly) {
  SolverReport report;
  solve_eigenspace(*bytes_of(30, 50), {.solver = "gram", .components = 3}, &report);
  EXPECT_TRUE(report.exact_integers);
  solve_eigenspace(FloatSource(test::views_of_rank(50, 30, 5, 1)), {.solver = "gram", .components = 3},
                   &report);
  EXPECT_FALSE(report.exact_integers);
}

TEST(Solver, RefusesWhatCannotBeLearned) {
  const auto one = bytes_of(1, 50);
  EXPECT_THROW(solve_eigenspace(*one, {}), std::invalid_argument);
  const auto source = bytes_of(10, 50);
  EXPECT_THROW(solve_eigenspace(*source, {.solver = "magic"}), std::invalid_argument);
  EXPECT_THROW(solve_eigenspace(*source, {.components = 0}), std::invalid_argument);
  EXPECT_THROW(solve_eigenspace(*source, {.energy = 1.5}), std::invalid_argument);
  EXPECT_THROW(solve_eigenspace(*source, {.solver = "gram", .memory_limit = 100}), std::invalid_argument);
  const OwnedBytes same(std::vector<std::uint8_t>(500, 7), 50);
  EXPECT_THROW(solve_eigenspace(same, {}), Error) << "ten times the same view";
}

TEST(Solver, ChoosesTheGramMatrixForFewViewsAndKrylovWhereItDoesNotFit) {
  const auto source = bytes_of(300, 100);
  SolverReport report;
  solve_eigenspace(*source, {.components = 5}, &report);
  EXPECT_EQ(report.solver, "gram");
  // The Gram matrix alone takes 720 kB.
  solve_eigenspace(*source, {.components = 5, .memory_limit = 700'000}, &report);
  EXPECT_EQ(report.solver, "krylov");
  const FloatSource many(test::views_of_rank(30, 2100, 10, 3));
  solve_eigenspace(many, {.components = 5}, &report);
  EXPECT_EQ(report.solver, "krylov");
}

/// Views that have to be read, as those of a file.
class BytesToRead final : public AppearanceSource {
 public:
  BytesToRead(std::size_t count, std::size_t length)
      : bytes_(test::smooth_views(count, length, 11), length) {}
  [[nodiscard]] std::size_t count() const override { return bytes_.count(); }
  [[nodiscard]] std::size_t length() const override { return bytes_.length(); }
  [[nodiscard]] bool has_bytes() const override { return true; }
  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override { bytes_.read(first, tile); }
  void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const override {
    bytes_.read_bytes(first, n, tile);
  }

 private:
  OwnedBytes bytes_;
};

TEST(Solver, EveryMemoryLimitBeyondTheLeastIsEnoughForKrylov) {
  for (const auto& [count, length] : {std::pair<std::size_t, std::size_t>(40, 900), {300, 40}}) {
    const BytesToRead source(count, length);
    bool enough = false;
    for (double limit = 10e3; limit < 4e6; limit *= 1.03) {
      SolverOptions options;
      options.solver = "krylov";
      options.components = 4;
      options.threads = 1;
      options.memory_limit = static_cast<std::size_t>(limit);
      try {
        SolverReport report;
        EXPECT_EQ(solve_eigenspace(source, options, &report).components(), 4) << limit;
        enough = true;
      } catch (const std::invalid_argument& refused) {
        EXPECT_FALSE(enough) << limit << " bytes: " << refused.what();
        EXPECT_NE(std::string(refused.what()).find("holds no solver"), std::string::npos) << refused.what();
      }
    }
    EXPECT_TRUE(enough);
  }
}

TEST(Solver, RefusesAnAnswerWhoseResidualIsTooLargeForTheGap) {
  EigenPairs pairs;
  pairs.values = Eigen::Vector2d(10.0, 5.0);
  pairs.vectors = Eigen::MatrixXd::Identity(4, 2);
  pairs.residuals = Eigen::Vector2d(0.0, 1e-3);
  pairs.next_value = 4.0;
  SolverReport report;
  report.solver = "krylov";
  // 1e-3 over a gap of 1 passes, over a gap of 0.01 it does not: a residual that is small for λ₁ says
  // nothing.
  detail::judge(pairs, 2, report);
  EXPECT_DOUBLE_EQ(report.residual_over_gap, 1e-3);
  pairs.next_value = 4.99;
  EXPECT_THROW(detail::judge(pairs, 2, report), Error);
  // A next value that may be as large as the last one kept leaves no gap to trust.
  pairs.next_value = 4.0;
  pairs.next_residual = 1.5;
  EXPECT_THROW(detail::judge(pairs, 2, report), Error);
  // Equal eigenvalues at the cut are no error, but are said.
  pairs.next_value = 5.0;
  pairs.next_residual = 0.0;
  detail::judge(pairs, 2, report);
  EXPECT_NE(report.note.find("equal"), std::string::npos);
}

TEST(Solver, StopsOnRequest) {
  const auto source = bytes_of(300, 200);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(solve_eigenspace(*source, {}, nullptr, {}, stop.get_token()), Interrupted);
}

}  // namespace
}  // namespace eigenpose
