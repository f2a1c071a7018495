#include "core/model/resampled_file.h"

#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "core/base/error.h"
#include "core/base/input_file.h"
#include "core/model/hdf5_file.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

/// A turn of 4 views by a shift of 3.
Manifold turn_and_shift() {
  const SampleAxis turn{turntable_workspace()[0], {0.0, 90.0, 180.0, 270.0}};
  const SampleAxis shift{{"x", "mm", 0.0, 8.0, false}, {1.0, 3.0, 8.0}};
  return Manifold::interpolate({turn, shift}, Eigen::MatrixXd::Random(2, 12), 2);
}

Model model_of(const std::vector<std::string>& names) {
  Model model;
  for (const std::string& name : names) {
    Manifold manifold = turn_and_shift();
    const Workspace workspace({manifold.axes()[0].dof, manifold.axes()[1].dof});
    model.objects.push_back({name, workspace, std::move(manifold)});
  }
  return model;
}

TEST(ResampledFile, CountsPointsByTurnOnClosedAxesAndByStepWithBothEndsOnOpenOnes) {
  EXPECT_EQ(resampling_counts(turn_and_shift(), {.per_turn = 36, .per_step = 5}),
            (std::vector<std::size_t>{36, 11}));
  EXPECT_EQ(resampling_counts(turn_and_shift(), {.per_turn = 1, .per_step = 1}),
            (std::vector<std::size_t>{1, 3}));
  EXPECT_THROW((void)resampling_counts(turn_and_shift(), {.per_turn = 0, .per_step = 5}),
               std::invalid_argument);
  EXPECT_THROW((void)resampling_counts(turn_and_shift(), {.per_turn = 36, .per_step = 0}),
               std::invalid_argument);
}

TEST(ResampledFile, HoldsTheLearnedValuesOfAnOpenAxisAndBothOfItsEnds) {
  const test::TemporaryFolder folder;
  const Model model = model_of({"mug", "box"});
  const auto file = folder.path() / "all.h5";
  const std::vector<std::size_t> objects{1};
  EXPECT_EQ(write_resampled(model, objects, {.per_turn = 8, .per_step = 2}, file), std::vector{file});
  const Hdf5Lock lock;
  const Hdf5Handle open = open_hdf5(file);
  const Hdf5Group root = root_of(open);
  EXPECT_EQ(root.group_names(), std::vector<std::string>{"box"});
  const Hdf5Group box = root.open_group("box");
  EXPECT_EQ(box.read_text("axes"), "table [deg], x [mm]");
  EXPECT_EQ(box.read_integer("degree", 0, 9), 2);
  const Eigen::MatrixXd q = box.read_doubles("q");
  ASSERT_EQ(q.cols(), 8 * 5);
  EXPECT_DOUBLE_EQ(q.row(0).maxCoeff(), 315.0) << "a turn does not hold its seam twice";
  EXPECT_DOUBLE_EQ(q.row(1).minCoeff(), 1.0);
  EXPECT_DOUBLE_EQ(q.row(1).maxCoeff(), 8.0);
  const Eigen::MatrixXd points = box.read_doubles("points");
  ASSERT_EQ(points.cols(), q.cols());
  for (Eigen::Index i = 0; i < q.cols(); ++i)
    EXPECT_EQ(points.col(i), model.objects[1].manifold.evaluate({q.col(i).data(), 2})) << i;
}

TEST(ResampledFile, IsOneTableAnObjectAndNamedAfterItWhereThereAreSeveral) {
  const test::TemporaryFolder folder;
  const Model model = model_of({"mug", "box"});
  const std::vector<std::size_t> both{0, 1};
  const std::vector<std::size_t> one{1};
  const ResamplingOptions options{.per_turn = 4, .per_step = 1};
  EXPECT_EQ(write_resampled(model, both, options, folder.path() / "a.csv"),
            (std::vector{folder.path() / "a-mug.csv", folder.path() / "a-box.csv"}));
  EXPECT_EQ(write_resampled(model, one, options, folder.path() / "a.csv"),
            std::vector{folder.path() / "a.csv"});
  EXPECT_EQ(read_file(folder.path() / "a.csv"), read_file(folder.path() / "a-box.csv"));
  EXPECT_THAT([&] { (void)write_resampled(model, one, options, folder.path() / "a.txt"); },
              ::testing::ThrowsMessage<FileError>(::testing::HasSubstr("is neither .h5 (HDF5) nor .csv")));
}

}  // namespace
}  // namespace eigenpose
