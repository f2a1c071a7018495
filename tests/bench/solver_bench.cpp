// The table of solvers × sets: time, peak memory, largest principal angle to the Gram solver's subspace
// (which the tests compare with a dense eigen-solve). Select rows with --benchmark_filter=.
//
// COIL sets come from the folder that EIGENPOSE_DATASETS names; without it only the made-up sets are
// measured.

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <malloc.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/error.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solver.h"
#include "tests/core/subspace/subspace_samples.h"
#include "tests/support/byte_source.h"

namespace eigenpose {
namespace {

struct Set {
  std::string name;
  std::vector<std::uint8_t> bytes;
  std::unique_ptr<AppearanceSource> source;  ///< null where the images are missing
};

Set bytes_set(std::string name, std::vector<std::uint8_t> bytes, AppearanceShape shape) {
  Set set{std::move(name), std::move(bytes), nullptr};
  if (!set.bytes.empty()) set.source = std::make_unique<ByteSource>(set.bytes, shape.length(), shape);
  return set;
}

/// All images of a folder in the order of object and number, at side × side; empty where one is missing.
std::vector<std::uint8_t> images(const std::string& folder, int objects, int views, int step, int side,
                                 bool color) {
  std::vector<std::uint8_t> bytes;
  const char* datasets = std::getenv("EIGENPOSE_DATASETS");
  if (datasets == nullptr) return bytes;
  for (int object = 1; object <= objects; ++object) {
    for (int view = 0; view < views; ++view) {
      const auto file = std::filesystem::path(datasets) / folder /
                        ("obj" + std::to_string(object) + "__" + std::to_string(view * step) + ".png");
      const cv::Mat image = cv::imread(file.string(), color ? cv::IMREAD_COLOR : cv::IMREAD_GRAYSCALE);
      if (image.empty()) return {};
      cv::Mat scaled;
      cv::resize(image, scaled, cv::Size(side, side), 0, 0, cv::INTER_AREA);
      bytes.insert(bytes.end(), scaled.datastart, scaled.dataend);
    }
  }
  return bytes;
}

const std::vector<std::function<Set()>>& makers() {
  static const std::vector<std::function<Set()>> all{
      [] {
        return bytes_set("COIL-20 1440x16384 grey", images("coil-20", 20, 72, 1, 128, false), {128, 128, 1});
      },
      [] {
        return bytes_set("COIL-100 half 3600x12288 colour", images("coil-100-half", 50, 72, 5, 64, true),
                         {64, 64, 3});
      },
      [] {
        return bytes_set("more views than pixels 3000x256", test::smooth_views(3000, 256, 1), {16, 16, 1});
      },
      [] {
        Set set{"rank 12 1000x4096 float", {}, nullptr};
        set.source = std::make_unique<FloatSource>(test::views_of_rank(4096, 1000, 12, 2));
        return set;
      },
      [] {
        Set set{"repeated eigenvalues 1024x4096 float", {}, nullptr};
        set.source = std::make_unique<FloatSource>(test::turned_views(4096, 1024, 3));
        return set;
      }};
  return all;
}

/// One set in memory at a time.
const Set& set_number(std::size_t index) {
  static Set current;
  static std::size_t number = makers().size();
  if (number != index) {
    current = Set{};
    current = makers()[index]();
    number = index;
  }
  return current;
}

const std::vector<std::string>& solvers() {
  static const std::vector<std::string> names{"gram", "krylov", "conjugate-gradient", "sta", "joined"};
  return names;
}

double status_megabytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    if (word != key) continue;
    double kilobytes = 0.0;
    status >> kilobytes;
    return kilobytes / 1024.0;
  }
  return 0.0;
}

/// What a row tells, 0 where a solver has none of it: CSV wants the same columns in every row. A row without
/// a result has K = 0, and its label says why.
void tell(benchmark::State& state, const SolverReport& report, double peak_megabytes, double angle_deg) {
  const StaReport sta = report.sta.value_or(StaReport{});
  const JoinedReport joined = report.joined.value_or(JoinedReport{});
  state.counters["K"] = static_cast<double>(report.components);
  state.counters["peak_MB"] = peak_megabytes;
  state.counters["angle_deg"] = angle_deg;
  state.counters["residual_over_gap"] = report.residual_over_gap;
  state.counters["energy_bound"] = report.energy_bound;
  state.counters["value_bound"] = std::max(sta.eigenvalue_error_bound, joined.eigenvalue_error_bound);
  state.counters["sta_coefficients"] = sta.coefficient_share;
  state.counters["sta_superblocks"] = sta.superblock_ratio;
  state.counters["joined_directions"] = static_cast<double>(joined.directions);
  state.counters["joined_angle_sine"] = report.joined ? joined.angle_sine_bound : 0.0;
}

void learn_set(benchmark::State& state) {
  const auto index = static_cast<std::size_t>(state.range(0));
  const std::string& solver = solvers()[static_cast<std::size_t>(state.range(1))];
  const Set& set = set_number(index);
  static std::map<std::size_t, Eigenspace> references;
  if (set.source && !references.contains(index))
    references[index] = solve_eigenspace(*set.source, {.solver = "gram"});
  SolverOptions options;
  options.solver = solver;
  SolverReport report;
  Eigenspace space;
  ::malloc_trim(0);                               // memory freed before must not hide what is used now
  std::ofstream("/proc/self/clear_refs") << '5';  // peak memory starts again from here
  const double before = status_megabytes("VmRSS:");
  std::string failure;
  for (auto _ : state) {
    try {
      if (!set.source) throw Error("EIGENPOSE_DATASETS names no folder with these images");
      space = solve_eigenspace(*set.source, options, &report);
    } catch (const std::exception& error) {
      failure = std::string(": ") + error.what();
    }
  }
  state.SetLabel(set.name + ", " + solver + failure);
  if (failure.empty()) {
    tell(state, report, status_megabytes("VmHWM:") - before,
         test::largest_angle_deg(space.basis, references[index].basis));
  } else {
    tell(state, {}, 0.0, 0.0);
  }
}

/// Every solver on every set.
void rows_of_the_table(benchmark::internal::Benchmark* table) {
  for (int set = 0; set < static_cast<int>(makers().size()); ++set) {
    for (int solver = 0; solver < static_cast<int>(solvers().size()); ++solver) {
      table->Args({set, solver});
    }
  }
}
BENCHMARK(learn_set)
    ->Apply(rows_of_the_table)
    ->ArgNames({"set", "solver"})
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace eigenpose

BENCHMARK_MAIN();
