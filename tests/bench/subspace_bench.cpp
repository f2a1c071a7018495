// Learning against OpenCV's PCA, in one run: 1440 views of 128 × 128 bytes, K = 20.
//
// The views are COIL-20 where EIGENPOSE_DATASETS names a folder that has it, made-up smooth curves of
// pictures otherwise. OpenCV gets its float matrix for nothing: only PCA itself is timed. Ours starts from
// the bytes.

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/simd/targets.h"
#include "core/subspace/gram.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solver.h"
#include "tests/core/subspace/subspace_samples.h"
#include "tests/support/byte_source.h"

namespace eigenpose {
namespace {

constexpr int kViews = 1440;
constexpr int kPixels = 128 * 128;
constexpr int kComponents = 20;

std::vector<std::uint8_t> coil_views(const std::filesystem::path& folder) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(std::size_t{kViews} * kPixels);
  for (int object = 1; object <= 20; ++object) {
    for (int index = 0; index < 72; ++index) {
      const auto file = folder / ("obj" + std::to_string(object) + "__" + std::to_string(index) + ".png");
      const cv::Mat image = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
      if (image.rows * image.cols != kPixels) return {};
      bytes.insert(bytes.end(), image.datastart, image.dataend);
    }
  }
  return bytes;
}

struct Views {
  std::vector<std::uint8_t> bytes;
  cv::Mat floats = cv::Mat(kViews, kPixels, CV_32F);

  Views() {
    const char* datasets = std::getenv("EIGENPOSE_DATASETS");
    if (datasets != nullptr) bytes = coil_views(std::filesystem::path(datasets) / "coil-20");
    std::cerr << (bytes.empty() ? "views: made up (EIGENPOSE_DATASETS has no coil-20)\n"
                                : "views: COIL-20\n");
    if (bytes.empty()) bytes = test::smooth_views(kViews, kPixels, 1);
    bytes_to_unit_columns(bytes.data(), 0, Eigen::Map<Eigen::MatrixXf>(floats.ptr<float>(), kPixels, kViews));
  }
};

const Views& views() {
  static const Views all;
  return all;
}

/// Wall and processor seconds of a piece of work: on a busy machine the second one is the honest one.
struct Seconds {
  double wall = 0.0;
  double processor = 0.0;
};

template <typename Work>
Seconds timed(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t processor = std::clock();
  work();
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
          static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC};
}

/// OpenCV's answer, computed once: it takes long.
struct Peer {
  Seconds seconds;
  Eigen::MatrixXf basis{kPixels, kComponents};

  Peer() {
    seconds = timed([&] {
      const cv::PCA pca(views().floats, cv::noArray(), cv::PCA::DATA_AS_ROW, kComponents);
      std::memcpy(basis.data(), pca.eigenvectors.ptr<float>(), sizeof(float) * kPixels * kComponents);
    });
  }
};

const Peer& peer() {
  static const Peer answer;
  return answer;
}

/// Counters: OpenCV's wall seconds, the ratios in wall and in processor time, and the largest principal angle
/// between the two subspaces.
void learn_against_opencv(benchmark::State& state) {
  const ByteSource source(views().bytes, kPixels);
  SolverOptions options;
  options.solver = "gram";
  options.components = kComponents;
  options.threads = static_cast<unsigned>(state.range(0));
  Seconds ours;
  Eigenspace space;
  SolverReport report;
  for (auto _ : state) {
    const Seconds once = timed([&] { space = solve_eigenspace(source, options, &report); });
    ours.wall += once.wall;
    ours.processor += once.processor;
  }
  const auto runs = static_cast<double>(state.iterations());
  const auto milliseconds = [](Duration d) { return std::chrono::duration<double, std::milli>(d).count(); };
  state.counters["opencv_s"] = peer().seconds.wall;
  state.counters["ratio"] = peer().seconds.wall / (ours.wall / runs);
  state.counters["ratio_processor"] = peer().seconds.processor / (ours.processor / runs);
  state.counters["angle_deg"] = test::largest_angle_deg(space.basis, peer().basis);
  state.counters["gram_ms"] = milliseconds(report.gram_time);
  state.counters["solve_ms"] = milliseconds(report.solve_time);
  state.counters["project_ms"] = milliseconds(report.back_projection_time);
}
BENCHMARK(learn_against_opencv)
    ->Arg(1)
    ->Arg(2)
    ->ArgName("threads")
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

/// The Gram matrix alone, by SIMD target: 0 the best of this machine, 1 the portable one. Gop/s:
/// multiplications and additions of one triangle.
void gram_of_bytes(benchmark::State& state) {
  const ByteSource source(views().bytes, kPixels);
  GramOptions options;
  options.threads = static_cast<unsigned>(state.range(0));
  const std::string target = state.range(1) == 0 ? simd_targets().front() : simd_targets().back();
  const OnlySimdTarget only(target);
  for (auto _ : state) benchmark::DoNotOptimize(gram_matrix(source, options));
  state.counters["Gop/s"] =
      benchmark::Counter(1e-9 * kViews * kViews * kPixels, benchmark::Counter::kIsIterationInvariantRate);
  state.SetLabel(target);
}
BENCHMARK(gram_of_bytes)
    ->ArgsProduct({{1, 2}, {0, 1}})
    ->ArgNames({"threads", "portable"})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace eigenpose

BENCHMARK_MAIN();
