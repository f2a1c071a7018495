/// The path from frame to outcome takes no memory once it is warm.

#include <gtest/gtest.h>

#include "core/recognition/recognizer.h"
#include "tests/support/counted_memory.h"
#include "tests/support/learned_world.h"

namespace eigenpose {
namespace {

using testing::allocations;

/// Counts what OpenCV takes for pictures; it goes past operator new.
class CountingAllocator final : public cv::MatAllocator {
 public:
  cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, std::size_t* step,
                         cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    ++allocations;
    return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
  }
  bool allocate(cv::UMatData* data, cv::AccessFlag access, cv::UMatUsageFlags usage) const override {
    ++allocations;
    return cv::Mat::getStdAllocator()->allocate(data, access, usage);
  }
  void deallocate(cv::UMatData* data) const override { cv::Mat::getStdAllocator()->deallocate(data); }
};

/// Pictures of learned objects, with strangers among them if wanted, and of none.
std::vector<cv::Mat> table_scenes(int kinds) {
  std::vector<cv::Mat> frames;
  testing::SceneKnobs knobs;
  knobs.width = 320;
  for (int i = 0; i < 24; ++i) {
    cv::Mat scene = testing::empty_scene(knobs, i);
    knobs.x = 70.0 + i;
    testing::draw_object(scene, 1 + i % kinds, 15.0 * i, knobs);
    knobs.x = 230.0;
    if (i % 3 != 0) testing::draw_object(scene, testing::symmetric_kind, 0.0, knobs);
    frames.push_back(scene);
  }
  frames.push_back(testing::empty_scene(knobs, 99));
  return frames;
}

/// What the third pass over the pictures takes.
void expect_no_memory_taken(Recognizer& recognizer, const std::vector<cv::Mat>& frames) {
  static CountingAllocator counting;
  cv::Mat::setDefaultAllocator(&counting);
  const auto pass = [&] {
    std::size_t outcomes = 0;
    for (const cv::Mat& frame : frames) outcomes += recognizer.recognize(frame).size();
    return outcomes;
  };
  const std::size_t first = pass();
  (void)pass();
  const long before = allocations;
  const std::size_t third = pass();
  const long taken = allocations - before;
  cv::Mat::setDefaultAllocator(cv::Mat::getStdAllocator());
  EXPECT_GT(before, 0) << "memory is counted";
  EXPECT_EQ(taken, 0);
  EXPECT_EQ(first, third);
  EXPECT_GT(third, frames.size());
}

TEST(FramePath, TakesNoMemoryOnceItIsWarm) {
  Recognizer recognizer(testing::learned_world().model);
  expect_no_memory_taken(recognizer, table_scenes(5));  // three are learned, two strangers
}

TEST(FramePath, TakesNoMemoryToAlignWhatItKnows) {
  LearningOptions options = testing::small_learning();
  options.normalization.size = 64;
  options.parts = true;
  Recognizer recognizer(
      std::make_shared<const Model>(learn(all_views(testing::learned_world().sets), options)));
  expect_no_memory_taken(recognizer, table_scenes(3));
}

}  // namespace
}  // namespace eigenpose
