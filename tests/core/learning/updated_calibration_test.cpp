#include <tuple>

#include <gmock/gmock.h>

#include "core/base/error.h"
#include "core/learning/training_archive.h"
#include "core/model/model_file.h"
#include "core/recognition/recognizer.h"
#include "tests/core/learning/training_archive_fixture.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

/// Five objects with windows in a model, at 32 × 32.
class UpdatedCalibrationTest : public TrainingArchiveTest {
 protected:
  static constexpr int kinds = 5;

  [[nodiscard]] static LearningOptions with_parts() {
    LearningOptions options = testing::small_learning();
    options.parts = true;
    return options;
  }
  [[nodiscard]] static std::string name(int kind) { return "object" + std::to_string(kind); }
  void write_kinds(int first, int last) const {
    std::filesystem::remove_all(sets());
    for (int kind = first; kind <= last; ++kind) write(name(kind), kind);
  }
  [[nodiscard]] Model learned(const LearningOptions& options, LearningReport* report = nullptr) const {
    const auto images = open_image_sets(sets());
    Model model = learn(all_views(images), options, report);
    if (report != nullptr && report->kept_views) report->kept_views->commit();
    return model;
  }
  /// The model of objects 1 to `last`, kept in `file`.
  [[nodiscard]] Model keep_kinds(const std::string& file, int last) const {
    write_kinds(1, last);
    LearningOptions options = with_parts();
    options.kept_views = path(file);
    return learned(options);
  }
  /// What is kept in `file`, without some objects and with those in `sets`.
  [[nodiscard]] Model update(const std::string& file, const std::vector<std::string>& leaving,
                             LearningReport& report, const Model* former = nullptr,
                             const std::string& into = {}) const {
    const TrainingArchive kept(path(file));
    LearningOptions options = kept.options();
    options.program_version = with_parts().program_version;
    options.former = former;
    if (!into.empty()) options.kept_views = path(into);
    const std::vector<ImageSet> joining =
        std::filesystem::exists(sets()) ? open_image_sets(sets()) : std::vector<ImageSet>();
    Model model = learn(updated_sets(kept, leaving, joining), options, &report);
    if (report.kept_views) report.kept_views->commit();
    return model;
  }
  /// The model file's bytes, but for what calibration found.
  [[nodiscard]] std::vector<unsigned char> uncalibrated(Model model) const {
    model.decision = {};
    for (ModelObject& object : model.objects) object.typical_distance = 1.0;
    auto parts = std::make_shared<PartsModel>(*model.parts);
    parts->calibration.assign(parts->calibration.size(), {});
    model.parts = parts;
    return bytes_of(model);
  }
  /// Both models say the same of what is learned and of what is not, and measure about the same.
  static void expect_alike(const Model& updated, const Model& anew) {
    ASSERT_EQ(updated.objects.size(), anew.objects.size());
    for (std::size_t o = 0; o < anew.objects.size(); ++o) {
      EXPECT_NEAR(updated.objects[o].typical_distance, anew.objects[o].typical_distance,
                  0.02 * anew.objects[o].typical_distance);
      EXPECT_NEAR(updated.parts->calibration[o].typical_votes, anew.parts->calibration[o].typical_votes,
                  0.02);
      EXPECT_NEAR(updated.parts->calibration[o].foreign_share, anew.parts->calibration[o].foreign_share,
                  0.05);
    }
    Recognizer by_updated(std::make_shared<const Model>(updated));
    Recognizer by_anew(std::make_shared<const Model>(anew));
    for (int kind = 1; kind <= kinds + 1; ++kind)
      for (int i = 0; i < 12; ++i) {
        const cv::Mat scene = testing::scene_with(kind, 30.0 * i + 10.0);
        const auto one = by_updated.recognize(scene);
        const auto other = by_anew.recognize(scene);
        ASSERT_EQ(one.size(), other.size());
        for (std::size_t r = 0; r < one.size(); ++r) {
          EXPECT_EQ(one[r].verdict, other[r].verdict) << "kind " << kind << " view " << i;
          ASSERT_EQ(one[r].best.has_value(), other[r].best.has_value());
          if (!one[r].best) continue;
          EXPECT_EQ(one[r].best->object, other[r].best->object) << "kind " << kind << " view " << i;
          EXPECT_NEAR(one[r].best->distance, other[r].best->distance, 1e-3);
        }
      }
  }
};

