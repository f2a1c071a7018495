#include "core/learning/training_views.h"

#include <filesystem>
#include <vector>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "core/learning/learning.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::SceneKnobs;

class TrainingViewsTest : public ::testing::Test {
 protected:
  [[nodiscard]] const std::filesystem::path& root() const { return folder_.path(); }
  /// One view of "mug" at each angle.
  void write(const std::vector<cv::Mat>& pictures, const std::vector<double>& angles) const {
    ImageSetWriter writer(root(), "mug", turntable_workspace(), nlohmann::json::object(),
                          {.sync_every_view = false});
    for (std::size_t i = 0; i < pictures.size(); ++i) writer.add(pictures[i], {angles[i]});
    writer.finish();
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(TrainingViewsTest, NamesTheSecondViewAtAPoseByItsOwnFileAfterOthersThatCannotBeUsed) {
  const std::vector<double> angles{0.0, 60.0, 120.0, 120.01, 180.0, 240.0, 300.0};
  std::vector<cv::Mat> pictures;
  pictures.reserve(angles.size());
  for (const double angle : angles) pictures.push_back(testing::scene_with(1, angle));
  write(pictures, angles);
  std::filesystem::remove(root() / "mug/000001.png");
  const auto sets = open_image_sets(root());
  const TrainingViews views(all_views(sets), {testing::small_learning().normalization, 2}, {}, {});
  EXPECT_EQ(views.count(), 5U);
  ASSERT_EQ(views.left_out().size(), 2U);
  EXPECT_EQ(views.left_out()[0].file, root() / "mug/000001.png");
  EXPECT_EQ(views.left_out()[1].file, root() / "mug/000003.png");
  EXPECT_THAT(views.left_out()[1].text(), HasSubstr("the pose of 000002.png"));
}

TEST_F(TrainingViewsTest, TakeTheKindOfMostUsableViewsForTheUsualOne) {
  // Five views of one size; of the other four that can be used, and three that show nothing.
  SceneKnobs larger;
  larger.width = 200;
  std::vector<cv::Mat> pictures;
  std::vector<double> angles;
  for (int i = 0; i < 12; ++i) {
    angles.push_back(30.0 * i);
    pictures.push_back(i < 3        ? testing::empty_scene({}, 1)
                       : i % 2 == 1 ? testing::scene_with(1, angles.back(), larger)
                                    : testing::scene_with(1, angles.back()));
  }
  write(pictures, angles);
  const auto sets = open_image_sets(root());
  const TrainingViews views(all_views(sets), {testing::small_learning().normalization, 2}, {}, {});
  EXPECT_EQ(views.count(), 5U);
  ASSERT_EQ(views.left_out().size(), 7U);
  EXPECT_THAT(views.left_out()[3].text(),
              AllOf(HasSubstr("000004.png"), HasSubstr("is 160x120"), HasSubstr("are 200x120")));
}

}  // namespace
}  // namespace eigenpose
