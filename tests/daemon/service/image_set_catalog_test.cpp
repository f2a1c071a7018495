#include "daemon/service/image_set_catalog.h"

#include <atomic>
#include <fstream>
#include <system_error>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>

#include "tests/daemon/fakes.h"
#include "tests/support/synthetic_objects.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose::image_set_catalog_test {
namespace {

using ::testing::HasSubstr;

class ImageSetCatalogTest : public ::testing::Test {
 protected:
  void write(const std::string& object, int views) { testing::write_turn(folder_.path(), object, 1, views); }

  test::TemporaryFolder folder_;
  ManualClock clock_;
  Heartbeat heartbeat_{clock_};
};

TEST_F(ImageSetCatalogTest, KnowsTheSetsThatAreThereAtTheStart) {
  write("mug", 3);
  const ImageSetCatalog catalog(folder_.path(), heartbeat_);
  const std::vector<CatalogEntry> entries = catalog.entries();
  ASSERT_EQ(entries.size(), 1U);
  EXPECT_EQ(entries[0].object, "mug");
  EXPECT_EQ(entries[0].set->views().size(), 3U);
  EXPECT_TRUE(entries[0].set->complete());
}

TEST_F(ImageSetCatalogTest, AFolderThatIsNotThereHoldsNoSets) {
  ImageSetCatalog catalog(folder_.path() / "none", heartbeat_);
  EXPECT_TRUE(catalog.refresh().empty());
}

TEST_F(ImageSetCatalogTest, LooksAreCheapAndFindWhatHasComeChangedAndGone) {
  write("mug", 3);
  write("duck", 3);
  ImageSetCatalog catalog(folder_.path(), heartbeat_);
  const auto mug = catalog.look_up("mug")->set;
  write("car", 2);
  std::filesystem::remove_all(folder_.path() / "duck");
  const std::vector<CatalogEntry> entries = catalog.refresh();
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[0].object, "car");
  EXPECT_EQ(entries[1].set, mug) << "what has not changed is not read again";
  ImageSetWriter writer(folder_.path(), "new", turntable_workspace(), nlohmann::json::object());
  writer.add(cv::Mat(4, 4, CV_8UC1, cv::Scalar(1)), {0.0});
  EXPECT_EQ(catalog.look_up("new")->set->views().size(), 1U);
  writer.add(cv::Mat(4, 4, CV_8UC1, cv::Scalar(1)), {10.0});
  EXPECT_EQ(catalog.look_up("new")->set->views().size(), 2U);
  EXPECT_FALSE(catalog.look_up("new")->set->complete());
  writer.finish();
  EXPECT_TRUE(catalog.look_up("new")->set->complete());
  EXPECT_FALSE(catalog.look_up("nobody"));
}

TEST_F(ImageSetCatalogTest, ANewSetIsFoundWithoutBeingAskedFor) {
  const ImageSetCatalog catalog(folder_.path(), heartbeat_);
  write("mug", 3);
  eventually([&] { return !catalog.entries().empty() && catalog.entries()[0].set != nullptr; });
  EXPECT_EQ(catalog.entries()[0].object, "mug");
}

TEST_F(ImageSetCatalogTest, AListingThatFailsInTheThreadEndsNeitherItNorTheProgram) {
  write("mug", 3);
  std::atomic<int> listings = 0;
  const ImageSetCatalog catalog(
      folder_.path(), heartbeat_,
      [&](const std::filesystem::path&, std::error_code&) -> std::vector<std::string> {
        if (++listings == 2)
          throw std::filesystem::filesystem_error("listing", std::make_error_code(std::errc::io_error));
        return listings > 2 ? std::vector<std::string>{"duck", "mug"} : std::vector<std::string>{"mug"};
      });
  write("duck", 3);
  eventually([&] { return catalog.entries().size() == 2; });
  EXPECT_GE(listings, 3);
}

TEST_F(ImageSetCatalogTest, WhatIsKnownStaysWhereTheFolderCannotBeListed) {
  write("mug", 3);
  bool fails = false;
  ImageSetCatalog catalog(folder_.path(), heartbeat_,
                          [&](const std::filesystem::path&, std::error_code& error) {
                            if (!fails) return std::vector<std::string>{"mug"};
                            error = std::make_error_code(std::errc::io_error);
                            return std::vector<std::string>{};
                          });
  fails = true;
  ASSERT_EQ(catalog.refresh().size(), 1U);
  EXPECT_EQ(catalog.entries()[0].object, "mug");
}

/// Longer than any file system takes: looking it up fails otherwise than by its absence.
TEST_F(ImageSetCatalogTest, ASetThatCannotBeLookedUpIsUnreadableAndNotGone) {
  const std::string unfindable(300, 'x');
  ImageSetCatalog catalog(folder_.path(), heartbeat_, [&](const std::filesystem::path&, std::error_code&) {
    return std::vector<std::string>{unfindable};
  });
  ASSERT_EQ(catalog.entries().size(), 1U);
  EXPECT_EQ(catalog.entries()[0].set, nullptr);
  EXPECT_FALSE(catalog.entries()[0].error.empty());
}

TEST_F(ImageSetCatalogTest, ASetThatCannotBeReadIsKeptUnderItsFoldersNameWithTheReason) {
  write("mug", 3);
  std::filesystem::create_directory(folder_.path() / "broken");
  std::ofstream(folder_.path() / "broken" / "set.json") << "{";
  const ImageSetCatalog catalog(folder_.path(), heartbeat_);
  const std::vector<CatalogEntry> entries = catalog.entries();
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[0].object, "broken");
  EXPECT_EQ(entries[0].set, nullptr);
  EXPECT_THAT(entries[0].error, HasSubstr("set.json"));
  EXPECT_TRUE(entries[1].error.empty());
}

TEST_F(ImageSetCatalogTest, APipeInThePlaceOfAFileIsNotOpened) {
  for (const char* name : {"set.json", "views.jsonl"}) {
    const test::TemporaryFolder folder;
    testing::write_turn(folder.path(), "mug", 1, 2);
    std::filesystem::remove(folder.path() / "mug" / name);
    ASSERT_EQ(::mkfifo((folder.path() / "mug" / name).c_str(), 0600), 0);
    const ImageSetCatalog catalog(folder.path(), heartbeat_);
    ASSERT_EQ(catalog.entries().size(), 1U);
    EXPECT_THAT(catalog.entries()[0].error, HasSubstr("is not a plain file"));
  }
}

}  // namespace
}  // namespace eigenpose::image_set_catalog_test
