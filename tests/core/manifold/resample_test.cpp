#include "core/manifold/resample.h"

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include "core/base/error.h"
#include "tests/support/synthetic_manifolds.h"

namespace eigenpose {
namespace {

class Resample : public ::testing::Test {
 public:
  ~Resample() override { std::filesystem::remove_all(folder_); }

 protected:
  Resample()
      : folder_(std::filesystem::temp_directory_path() / ("eigenpose-resample-" + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder_);
  }

  std::mt19937 random_{21};
  Manifold surface_ = synthetic::smooth_manifold({synthetic::axis("table", 9, true, false, random_),
                                                  synthetic::axis("x, left", 5, false, true, random_)},
                                                 3, 2, random_, 2);
  std::filesystem::path folder_;
};

TEST_F(Resample, GivesPointsOfTheManifoldInOrder) {
  const ResampledManifold dense = resample(surface_, {{12, 7}});
  ASSERT_EQ(dense.points.cols(), 84);
  for (Eigen::Index i = 0; i < 84; ++i) {
    const std::vector<double> q = {dense.q(0, i), dense.q(1, i)};
    EXPECT_EQ(surface_.evaluate(q), dense.points.col(i));
  }
  // Periodic: the end is left out, being the start. Open: both ends.
  EXPECT_EQ(dense.q(0, 0), 0.0);
  EXPECT_DOUBLE_EQ(dense.q(0, 83), 330.0);
  EXPECT_EQ(dense.q(1, 0), surface_.axes()[1].samples.front());
  EXPECT_DOUBLE_EQ(dense.q(1, 6), surface_.axes()[1].samples.back());
}

TEST_F(Resample, WritesAFileThatReadsBack) {
  const ResampledManifold dense = resample(surface_, {{10, 4}});
  write_csv(folder_ / "surface.csv", surface_, dense);
  std::ifstream in(folder_ / "surface.csv");
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "table [deg],\"x, left [deg]\",e1,e2,e3\r");
  Eigen::Index row = 0;
  for (; std::getline(in, line); ++row) {
    std::istringstream fields(line);
    std::string field;
    for (Eigen::Index k = 0; k < 5; ++k) {
      ASSERT_TRUE(std::getline(fields, field, ','));
      const double expected = k < 2 ? dense.q(k, row) : dense.points(k - 2, row);
      // Nine significant digits.
      EXPECT_NEAR(std::stod(field), expected, 1e-8 * (1e-3 + std::abs(expected)));
    }
  }
  EXPECT_EQ(row, 40);
}

TEST_F(Resample, QuotesANameThatACsvFieldCannotHoldAsItIs) {
  for (const auto& [name, field] :
       {std::pair("plain", "plain [deg]"), std::pair("a,b", "\"a,b [deg]\""),
        std::pair("3\" arm", "\"3\"\" arm [deg]\""), std::pair("a\rb", "\"a\rb [deg]\"")}) {
    const Manifold curve =
        synthetic::smooth_manifold({synthetic::axis(name, 5, false, true, random_)}, 1, 2, random_, 2);
    write_csv(folder_ / "curve.csv", curve, resample(curve, {{2}}));
    std::ifstream in(folder_ / "curve.csv");
    std::string line;
    std::getline(in, line);
    EXPECT_EQ(line, std::string(field) + ",e1\r");
  }
}

TEST_F(Resample, RefusesCountsThatDoNotFit) {
  EXPECT_THROW(resample(surface_, {{10}}), std::invalid_argument);
  EXPECT_THROW(resample(surface_, {{10, 0}}), std::invalid_argument);
}

TEST_F(Resample, SaysWhenTheFileCannotBeWritten) {
  EXPECT_THROW(write_csv(folder_ / "missing" / "surface.csv", surface_, resample(surface_, {{2, 2}})),
               FileError);
}

}  // namespace
}  // namespace eigenpose
