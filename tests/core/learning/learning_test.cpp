#include "core/learning/learning.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/recognition/recognizer.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::SceneKnobs;

class Learning : public ::testing::Test {
 protected:
  [[nodiscard]] const std::filesystem::path& root() const { return folder_.path(); }
  [[nodiscard]] std::string refusal() const {
    try {
      const auto sets = open_image_sets(root());
      (void)learn(all_views(sets), testing::small_learning());
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }
  void write(const std::string& object, const std::vector<cv::Mat>& pictures, bool finish = true) const {
    ImageSetWriter writer(root(), object, turntable_workspace(), nlohmann::json::object(),
                          {.sync_every_view = false});
    for (std::size_t i = 0; i < pictures.size(); ++i)
      writer.add(pictures[i], {360.0 * static_cast<double>(i) / static_cast<double>(pictures.size())});
    if (finish) writer.finish();
  }
  static std::vector<cv::Mat> turn(int views) {
    std::vector<cv::Mat> pictures;
    pictures.reserve(static_cast<std::size_t>(views));
    for (int i = 0; i < views; ++i) pictures.push_back(testing::scene_with(1, 360.0 * i / views));
    return pictures;
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(Learning, SeesFromTheViewsWhichPosesCanBeSeen) {
  for (const ModelObject& object : testing::learned_world().model->objects)
    EXPECT_EQ(object.pose_observable, object.name != "round") << object.name;
}

TEST_F(Learning, DoesNotDependOnThreads) {
  testing::write_turn(root(), "one", 1, 12);
  testing::write_turn(root(), "two", 2, 12);
  const auto sets = open_image_sets(root());
  LearningOptions options = testing::small_learning();
  options.threads = 1;
  const Model a = learn(all_views(sets), options);
  options.threads = 3;
  const Model b = learn(all_views(sets), options);
  EXPECT_EQ(a.eigenspace.basis, b.eigenspace.basis);
  EXPECT_EQ(a.objects[1].manifold.coefficients(), b.objects[1].manifold.coefficients());
  EXPECT_EQ(a.objects[1].rejection_distance, b.objects[1].rejection_distance);
}

TEST_F(Learning, GivesTheSameModelFromMemoryAndFromDisk) {
  testing::write_turn(root(), "one", 1, 24);
  testing::write_turn(root(), "two", 2, 24);
  const auto sets = open_image_sets(root());
  LearningOptions options = testing::small_learning();
  options.solver.solver = "gram";
  options.solver.components = 3;
  const Model memory = learn(all_views(sets), options);
  // Pictures may take half of it: 45 of 48. The rest is enough for the solver.
  options.memory_limit = 90 * picture_length(options.normalization);
  options.scratch_folder = root();
  EXPECT_EQ(
      TrainingViews(all_views(sets), {options.normalization, 1, options.memory_limit / 2}, {}, {}).resident(),
      0U);
  const Model disk = learn(all_views(sets), options);
  EXPECT_EQ(disk.eigenspace.basis, memory.eigenspace.basis);
  EXPECT_EQ(disk.objects[1].manifold.coefficients(), memory.objects[1].manifold.coefficients());
  EXPECT_EQ(disk.objects[1].rejection_distance, memory.objects[1].rejection_distance);
}

TEST_F(Learning, JoinsTheEigenspacesOfItsObjects) {
  testing::write_turn(root(), "one", 1, 12);
  testing::write_turn(root(), "two", 2, 8);
  const auto sets = open_image_sets(root());
  LearningOptions options = testing::small_learning();
  options.solver.joined.left_out = 0.0;
  const Model gram = learn(all_views(sets), options);
  options.solver.solver = "joined";
  LearningReport report;
  const Model joined = learn(all_views(sets), options, &report);
  EXPECT_EQ(report.solver.joined->blocks, 2U) << "one eigenspace an object";
  // Both exact: the bases differ by float rounding, in directions that lie close to the next one by more.
  const Eigen::MatrixXf across = gram.eigenspace.basis.transpose() * joined.eigenspace.basis;
  EXPECT_LT((across - Eigen::MatrixXf::Identity(across.rows(), across.cols())).cwiseAbs().maxCoeff(), 1e-4F);
}

TEST_F(Learning, ReadsViewsOfEveryTypeAlikeFromMemoryAndFromDisk) {
  testing::write_turn(root(), "one", 1, 6);
  const auto sets = open_image_sets(root());
  NormalizationOptions options = testing::small_learning().normalization;
  for (const std::string type : {"grey", "color", "gradient", "color+fourier"}) {
    set_image_type(options, type);
    const TrainingViews memory(all_views(sets), {options, 2}, {}, {});
    const TrainingViews disk(all_views(sets), {options, 2, 1, root()}, {}, {});
    ASSERT_EQ(disk.resident(), 0U);
    const auto rows = static_cast<Eigen::Index>(appearance_length(options));
    Eigen::MatrixXf a(rows, 4);
    Eigen::MatrixXf b(rows, 4);
    memory.read(2, a);
    disk.read(2, b);
    EXPECT_EQ(a, b) << type;
    // Of unit energy up to the rounding of floats.
    for (Eigen::Index c = 0; c < a.cols(); ++c) EXPECT_NEAR(a.col(c).norm(), 1.0F, 1e-4F) << type;
    EXPECT_EQ(memory.has_bytes(), type == "grey" || type == "color");
  }
}

TEST_F(Learning, NamesAnObjectWithOneView) {
  write("mug", turn(1));
  EXPECT_THAT(refusal(), AllOf(HasSubstr("mug"), HasSubstr("1 view(s)"), HasSubstr("acquire more")));
}

TEST_F(Learning, NamesASetWithoutViews) {
  write("mug", {}, false);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("mug"), HasSubstr("0 view(s)")));
}

TEST_F(Learning, NamesTheViewOfAnotherSize) {
  auto pictures = turn(8);
  SceneKnobs larger;
  larger.width = 200;
  pictures[5] = testing::scene_with(1, 225.0, larger);
  write("mug", pictures);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("000005.png"), HasSubstr("200x120"), HasSubstr("160x120")));
}

