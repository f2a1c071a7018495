#pragma once

/// A small learned world, made once a test program: three objects that differ, one that looks the same from
/// all sides.

#include <memory>
#include <vector>

#include "core/dataset/image_set.h"
#include "core/learning/learning.h"
#include "core/model/model.h"
#include "tests/support/synthetic_objects.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose::testing {

/// Options that keep tests fast: 32×32 in colour, 12 dimensions.
inline LearningOptions small_learning() {
  LearningOptions options;
  options.normalization.size = 32;
  options.normalization.color = true;
  options.solver.components = 12;
  options.parts = false;  // the whole region alone
  options.program_version = "test";
  return options;
}

struct LearnedWorld {
  static constexpr int views = 24;  ///< 15 degrees apart

  LearnedWorld();

  test::TemporaryFolder folder;
  std::vector<ImageSet> sets;
  LearningReport report;
  std::shared_ptr<const Model> model;
};

inline LearnedWorld::LearnedWorld() {
  write_turn(folder.path(), "one", 1, views);
  write_turn(folder.path(), "two", 2, views);
  write_turn(folder.path(), "three", 3, views);
  write_turn(folder.path(), "round", symmetric_kind, views);
  sets = open_image_sets(folder.path());
  model = std::make_shared<const Model>(learn(all_views(sets), small_learning(), &report));
}

/// Objects "one", "two", "three" (kinds 1, 2, 3) and "round" (symmetric).
inline const LearnedWorld& learned_world() {
  static const LearnedWorld world;
  return world;
}

}  // namespace eigenpose::testing
