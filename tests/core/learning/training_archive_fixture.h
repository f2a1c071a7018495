#pragma once

/// Image sets, and the views of a model that are kept beside it, in a folder of their own.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/base/input_file.h"
#include "core/learning/training_archive.h"
#include "core/model/model_file.h"
#include "tests/support/learned_world.h"
#include "tests/support/temporary_folder.h"

namespace eigenpose {

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

}  // namespace eigenpose