TEST_F(Learning, NamesATruncatedView) {
  write("mug", turn(8));
  std::filesystem::resize_file(root() / "mug/000003.png", 300);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("000003.png"), HasSubstr("truncated")));
}

TEST_F(Learning, NamesAViewThatShowsNothingOrHalfTheObject) {
  auto pictures = turn(8);
  pictures[2] = testing::empty_scene({}, 1);
  write("mug", pictures);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("000002.png"), HasSubstr("nothing that stands out")));
  std::filesystem::remove_all(root() / "mug");
  SceneKnobs aside;
  aside.x = 5.0;
  pictures[2] = testing::scene_with(1, 90.0, aside);
  write("mug", pictures);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("000002.png"), HasSubstr("border")));
}

TEST_F(Learning, EndsWhenAskedTo) {
  testing::write_turn(root(), "one", 1, 12);
  const auto sets = open_image_sets(root());
  std::stop_source source;
  source.request_stop();
  EXPECT_THROW(learn(all_views(sets), testing::small_learning(), nullptr, {}, source.get_token()),
               Interrupted);
}

TEST_F(Learning, LearnsPoseAndLightTogether) {
  // The second DOF is the side the light comes from: brightness rises or falls across the object.
  const Workspace workspace({{"table", "deg", 0.0, 360.0, true}, {"light", "deg", -40.0, 40.0, false}});
  const auto lit = [](double table, double light) {
    cv::Mat picture = testing::scene_with(1, table);
    for (int y = 0; y < picture.rows; ++y)
      for (int x = 0; x < picture.cols; ++x) {
        auto& pixel = picture.at<cv::Vec3b>(y, x);
        if (pixel[0] + pixel[1] + pixel[2] < 90) continue;
        for (int b = 0; b < 3; ++b)
          pixel[b] = cv::saturate_cast<unsigned char>(pixel[b] * (0.6 + light * (x - 80) / 2400.0));
      }
    return picture;
  };
  ImageSetWriter writer(root(), "mug", workspace, nlohmann::json::object(), {.sync_every_view = false});
  for (int table = 0; table < 360; table += 20)
    for (int light = -40; light <= 40; light += 20) writer.add(lit(table, light), {1.0 * table, 1.0 * light});
  writer.finish();
  const auto sets = open_image_sets(root());
  LearningOptions too_few = testing::small_learning();
  too_few.solver.components = 2;
  EXPECT_THROW(learn(all_views(sets), too_few), Error) << "the manifold would fill its space";
  LearningOptions with_windows = testing::small_learning();
  with_windows.parts = true;
  for (const LearningOptions& options : {testing::small_learning(), with_windows}) {
    Recognizer recognizer(std::make_shared<const Model>(learn(all_views(sets), options)));
    const auto outcomes = recognizer.recognize(lit(120.0, 10.0));
    ASSERT_EQ(outcomes.size(), 1U);
    const std::vector<double>& covariance = outcomes[0].q_covariance;
    ASSERT_EQ(covariance.size(), 4U) << "of the two together";
    EXPECT_NEAR(covariance[1], covariance[2], 1e-6 * std::abs(covariance[1]));
    EXPECT_GT(covariance[0] * covariance[3], covariance[1] * covariance[2]);
    EXPECT_NEAR(std::sqrt(covariance[0]), outcomes[0].q_sigma[0], 1e-9);
    EXPECT_LT(outcomes[0].q_sigma[0], 20.0);
    EXPECT_LT(outcomes[0].q_sigma[1], 20.0);
  }
  const auto model = std::make_shared<const Model>(learn(all_views(sets), testing::small_learning()));
  ASSERT_EQ(model->objects[0].dof_observable, (std::vector<bool>{true, true}));
  Recognizer recognizer(model);
  for (const double light : {-10.0, 10.0, 30.0}) {
    const auto outcomes = recognizer.recognize(lit(120.0, light));
    ASSERT_EQ(outcomes.size(), 1U);
    EXPECT_EQ(outcomes[0].verdict, Verdict::recognized);
    // The light is halfway between learned values; 20 degrees of the table apart, balls come and go, so the
    // table stands at a learned one. Tolerance: a quarter of the learned steps.
    EXPECT_NEAR(outcomes[0].best->q[0], 120.0, 5.0);
    EXPECT_NEAR(outcomes[0].best->q[1], light, 5.0);
  }
}

}  // namespace
}  // namespace eigenpose
