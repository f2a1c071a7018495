#include <cerrno>
#include <fstream>

#include <gmock/gmock.h>

#include "core/base/error.h"
#include "core/learning/training_archive.h"
#include "core/model/model_file.h"
#include "tests/core/learning/training_archive_fixture.h"
#include "tests/support/full_disk.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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

}  // namespace
}  // namespace eigenpose