TEST_F(UpdatedCalibrationTest, OneThatJoinsFourLeavesTheModelAsLearnedAnewAndShowsFewOfTheOldViews) {
  const Model former = keep_kinds("kept", 4);
  write_kinds(5, 5);
  LearningReport report;
  const Model joined = update("kept", {}, report, &former);
  write_kinds(1, 5);
  LearningReport all;
  const Model anew = learned(with_parts(), &all);
  EXPECT_EQ(uncalibrated(joined), uncalibrated(anew));
  expect_alike(joined, anew);
  EXPECT_EQ(all.shown_views, 60U);
  EXPECT_GE(report.shown_views, 12U) << "those of the new object";
  EXPECT_LT(report.shown_views, 60U);
}

TEST_F(UpdatedCalibrationTest, OneThatLeavesFiveLeavesTheModelAsLearnedAnew) {
  const Model former = keep_kinds("kept", 5);
  std::filesystem::remove_all(sets());
  LearningReport report;
  const Model left = update("kept", {name(2)}, report, &former);
  write_kinds(1, 5);
  std::filesystem::remove_all(sets() / name(2));
  const Model anew = learned(with_parts());
  EXPECT_EQ(uncalibrated(left), uncalibrated(anew));
  expect_alike(left, anew);
  EXPECT_LT(report.shown_views, 48U);
}

TEST_F(UpdatedCalibrationTest, AlignmentEigenspacesOfAnotherModelAreNotTaken) {
  (void)keep_kinds("kept", 4);
  write_kinds(2, 5);
  Model other = learned(with_parts());
  write_kinds(5, 5);
  LearningReport report;
  const Model joined = update("kept", {}, report, &other);
  write_kinds(1, 5);
  EXPECT_EQ(uncalibrated(joined), uncalibrated(learned(with_parts())));
}

TEST_F(UpdatedCalibrationTest, TakesTheAlignmentEigenspacesOfTheFormerModel) {
  Model former = keep_kinds("kept", 4);
  auto parts = std::make_shared<PartsModel>(*former.parts);
  parts->poses[0] = parts->poses[1];
  former.parts = parts;
  write_kinds(5, 5);
  LearningReport report;
  const Model joined = update("kept", {}, report, &former);
  EXPECT_EQ(joined.parts->poses[0].pixel_mean(), parts->poses[1].pixel_mean());
}

TEST_F(UpdatedCalibrationTest, AfterMoreThanAQuarterOfTheObjectsChangedEveryViewIsShownAgain) {
  (void)keep_kinds("kept", 4);
  write_kinds(5, 6);
  LearningReport report;
  const Model at_once = update("kept", {}, report);
  write_kinds(5, 5);
  LearningReport first;
  (void)update("kept", {}, first, nullptr, "next");
  write_kinds(6, 6);
  LearningReport second;
  const Model one_by_one = update("next", {}, second);
  write_kinds(1, 6);
  const auto anew = bytes_of(learned(with_parts()));
  EXPECT_EQ(bytes_of(at_once), anew);
  EXPECT_EQ(bytes_of(one_by_one), anew);
  EXPECT_LT(first.shown_views, 60U);
  EXPECT_EQ(second.shown_views, 72U);
}

TEST_F(UpdatedCalibrationTest, TheFileKeepsAllThatCalibrationFound) {
  write_kinds(1, 3);
  LearningOptions options = with_parts();
  options.kept_views = path("kept");
  LearningReport report;
  (void)learned(options, &report);
  const TrainingArchive kept(path("kept"));
  const CalibrationRecord record = kept.calibration();
  EXPECT_EQ(record.measured_among, 3U);
  EXPECT_EQ(record.changes, 0U);
  ASSERT_EQ(record.objects.size(), 3U);
  for (const ObjectRecord& object : record.objects) {
    EXPECT_EQ(object.misalignments.size(), 12U);
    EXPECT_EQ(object.votes.votes.size(), 12U);
  }
  const std::vector<Probe> probes = probes_of(record.shown);
  ASSERT_EQ(probes.size(), report.probes.size());
  for (std::size_t i = 0; i < probes.size(); ++i) {
    const Probe& a = probes[i];
    const Probe& b = report.probes[i];
    EXPECT_EQ(std::tie(a.object, a.taken_for, a.known, a.hidden),
              std::tie(b.object, b.taken_for, b.known, b.hidden));
    EXPECT_EQ(whole_terms(a.whole), whole_terms(b.whole));
    ASSERT_EQ(a.windows.has_value(), b.windows.has_value());
    if (a.windows) {
      EXPECT_EQ(a.windows->taken_for, b.windows->taken_for);
      EXPECT_EQ(windows_terms(a.windows->whole, a.windows->windows),
                windows_terms(b.windows->whole, b.windows->windows));
    }
    ASSERT_EQ(a.occluded.has_value(), b.occluded.has_value());
    if (a.occluded) {
      EXPECT_EQ(occluded_terms(a.occluded->match), occluded_terms(b.occluded->match));
    }
  }
}

}  // namespace
}  // namespace eigenpose
