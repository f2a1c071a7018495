#pragma once

/// Three objects with windows, learned from scenes by a camera that stands still; made once a test program.

#include <memory>
#include <vector>

#include "tests/support/learned_world.h"

namespace eigenpose::testing {

struct PartsWorld {
  PartsWorld() {
    write_turn(folder.path(), "one", 1, 36, knobs());
    write_turn(folder.path(), "two", 2, 36, knobs());
    write_turn(folder.path(), "three", 3, 36, knobs());
    sets = open_image_sets(folder.path());
    model = std::make_shared<const Model>(learn(all_views(sets), options(), &report));
  }
  static LearningOptions options() {
    LearningOptions options = small_learning();
    options.normalization.size = 64;
    options.parts = true;
    return options;
  }
  static SceneKnobs knobs() {
    SceneKnobs knobs = SceneKnobs::centred(400, 300, 1.6);
    knobs.x = 130.0;  // there is room for another beside it
    return knobs;
  }
  /// Index of an object in the model.
  [[nodiscard]] std::size_t index_of(const std::string& name) const {
    std::size_t o = 0;
    while (model->objects[o].name != name) ++o;
    return o;
  }
  /// A copy of the model, with `change` applied to what it knows of windows.
  template <typename Change>
  [[nodiscard]] std::shared_ptr<const Model> changed(const Change& change) const {
    auto copy = std::make_shared<Model>(*model);
    auto parts = std::make_shared<PartsModel>(*model->parts);
    change(*parts);
    copy->parts = parts;
    return copy;
  }

  /// The same of what decides.
  template <typename Change>
  [[nodiscard]] std::shared_ptr<const Model> deciding(const Change& change) const {
    auto copy = std::make_shared<Model>(*model);
    change(copy->decision);
    return copy;
  }

  test::TemporaryFolder folder;
  std::vector<ImageSet> sets;
  LearningReport report;
  std::shared_ptr<const Model> model;
};

/// Objects "one", "three", "two" (kinds 1, 3, 2), in this order.
inline const PartsWorld& parts_world() {
  static const PartsWorld made;
  return made;
}

}  // namespace eigenpose::testing
