#include "core/learning/training_archive.h"

#include <cerrno>
#include <fstream>
#include <tuple>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/image/picture_file.h"
#include "core/model/model_file.h"
#include "core/recognition/recognizer.h"
#include "tests/support/full_disk.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class TrainingArchiveTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path path(const std::string& name) const { return folder_.path() / name; }
  [[nodiscard]] std::filesystem::path sets() const { return path("sets"); }
  void write(const std::string& object, int kind) const { testing::write_turn(sets(), object, kind, 12); }

  /// Learns all that stands in `sets` and keeps it in `file`.
  void keep(const std::string& file, LearningOptions options = testing::small_learning()) const {
    options.kept_views = path(file);
    const auto images = open_image_sets(sets());
    (void)learn(all_views(images), options);
  }
  /// The model file's bytes, but for the time it was learned.
  [[nodiscard]] std::vector<unsigned char> bytes_of(Model model) const {
    model.provenance.created = "then";
    save_model(model, path("compared.model"));
    return read_file(path("compared.model"));
  }
  [[nodiscard]] std::vector<unsigned char> learned_anew(
      const LearningOptions& options = testing::small_learning()) const {
    const auto images = open_image_sets(sets());
    return bytes_of(learn(all_views(images), options));
  }
  [[nodiscard]] std::vector<unsigned char> updated(const std::string& file,
                                                   const std::vector<std::string>& leaving,
                                                   const std::vector<ImageSet>& joining,
                                                   LearningOptions options) const {
    const TrainingArchive kept(path(file));
    options.program_version = testing::small_learning().program_version;
    return bytes_of(learn(updated_sets(kept, leaving, joining), options));
  }
  [[nodiscard]] std::vector<unsigned char> updated(const std::string& file,
                                                   const std::vector<std::string>& leaving,
                                                   const std::vector<ImageSet>& joining = {}) const {
    return updated(file, leaving, joining, TrainingArchive(path(file)).options());
  }
  [[nodiscard]] std::string refusal(const std::string& file) const {
    try {
      const TrainingArchive kept(path(file));
      std::vector<std::uint8_t> pictures(kept.objects()[0].count * 32 * 32 * 3);
      std::vector<float> energies(kept.objects()[0].count);
      kept.read(0, pictures, energies);
      (void)kept.products();
    } catch (const FileError& error) {
      return error.what();
    }
    return "accepted";
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(TrainingArchiveTest, AnObjectThatJoinsGivesTheModelLearnedAnewByteForByte) {
  write("one", 1);
  write("two", 2);
  keep("kept");
  std::filesystem::remove_all(sets());
  write("fresh", 3);  // stands first in the order of names
  const auto grown = updated("kept", {}, open_image_sets(sets()));
  write("one", 1);
  write("two", 2);
  EXPECT_EQ(grown, learned_anew());
}

TEST_F(TrainingArchiveTest, WithoutAnObjectTheModelIsTheOneLearnedAnewByteForByte) {
  write("one", 1);
  write("two", 2);
  write("three", 3);
  keep("kept");
  std::filesystem::remove_all(sets());
  const auto shrunk = updated("kept", {"two"});
  write("one", 1);
  write("three", 3);
  EXPECT_EQ(shrunk, learned_anew());
}

TEST_F(TrainingArchiveTest, HoldsForImageTypesPartsAndSolversWithoutProducts) {
  LearningOptions gradient = testing::small_learning();
  set_image_type(gradient.normalization, "gradient");
  LearningOptions parts = testing::small_learning();
  parts.parts = true;
  parts.rates = {0.1, 0.25};
  LearningOptions krylov = testing::small_learning();
  krylov.solver.solver = "krylov";
  krylov.solver.components = 3;
  krylov.solver.energy = 0.9;
  for (const LearningOptions& options : {gradient, parts, krylov}) {
    std::filesystem::remove_all(sets());
    write("one", 1);
    write("two", 2);
    keep("kept", options);
    EXPECT_EQ(TrainingArchive(path("kept")).products().size() > 0, options.solver.solver != "krylov");
    const LearningOptions kept = TrainingArchive(path("kept")).options();
    EXPECT_EQ(kept.rates, options.rates);
    std::filesystem::remove_all(sets());
    write("three", 3);
    const auto changed = updated("kept", {"one"}, open_image_sets(sets()));
    write("two", 2);
    EXPECT_EQ(changed, learned_anew(options)) << options.normalization.type << options.solver.solver;
  }
}

TEST_F(TrainingArchiveTest, TheUpdateKeepsItsViewsInTurn) {
  write("one", 1);
  write("two", 2);
  keep("kept");
  std::filesystem::remove_all(sets());
  write("three", 3);
  LearningOptions options = TrainingArchive(path("kept")).options();
  options.kept_views = path("kept");
  (void)updated("kept", {"one"}, open_image_sets(sets()), options);
  std::filesystem::remove_all(sets());
  const auto last = updated("kept", {"two"});
  write("three", 3);
  EXPECT_EQ(last, learned_anew());
}

TEST_F(TrainingArchiveTest, ReadyCutViewsComeAndGoAmongOthers) {
  write("one", 1);
  ImageSetWriter writer(sets(), "cut", turntable_workspace(), nlohmann::json::object(),
                        {.cropped = true, .sync_every_view = false});
  for (int i = 0; i < 12; ++i) {
    const cv::Mat scene = testing::scene_with(2, 30.0 * i);
    writer.add(scene(cv::Rect(40, 20, 80, 80)), {30.0 * i});
  }
  writer.finish();
  LearningOptions options = testing::small_learning();
  options.parts = true;  // asks how large the regions were
  keep("both", options);
  const auto all = learned_anew(options);
  std::filesystem::rename(sets() / "one", path("one"));
  EXPECT_EQ(updated("both", {"one"}), learned_anew(options)) << "ready-cut ones are left";
  keep("cut", options);
  EXPECT_EQ(updated("cut", {}, open_image_sets(path("one"))), all) << "the others are joined";
}

TEST_F(TrainingArchiveTest, ViewsBeyondTheMemoryLimitComeAndGoToo) {
  testing::write_turn(sets(), "one", 1, 36);
  write("two", 2);
  LearningOptions options = testing::small_learning();
  // In colour, known products leave the solver less memory: its tiles are others, and round otherwise.
  options.normalization.color = false;
  options.solver.solver = "gram";
  options.solver.components = 2;
  keep("kept", options);
  std::filesystem::remove_all(sets() / "two");
  options.memory_limit = 70 * picture_length(options.normalization);  // pictures may take half: 35 of 36
  options.scratch_folder = path("");
  EXPECT_EQ(updated("kept", {"two"}, {}, options), learned_anew(options));
}

TEST_F(TrainingArchiveTest, RefusesNamesThatAreNotThereOrTaken) {
  write("one", 1);
  write("two", 2);
  keep("kept");
  const TrainingArchive kept(path("kept"));
  const auto message = [&](const std::vector<std::string>& leaving, const std::vector<ImageSet>& joining) {
    try {
      (void)updated_sets(kept, leaving, joining);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(message({"mug"}, {}), AllOf(HasSubstr("\"mug\""), HasSubstr("one, two")));
  EXPECT_THAT(message({"one"}, open_image_sets(sets())), AllOf(HasSubstr("\"two\""), HasSubstr("already")));
  EXPECT_EQ(message({"one"}, {ImageSet::open(sets() / "one")}), "accepted");
}

TEST_F(TrainingArchiveTest, RefusesAnotherNormalisation) {
  write("one", 1);
  keep("kept");
  const TrainingArchive kept(path("kept"));
  LearningOptions options = kept.options();
  options.normalization.size = 24;
  EXPECT_THROW((void)learn(updated_sets(kept, {}, {}), options), Error);
  options = kept.options();
  options.normalization.segmentation.noise_sigmas += 1.0;
  EXPECT_THROW((void)learn(updated_sets(kept, {}, {}), options), Error);
}

TEST_F(TrainingArchiveTest, RefusesOneFlippedByteAnywhereAndAFileCutOff) {
  write("one", 1);
  keep("kept");
  EXPECT_EQ(refusal("kept"), "accepted");
  const auto bytes = read_file(path("kept"));
  const auto put = [&](const std::vector<unsigned char>& changed) {
    std::ofstream(path("kept"), std::ios::binary | std::ios::trunc)
        .write(reinterpret_cast<const char*>(changed.data()), static_cast<std::streamsize>(changed.size()));
  };
  for (std::size_t i = 0; i < 200; ++i) {
    const std::size_t at = i < 100 ? 6 * i : bytes.size() * (i - 99) / 101;
    auto damaged = bytes;
    damaged[at] ^= static_cast<unsigned char>(1U << (at % 8));
    put(damaged);
    EXPECT_THAT(refusal("kept"), AnyOf(HasSubstr("damaged"), HasSubstr("no file of kept views"),
                                       HasSubstr("version"), HasSubstr("truncated")))
        << "byte " << at;
  }
  for (std::size_t i = 0; i < 20; ++i) {
    put({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(bytes.size() * i / 20)});
    EXPECT_NE(refusal("kept"), "accepted") << i;
  }
  auto other = bytes;
  const std::string text(other.begin(), other.begin() + 100);
  for (const char version : {'0', '1', '2', '7'}) {
    other[text.find("version 3") + 8] = static_cast<unsigned char>(version);
    put(other);
    EXPECT_THAT(refusal("kept"),
                AllOf(HasSubstr(std::string("version ") + version), HasSubstr("--keep-views")));
  }
  std::filesystem::remove(path("kept"));
  EXPECT_THAT(refusal("kept"), HasSubstr("no kept views"));
}

TEST_F(TrainingArchiveTest, ReplaceTheFormerOnesWhenTheModelIsSavedAndNotBefore) {
  write("one", 1);
  keep("kept");
  const auto before = read_file(path("kept"));
  write("two", 2);
  LearningOptions options = testing::small_learning();
  options.kept_views = path("kept");
  const auto images = open_image_sets(sets());
  LearningReport report;
  const Model model = learn(all_views(images), options, &report);
  EXPECT_EQ(read_file(path("kept")), before);
  ASSERT_NE(report.kept_views, nullptr);
  report.kept_views->commit();
  EXPECT_TRUE(TrainingArchive(path("kept")).belong_to(model));
  {
    LearningReport dropped;
    (void)learn(all_views(images), options, &dropped);
  }
  EXPECT_TRUE(TrainingArchive(path("kept")).belong_to(model)) << "what is not committed replaces nothing";
}

/// A model of one object with its views, and then one of two objects that replaces it, interrupted.
class InterruptedSaveTest : public TrainingArchiveTest {
 protected:
  struct Learned {
    Model model;
    std::shared_ptr<AtomicFile> views;
  };
  [[nodiscard]] Learned learn_all() const {
    LearningOptions options = testing::small_learning();
    options.kept_views = views_;
    const auto images = open_image_sets(sets());
    LearningReport report;
    Learned learned{learn(all_views(images), options, &report), nullptr};
    learned.views = std::move(report.kept_views);
    return learned;
  }
  void SetUp() override {
    write("one", 1);
    former_ = std::make_unique<Learned>(learn_all());
    save_with_views(former_->model, model_, *former_->views);
    write("two", 2);
    next_ = std::make_unique<Learned>(learn_all());
  }
  /// The names of the objects whose views are found for the model that is saved; "none" without.
  [[nodiscard]] std::vector<std::string> found() const {
    const auto kept = open_kept_views(views_, load_model(model_));
    if (kept == nullptr) return {"none"};
    std::vector<std::string> names;
    for (const ObjectViews& object : kept->objects()) names.push_back(object.object);
    return names;
  }
  std::filesystem::path model_ = path("m.model");
  std::filesystem::path views_ = path("m.model.views");
  std::filesystem::path staged_ = path("m.model.views.next");
  std::unique_ptr<Learned> former_;
  std::unique_ptr<Learned> next_;
};

TEST_F(InterruptedSaveTest, BeforeTheModelIsReplacedTheFormerViewsAreFound) {
  EXPECT_THAT(found(), ElementsAre("one"));
  next_->views->stage();
  next_.reset();
  EXPECT_TRUE(std::filesystem::exists(staged_));
  EXPECT_THAT(found(), ElementsAre("one"));
}

TEST_F(InterruptedSaveTest, AfterTheModelIsReplacedItsStagedViewsAreFound) {
  next_->views->stage();
  save_model(next_->model, model_);
  next_.reset();
  EXPECT_THAT(found(), ElementsAre("one", "two"));
  EXPECT_FALSE(TrainingArchive(views_).belong_to(load_model(model_))) << "they are the former ones yet";
}

TEST_F(InterruptedSaveTest, InTheEndTheViewsStandUnderTheirName) {
  save_with_views(next_->model, model_, *next_->views);
  EXPECT_THAT(found(), ElementsAre("one", "two"));
  EXPECT_TRUE(TrainingArchive(views_).belong_to(load_model(model_)));
  EXPECT_FALSE(std::filesystem::exists(staged_));
}

TEST_F(InterruptedSaveTest, AModelThatCannotBeSavedLeavesTheFormerOneWithItsViews) {
  {
    const test::FullDisk disk(0);
    EXPECT_THROW(save_with_views(next_->model, model_, *next_->views), FileError);
  }
  EXPECT_THAT(found(), ElementsAre("one"));
  EXPECT_FALSE(std::filesystem::exists(staged_)) << "they would fill the disk for nothing";
}

TEST_F(InterruptedSaveTest, ViewsThatCannotBeRenamedAreFoundWhereTheyWereStaged) {
  /// The rename of the staged views fails, as it does where their folder has become read-only.
  class FailingRename : public FileCalls {
   public:
    int rename(const char* from, const char* to) override {
      if (!std::string(from).ends_with(".next")) return FileCalls::rename(from, to);
      errno = EROFS;
      return -1;
    }
  };
  FailingRename calls;
  AtomicFile views(views_, calls);
  const auto bytes = read_file(next_->views->part());
  views.write({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  try {
    save_with_views(next_->model, model_, views);
    FAIL() << "renamed";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("is replaced"), HasSubstr(staged_.string())));
  }
  EXPECT_THAT(found(), ElementsAre("one", "two"));
}

TEST_F(InterruptedSaveTest, AFolderInThePlaceOfTheViewsIsRefusedBeforeAnythingIsReplaced) {
  std::filesystem::remove(views_);
  std::filesystem::create_directory(views_);
  const auto before = read_file(model_);
  EXPECT_THROW(save_with_views(next_->model, model_, *next_->views), FileError);
  EXPECT_EQ(read_file(model_), before);
}

TEST_F(InterruptedSaveTest, TheNextSaveLosesNoStagedViewsWhenItIsInterruptedToo) {
  next_->views->stage();
  save_model(next_->model, model_);
  next_.reset();  // crash: the former views under their name, these staged
  write("three", 3);
  const Learned interrupted = learn_all();
  {
    const test::FullDisk disk(0);
    EXPECT_THROW(save_with_views(interrupted.model, model_, *interrupted.views), FileError);
  }
  EXPECT_THAT(found(), ElementsAre("one", "two"));
  const Learned third = learn_all();
  save_with_views(third.model, model_, *third.views);
  EXPECT_THAT(found(), ElementsAre("one", "three", "two"));
}

TEST_F(InterruptedSaveTest, DamagedStagedViewsAreOfNoUse) {
  std::ofstream(staged_) << "half of it";
  EXPECT_THAT(found(), ElementsAre("one"));
  save_with_views(next_->model, model_, *next_->views);
  EXPECT_THAT(found(), ElementsAre("one", "two"));
}

TEST_F(InterruptedSaveTest, ViewsOfAnotherModelAreNotFound) {
  save_model(next_->model, model_);
  EXPECT_THAT(found(), ElementsAre("none"));
}

TEST_F(TrainingArchiveTest, AFullDiskIsAnErrorWhereverItFillsAndKeepsTheFormerOnes) {
  write("one", 1);
  keep("kept");
  const auto before = read_file(path("kept"));
  for (rlim_t i = 0; i < 10; ++i) {
    const test::FullDisk disk(static_cast<rlim_t>(before.size()) * i / 10);
    EXPECT_THROW(keep("kept"), FileError) << i;
  }
  EXPECT_EQ(read_file(path("kept")), before);
}

TEST_F(TrainingArchiveTest, AreNotTouchedWhereLearningFails) {
  write("one", 1);
  keep("kept");
  const auto before = read_file(path("kept"));
  write("two", 2);
  LearningOptions options = testing::small_learning();
  options.kept_views = path("kept");
  std::stop_source stop;
  const auto images = open_image_sets(sets());
  const auto stop_late = [&](const ProgressUpdate& update) {
    if (update.stage != "normalising" && update.stage != "inner products") stop.request_stop();
  };
  EXPECT_THROW((void)learn(all_views(images), options, nullptr, stop_late, stop.get_token()), Interrupted);
  EXPECT_EQ(read_file(path("kept")), before);
  for (const auto& entry : std::filesystem::directory_iterator(path("")))
    EXPECT_THAT(entry.path().filename().string(), AnyOf("kept", "sets"));
}

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
