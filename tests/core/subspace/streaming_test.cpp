// A set of four times the memory limit, learned in a process that cannot have more: see streaming_probe.cpp.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/error.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solver.h"
#include "tests/core/subspace/subspace_samples.h"
#include "tests/support/byte_file_source.h"
#include "tests/support/byte_source.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define EIGENPOSE_SANITIZED 1
#else
#define EIGENPOSE_SANITIZED 0
#endif

namespace eigenpose {
namespace {

constexpr std::size_t kViews = 640;
constexpr std::size_t kLongView = 65536;
constexpr std::size_t kSet = kViews * kLongView;  ///< 40 MB
constexpr std::size_t kLimit = kSet / 4;
constexpr std::size_t kComponents = 4;

class TemporaryFile {
 public:
  TemporaryFile()
      : path_(std::filesystem::temp_directory_path() / ("eigenpose-views-" + std::to_string(::getpid()))) {}
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() { std::filesystem::remove(path_); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  void write(const void* bytes, std::size_t n) const {
    std::ofstream(path_, std::ios::binary | std::ios::app)
        .write(static_cast<const char*>(bytes), static_cast<std::streamsize>(n));
  }

 private:
  std::filesystem::path path_;
};

/// Smooth views of any length, cheap to make: a few waves a view, no noise.
void write_large_set(const TemporaryFile& file) {
  constexpr std::size_t kPlaces = 97;
  std::vector<std::uint8_t> view(kLongView);
  std::vector<double> waves(kPlaces);
  for (std::size_t j = 0; j < kViews; ++j) {
    const double angle = 6.283185 * static_cast<double>(j) / kViews;
    for (std::size_t place = 0; place < kPlaces; ++place) {
      const auto x = static_cast<double>(place);
      waves[place] = 100.0 + 40.0 * std::cos(angle + 0.05 * x) + 24.0 * std::cos(2 * angle + 0.9 * x);
    }
    std::uint32_t noise = static_cast<std::uint32_t>(j) * 2654435761U + 1U;
    for (std::size_t k = 0; k < kLongView; ++k) {
      noise = noise * 1664525U + 1013904223U;
      view[k] = static_cast<std::uint8_t>(waves[(k >> 6) % kPlaces] + static_cast<double>(noise >> 28));
    }
    file.write(view.data(), view.size());
  }
}

TEST(Streaming, LearnsFourTimesTheMemoryLimitUnderThatLimit) {
  if (EIGENPOSE_SANITIZED)
    GTEST_SKIP() << "a sanitizer needs more address space than the limit: not shown here";
  const TemporaryFile file;
  write_large_set(file);
  std::vector<std::uint8_t> bytes(kSet);
  ByteFileSource(file.path(), kLongView).read_bytes(0, kViews, bytes.data());
  const Eigenspace unlimited =
      solve_eigenspace(ByteSource(bytes, kLongView), {.solver = "gram", .components = kComponents});
  bytes = {};
  for (const std::string solver : {"auto", "gram", "krylov"}) {
    const auto path = file.path().string() + "-" + solver;
    const std::string command = std::string(STREAMING_PROBE) + " '" + file.path().string() + "' " +
                                std::to_string(kLongView) + ' ' + solver + ' ' + std::to_string(kComponents) +
                                ' ' + std::to_string(kLimit) + " '" + path + "'";
    const int status = std::system(command.c_str());
    ASSERT_TRUE(WIFEXITED(status)) << command;
    ASSERT_EQ(WEXITSTATUS(status), 0) << command;
    Eigen::MatrixXf basis(unlimited.basis.rows(), unlimited.basis.cols());
    std::ifstream(path, std::ios::binary)
        .read(reinterpret_cast<char*>(basis.data()),
              static_cast<std::streamsize>(sizeof(float) * static_cast<std::size_t>(basis.size())));
    std::filesystem::remove(path);
    // Krylov stops at residual over gap 1e-6, below float rounding of the basis.
    EXPECT_LT(test::largest_angle_deg(basis, unlimited.basis), 2e-4) << solver;
    if (solver == "gram") {
      EXPECT_EQ(basis, unlimited.basis) << "tiles show in the result";
    }
  }
}

TEST(ByteFileSource, ReadsWhatIsInTheFile) {
  const TemporaryFile file;
  const auto bytes = test::smooth_views(7, 40, 1);
  file.write(bytes.data(), bytes.size());
  const ByteFileSource source(file.path(), 40);
  ASSERT_EQ(source.count(), 7U);
  std::vector<std::uint8_t> read(3 * 40);
  source.read_bytes(4, 3, read.data());
  EXPECT_TRUE(std::equal(read.begin(), read.end(), bytes.begin() + 160));
  Eigen::MatrixXf tile(40, 2), expected(40, 2);
  source.read(1, tile);
  ByteSource(bytes, 40).read(1, expected);
  EXPECT_EQ(tile, expected);
  EXPECT_THROW(source.read_bytes(5, 3, read.data()), std::invalid_argument);
}

TEST(ByteFileSource, SaysWhatIsWrongWithTheFile) {
  EXPECT_THROW(ByteFileSource("/nonexistent/views", 10), FileError);
  const TemporaryFile file;
  file.write("1234567", 7);
  EXPECT_THROW(ByteFileSource(file.path(), 3), FileError);
  const ByteFileSource source(file.path(), 7);
  std::filesystem::resize_file(file.path(), 3);
  std::uint8_t tile[7];
  EXPECT_THROW(source.read_bytes(0, 1, tile), FileError) << "the file became shorter";
}

}  // namespace
}  // namespace eigenpose
