#include "core/model/hdf5_output.h"

#include <array>
#include <cerrno>
#include <cstdint>

#include <gmock/gmock.h>

#include "core/base/error.h"
#include "core/base/input_file.h"
#include "core/model/hdf5_links.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Lets the write number `failing` (from 0) and all later ones fail; −1: none.
class FailingWrites : public FileCalls {
 public:
  ssize_t pwrite(int fd, const void* bytes, std::size_t count, off_t at) override {
    if (writes++ >= failing && failing >= 0) {
      errno = ENOSPC;
      return -1;
    }
    return FileCalls::pwrite(fd, bytes, count, at);
  }
  int ftruncate(int fd, off_t size) override {
    if (truncate_fails) {
      errno = EIO;
      return -1;
    }
    return FileCalls::ftruncate(fd, size);
  }
  int failing = -1;
  int writes = 0;
  bool truncate_fails = false;
};

/// Groups, attributes and datasets enough that the library writes often and reads back what it wrote.
void fill(const Hdf5Group& root) {
  for (std::size_t i = 0; i < 40; ++i) {
    const Hdf5Group group = root.make_group(numbered(i));
    group.write("number", static_cast<std::int64_t>(i));
    group.write("text", std::string(500, 'x'));
    group.write("matrix", Eigen::MatrixXd(Eigen::MatrixXd::Constant(30, 10, static_cast<double>(i))));
  }
}

class Hdf5Output : public ::testing::Test {
 protected:
  test::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "a.h5";
};

TEST_F(Hdf5Output, WritesWhatTheLibraryReadsAndLeavesTheUserBlock) {
  for (const std::uint64_t user_block : {0U, 512U}) {
    AtomicFile file(path_);
    write_hdf5(file, user_block, fill);
    if (user_block > 0) file.write_at(0, "mine");
    file.commit();
    EXPECT_EQ(read_file(path_)[0], user_block > 0 ? 'm' : 0x89);
    const Hdf5Lock lock;
    const Hdf5Handle open = open_hdf5(path_);
    const Hdf5Group root = root_of(open);
    EXPECT_EQ(root.group_names().size(), 40U);
    EXPECT_EQ(root.open_group(numbered(39)).read_integer("number", 0, 99), 39);
    EXPECT_EQ(root.open_group(numbered(7)).read_doubles("matrix"), Eigen::MatrixXd::Constant(30, 10, 7.0));
  }
}

// That the program ends well after this shows that the library holds no file that it cannot close.
TEST_F(Hdf5Output, EveryWriteThatFailsIsAnError) {
  FailingWrites counting;
  {
    AtomicFile file(path_, counting);
    write_hdf5(file, 0, fill);
  }
  ASSERT_GT(counting.writes, 40);
  for (int failing = 0; failing < counting.writes; ++failing) {
    FailingWrites calls;
    calls.failing = failing;
    AtomicFile file(path_, calls);
    EXPECT_THAT([&] { write_hdf5(file, 0, fill); },
                ThrowsMessage<FileError>(HasSubstr("a.h5: cannot be written: the disk is full")))
        << failing;
  }
  FailingWrites calls;
  calls.truncate_fails = true;
  AtomicFile file(path_, calls);
  EXPECT_THROW(write_hdf5(file, 0, [](const Hdf5Group& root) { root.write("a", std::int64_t{1}); }),
               FileError);
}

TEST_F(Hdf5Output, PassesOnWhatItsContentThrows) {
  AtomicFile file(path_);
  EXPECT_THROW(write_hdf5(file, 0, [](const Hdf5Group&) { throw Interrupted(); }), Interrupted);
  EXPECT_THAT([&] { write_hdf5(file, 0, [](const Hdf5Group& root) { (void)root.open_group("none"); }); },
              ThrowsMessage<FileError>(HasSubstr("a.h5: has no group \"none\"")));
}

TEST_F(Hdf5Output, IntegersAreReadWithinBounds) {
  AtomicFile file(path_);
  write_hdf5(file, 0, [](const Hdf5Group& root) { root.write("count", std::int64_t{1} << 40); });
  file.commit();
  const Hdf5Lock lock;
  const Hdf5Handle open = open_hdf5(path_);
  const Hdf5Group root = root_of(open);
  EXPECT_EQ(root.read_integer("count", 0, std::int64_t{1} << 40), std::int64_t{1} << 40);
  EXPECT_THAT([&] { (void)root.read_integer("count", 0, 7); },
              ThrowsMessage<Hdf5Failure>(HasSubstr("has \"count\" of 1099511627776; allowed are 0 to 7")));
  EXPECT_THROW((void)root.read_integer("count", (std::int64_t{1} << 40) + 1, std::int64_t{1} << 50),
               Hdf5Failure);
}

TEST_F(Hdf5Output, RefusesAnAttributeOfSeveralValuesWhereOneIsAskedFor) {
  AtomicFile file(path_);
  write_hdf5(file, 0, [](const Hdf5Group& root) {
    const std::array<double, 64> values{};
    const hsize_t count = values.size();
    const Hdf5Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose, "space");
    for (const char* name : {"number", "count"}) {
      const Hdf5Handle attribute(
          H5Acreate2(root.id(), name, H5T_IEEE_F64LE, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
          "attribute");
      ASSERT_GE(H5Awrite(attribute.get(), H5T_NATIVE_DOUBLE, values.data()), 0);
    }
  });
  file.commit();
  const Hdf5Lock lock;
  const Hdf5Handle open = open_hdf5(path_);
  const Hdf5Group root = root_of(open);
  EXPECT_THAT([&] { (void)root.read_double("number"); },
              ThrowsMessage<Hdf5Failure>(HasSubstr("no attribute \"number\" of the right kind")));
  EXPECT_THROW((void)root.read_integer("count", 0, 9), Hdf5Failure);
}

TEST_F(Hdf5Output, KeepsEveryOptionOfNormalization) {
  NormalizationOptions options;
  options.size = 40;
  options.color = false;
  options.type = "gradient";
  options.cropped = true;
  options.segmentation = {17, 2.5, 7, 0.004};
  AtomicFile file(path_);
  write_hdf5(file, 0, [&](const Hdf5Group& root) {
    write_normalization(root.make_group("other"), options);
    write_normalization(root.make_group("default"), {});
  });
  file.commit();
  const Hdf5Lock lock;
  const Hdf5Handle open = open_hdf5(path_);
  EXPECT_EQ(read_normalization(root_of(open).open_group("other")), options);
  EXPECT_EQ(read_normalization(root_of(open).open_group("default")), NormalizationOptions{});
}

TEST_F(Hdf5Output, RefusesADatasetThatClaimsMoreThanTheFileHolds) {
  AtomicFile file(path_);
  write_hdf5(file, 0, [](const Hdf5Group& root) {
    const std::array<hsize_t, 2> shape{1U << 20, 1U << 10};  // 8 GiB of the fill value, never allocated
    const Hdf5Handle space(H5Screate_simple(2, shape.data(), nullptr), H5Sclose, "space");
    const Hdf5Handle data(
        H5Dcreate2(root.id(), "huge", H5T_IEEE_F64LE, space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
        H5Dclose, "data");
  });
  file.commit();
  const Hdf5Lock lock;
  const Hdf5Handle open = open_hdf5(path_);
  EXPECT_THROW((void)root_of(open).read_doubles("huge"), Hdf5Failure);
}

}  // namespace
}  // namespace eigenpose
