#include "core/learning/learning.h"

#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/recognition/recognizer.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::SceneKnobs;

class Learning : public ::testing::Test {
 protected:
  [[nodiscard]] const std::filesystem::path& root() const { return folder_.path(); }
  [[nodiscard]] std::string refusal(BadViews bad_views = BadViews::refuse) const {
    try {
      const auto sets = open_image_sets(root());
      LearningOptions options = testing::small_learning();
      options.bad_views = bad_views;
      (void)learn(all_views(sets), options);
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
  EXPECT_EQ(a.objects[1].typical_distance, b.objects[1].typical_distance);
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
  EXPECT_EQ(disk.objects[1].typical_distance, memory.objects[1].typical_distance);
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
    EXPECT_EQ(memory.has_bytes(), type == "grey");
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

TEST_F(Learning, LeavesOutViewsThatCannotBeUsedByName) {
  auto pictures = turn(12);
  pictures[2] = testing::empty_scene({}, 1);
  SceneKnobs aside;
  aside.x = 5.0;
  pictures[4] = testing::scene_with(1, 120.0, aside);
  SceneKnobs larger;
  larger.width = 200;
  pictures[6] = testing::scene_with(1, 180.0, larger);
  write("mug", pictures);
  testing::write_turn(root(), "other", 2, 12);
  std::filesystem::resize_file(root() / "mug/000008.png", 300);
  std::filesystem::remove(root() / "mug/000010.png");
  const auto sets = open_image_sets(root());
  LearningReport report;
  const Model model = learn(all_views(sets), testing::small_learning(), &report);
  std::vector<std::string> texts;
  for (const LeftOut& what : report.left_out) {
    EXPECT_EQ(what.object, "mug");
    EXPECT_FALSE(what.whole_object);
    texts.push_back(what.text());
  }
  EXPECT_THAT(texts,
              ElementsAre(AllOf(HasSubstr("000002.png"), HasSubstr("nothing that stands out")),
                          AllOf(HasSubstr("000004.png"), HasSubstr("border")),
                          AllOf(HasSubstr("000006.png"), HasSubstr("200x120"), HasSubstr("160x120")),
                          AllOf(HasSubstr("000008.png"), HasSubstr("truncated")), HasSubstr("000010.png")));
  ASSERT_EQ(model.objects.size(), 2U);
  EXPECT_EQ(model.objects[0].views, 7U);
  EXPECT_THAT(model.objects[0].manifold.axes()[0].samples, ElementsAre(0, 30, 90, 150, 210, 270, 330));
  EXPECT_EQ(report.views, 19U);
}

TEST_F(Learning, IsTheLearningOfTheViewsThatAreLeft) {
  write("mug", turn(12));
  testing::write_turn(root(), "other", 2, 12);
  const auto sets = open_image_sets(root());
  std::vector<TrainingSet> chosen = all_views(sets);
  for (std::size_t i = 0; i < 12; ++i)
    if (i != 0 && i != 5) chosen[0].views.push_back(i);
  LearningOptions options = testing::small_learning();
  options.parts = true;
  const Model expected = learn(chosen, options);
  for (const char* name : {"mug/000000.png", "mug/000005.png"})
    std::filesystem::resize_file(root() / name, 300);
  const Model model = learn(all_views(sets), options);
  EXPECT_EQ(model.eigenspace.basis, expected.eigenspace.basis);
  for (std::size_t o = 0; o < 2; ++o) {
    EXPECT_EQ(model.objects[o].manifold.coefficients(), expected.objects[o].manifold.coefficients());
    EXPECT_EQ(model.parts->extents[o], expected.parts->extents[o]);
    EXPECT_EQ(model.rejection_distance(o), expected.rejection_distance(o));
  }
}

TEST_F(Learning, ReportsEachStageThatTakesLongObjectByObject) {
  testing::write_turn(root(), "one", 1, 12);
  testing::write_turn(root(), "two", 2, 12);
  const auto sets = open_image_sets(root());
  LearningOptions options = testing::small_learning();
  options.parts = true;
  std::map<std::string, std::vector<std::size_t>> heard;  // one call at a time
  (void)learn(all_views(sets), options, nullptr, [&](const ProgressUpdate& update) {
    EXPECT_GE(update.total, update.done);
    heard[std::string(update.stage)].push_back(update.done);
  });
  for (const char* stage : {"computing orientations", "learning windows", "learning alignment",
                            "calibrating distances", "calibrating windows"})
    EXPECT_THAT(heard[stage], ElementsAre(1U, 2U)) << stage;
}

TEST_F(Learning, LeavesOutViewsFromDiskAsFromMemory) {
  write("mug", turn(24));
  testing::write_turn(root(), "other", 2, 24);
  std::filesystem::resize_file(root() / "mug/000005.png", 300);
  const auto sets = open_image_sets(root());
  const NormalizationOptions options = testing::small_learning().normalization;
  const TrainingViews memory(all_views(sets), {options, 2}, {}, {});
  const TrainingViews disk(all_views(sets), {options, 2, 1, root()}, {}, {});
  ASSERT_EQ(disk.resident(), 0U);
  ASSERT_EQ(memory.count(), 47U);
  EXPECT_EQ(memory.resident(), 47 * picture_length(options));
  EXPECT_EQ(disk.pictures(0, 47), memory.pictures(0, 47));
  for (std::size_t i = 0; i < 47; ++i) EXPECT_EQ(disk.energy(i), memory.energy(i));
}

TEST_F(Learning, SortsViewsThatStandInAnyOrder) {
  testing::write_turn(root(), "mug", 1, 8);
  const auto sets = open_image_sets(root());
  std::vector<TrainingSet> shuffled = all_views(sets);
  shuffled[0].views = {5, 2, 7, 0, 1, 6, 4, 3};
  const NormalizationOptions options = testing::small_learning().normalization;
  const TrainingViews expected(all_views(sets), {options, 2}, {}, {});
  const TrainingViews views(shuffled, {options, 2}, {}, {});
  EXPECT_EQ(views.pictures(0, 8), expected.pictures(0, 8));
  EXPECT_EQ(views.objects()[0].extents, expected.objects()[0].extents);
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(views.energy(i), expected.energy(i));
}

TEST_F(Learning, LeavesOutTheSecondViewAtAPose) {
  ImageSetWriter writer(root(), "mug", turntable_workspace(), nlohmann::json::object(),
                        {.sync_every_view = false});
  for (const double angle : {0.0, 60.0, 120.0, 120.01, 180.0, 240.0, 300.0})
    writer.add(testing::scene_with(1, angle), {angle});
  writer.finish();
  EXPECT_THAT(refusal(),
              AllOf(HasSubstr("000003.png"), HasSubstr("the pose of 000002.png"), HasSubstr("table 120")));
  LearningReport report;
  const auto sets = open_image_sets(root());
  EXPECT_EQ(learn(all_views(sets), testing::small_learning(), &report).objects[0].views, 6U);
  ASSERT_EQ(report.left_out.size(), 1U);
  EXPECT_EQ(report.left_out[0].file, root() / "mug/000003.png");
}

TEST_F(Learning, LeavesOutAnObjectOfWhichTooFewViewsAreLeftAndLearnsTheOthers) {
  write("few", turn(2));
  write("none", {}, false);
  testing::write_turn(root(), "other", 2, 12);
  const auto sets = open_image_sets(root());
  LearningReport report;
  const Model model = learn(all_views(sets), testing::small_learning(), &report);
  ASSERT_EQ(model.objects.size(), 1U);
  EXPECT_EQ(model.objects[0].name, "other");
  ASSERT_EQ(report.left_out.size(), 2U);
  EXPECT_TRUE(report.left_out[0].whole_object);
  EXPECT_THAT(report.left_out[0].text(),
              AllOf(HasSubstr("few"), HasSubstr("2 view(s)"), HasSubstr("at least 3")));
  EXPECT_THAT(report.left_out[1].text(), HasSubstr("0 view(s)"));
  EXPECT_THAT(refusal(BadViews::refuse), AllOf(HasSubstr("few"), HasSubstr("2 view(s)")));
}

TEST_F(Learning, NamesTheFirstViewThatCannotBeUsedWhereTooFewAreLeft) {
  auto pictures = turn(4);
  pictures[1] = cv::Mat(pictures[0].size(), pictures[0].type(), cv::Scalar::all(0));
  pictures[3] = pictures[1];
  write("few", pictures);
  EXPECT_THAT(refusal(BadViews::leave_out),
              AllOf(HasSubstr("2 view(s)"), HasSubstr("; 000001.png "), HasSubstr("nothing that stands out"),
                    Not(HasSubstr("acquire more"))));
}

TEST_F(Learning, RefusesWhereNothingIsLeft) {
  write("one", turn(1));
  write("two", turn(2));
  EXPECT_THAT(refusal(BadViews::leave_out),
              AllOf(HasSubstr("none of 2 image set(s)"), HasSubstr("1 view(s)")));
}

TEST_F(Learning, TakesUnevenViewsWithAGap) {
  ImageSetWriter writer(root(), "mug", turntable_workspace(), nlohmann::json::object(),
                        {.sync_every_view = false});
  for (const double angle : {0.0, 7.5, 21.0, 40.0, 55.25, 70.0, 90.0, 102.0, 125.0, 140.0, 160.0, 181.5,
                             200.0, 219.0, 240.0, 258.0, 275.0, 290.0, 300.0})
    writer.add(testing::scene_with(1, angle), {angle});
  writer.finish();
  testing::write_turn(root(), "other", 2, 12);
  LearningOptions options = testing::small_learning();
  options.parts = true;
  const auto sets = open_image_sets(root());
  Recognizer recognizer(std::make_shared<const Model>(learn(all_views(sets), options)));
  for (const double angle : {48.0, 133.0, 210.0}) {
    const auto outcomes = recognizer.recognize(testing::scene_with(1, angle));
    ASSERT_EQ(outcomes.size(), 1U);
    ASSERT_TRUE(outcomes[0].best) << angle;
    EXPECT_EQ(outcomes[0].best->object, "mug");
    EXPECT_NEAR(outcomes[0].best->q[0], angle, 4.0) << "a quarter of the local step";
  }
}

TEST_F(Learning, EndsWhenAskedTo) {
  testing::write_turn(root(), "one", 1, 12);
  const auto sets = open_image_sets(root());
  std::stop_source source;
  source.request_stop();
  EXPECT_THROW(learn(all_views(sets), testing::small_learning(), nullptr, {}, source.get_token()),
               Interrupted);
}

/// Seen from `table`, with brightness that rises or falls across the object as the light moves.
cv::Mat lit(double table, double light) {
  cv::Mat picture = testing::scene_with(1, table);
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x) {
      auto& pixel = picture.at<cv::Vec3b>(y, x);
      if (pixel[0] + pixel[1] + pixel[2] < 90) continue;
      for (int b = 0; b < 3; ++b)
        pixel[b] = cv::saturate_cast<unsigned char>(pixel[b] * (0.6 + light * (x - 80) / 2400.0));
    }
  return picture;
}

Workspace turn_under_light() {
  return Workspace({{"table", "deg", 0.0, 360.0, true}, {"light", "deg", -40.0, 40.0, false}});
}

TEST_F(Learning, LearnsPosesThatAreNoGrid) {
  // A grid with a tenth of its views missing, and a plan that jumps about.
  std::vector<std::vector<double>> holes;
  for (int table = 0; table < 360; table += 20)
    for (int light = -40; light <= 40; light += 20)
      if ((table / 20 * 5 + light / 20) % 10 != 3) holes.push_back({1.0 * table, 1.0 * light});
  std::vector<std::vector<double>> jumps;
  for (int i = 0; i < 110; ++i)
    jumps.push_back({std::fmod(137.508 * i, 360.0), -40.0 + std::fmod(49.443 * i, 80.0)});
  for (const auto& poses : {holes, jumps}) {
    std::filesystem::remove_all(root() / "mug");
    ImageSetWriter writer(root(), "mug", turn_under_light(), nlohmann::json::object(),
                          {.sync_every_view = false});
    for (const auto& pose : poses) writer.add(lit(pose[0], pose[1]), pose);
    writer.finish();
    const auto sets = open_image_sets(root());
    LearningOptions with_windows = testing::small_learning();
    with_windows.parts = true;
    for (const LearningOptions& options : {testing::small_learning(), with_windows}) {
      LearningReport report;
      const auto model = std::make_shared<const Model>(learn(all_views(sets), options, &report));
      EXPECT_TRUE(report.left_out.empty());
      EXPECT_EQ(model->objects[0].views, poses.size());
      EXPECT_EQ(report.evidence[0].left_out_errors[1].size(), poses.size()) << "each left out once";
      Recognizer recognizer(model);
      const auto outcomes = recognizer.recognize(lit(120.0, 10.0));
      ASSERT_EQ(outcomes.size(), 1U);
      ASSERT_TRUE(outcomes[0].best);
      EXPECT_NEAR(outcomes[0].best->q[0], 120.0, 8.0);
      EXPECT_NEAR(outcomes[0].best->q[1], 10.0, 12.0);
    }
  }
}

TEST_F(Learning, LearnsPoseAndLightTogether) {
  const Workspace workspace = turn_under_light();
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
