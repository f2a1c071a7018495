#include "core/learning/training_archive.h"

#include <algorithm>
#include <new>
#include <optional>
#include <stdexcept>
#include <utility>

#include "core/base/error.h"
#include "core/base/printable.h"
#include "core/dataset/natural_order.h"
#include "core/learning/calibration/decision_calibration.h"
#include "core/learning/calibration_file.h"
#include "core/model/hdf5_file.h"
#include "core/model/hdf5_links.h"
#include "core/model/hdf5_output.h"
#include "core/model/model_file.h"
#include "core/model/sealed_file.h"

namespace eigenpose {
namespace {

constexpr SealedFormat views_format{"eigenpose views\n", 3,
                                    "is no file of kept views; 'eigenpose learn --keep-views' makes them",
                                    "learn the model again from its image sets, with --keep-views"};

void write_options(const Hdf5Group& group, const LearningOptions& options) {
  group.write("solver", options.solver.solver);
  group.write("components", static_cast<std::int64_t>(options.solver.components));
  group.write("energy", options.solver.energy.value_or(0.0));
  group.write("spline_degree", std::int64_t{options.spline_degree});
  group.write("object_spaces", std::int64_t{options.object_spaces});
  group.write("parts", std::int64_t{options.parts});
  group.write("false_rejection", options.rates.false_rejection);
  group.write("false_acceptance", options.rates.false_acceptance);
  group.write("image_sets", options.image_sets);
  write_normalization(group.make_group("normalization"), options.normalization);
}

LearningOptions read_options(const Hdf5Group& group) {
  LearningOptions options;
  options.solver.solver = group.read_text("solver");
  options.solver.components = static_cast<std::size_t>(group.read_integer("components", 0, 1 << 20));
  if (const double energy = group.read_double("energy"); energy > 0.0) options.solver.energy = energy;
  options.spline_degree = static_cast<int>(group.read_integer("spline_degree", 1, 3));
  options.object_spaces = group.read_bool("object_spaces");
  options.parts = group.read_bool("parts");
  options.rates = {group.read_double("false_rejection"), group.read_double("false_acceptance")};
  check_rates(options.rates);
  options.image_sets = group.read_text("image_sets");
  options.normalization = read_normalization(group.open_group("normalization"));
  return options;
}

void write_object(const Hdf5Group& group, const TrainingViews& views, const ObjectViews& object) {
  group.write("name", object.object);
  group.write("cropped", std::int64_t{object.cropped});
  group.write("pictures", std::span<const std::uint8_t>(views.pictures(object.first, object.count)));
  Eigen::MatrixXf energies(1, static_cast<Eigen::Index>(object.count));
  Eigen::MatrixXd extents = Eigen::MatrixXd::Zero(2, energies.cols());
  for (std::size_t i = 0; i < object.count; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    energies(0, column) = views.energy(object.first + i);
    if (!object.cropped) extents.col(column) << object.extents[i].width, object.extents[i].height;
  }
  group.write("energies", energies);
  group.write("extents", extents);
  if (object.poses.size() > 0) group.write("poses", object.poses);
  const Hdf5Group axes = group.make_group("axes");
  for (std::size_t a = 0; a < object.axes.size(); ++a)
    write_axis(axes.make_group(numbered(a)), object.axes[a]);
}

void write_errors(const Hdf5Group& object, const std::vector<double>& errors) {
  if (errors.empty()) return;
  const auto count = static_cast<Eigen::Index>(errors.size());
  object.write("left_out_errors",
               Eigen::MatrixXd(Eigen::Map<const Eigen::MatrixXd>(errors.data(), 1, count)));
}

/// Everything but pictures and energies.
ObjectViews read_object(const Hdf5Group& group, std::size_t first) {
  ObjectViews object;
  object.object = group.read_text("name");
  check_object_name(object.object);
  object.cropped = group.read_bool("cropped");
  object.first = first;
  object.count = 1;
  std::vector<Dof> dofs;
  const Hdf5Group axes = group.open_group("axes");
  for (const std::string& name : axes.group_names()) {
    object.axes.push_back(read_axis(axes.open_group(name)));
    object.count *= object.axes.back().samples.size();
    dofs.push_back(object.axes.back().dof);
  }
  object.workspace = Workspace(std::move(dofs));
  if (group.has("poses")) {
    object.poses = group.read_doubles("poses");
    object.count = static_cast<std::size_t>(object.poses.cols());
    if (object.poses.rows() != static_cast<Eigen::Index>(object.workspace.size()) ||
        !object.poses.allFinite())
      throw Hdf5Failure("has objects whose parts do not fit together");
  }
  const Eigen::MatrixXd extents = group.read_doubles("extents");
  if (object.count == 0 || extents.rows() != 2 || static_cast<std::size_t>(extents.cols()) != object.count)
    throw Hdf5Failure("has objects whose parts do not fit together");
  if (!(extents.minCoeff() >= 0.0) || !(extents.maxCoeff() <= 1e5))
    throw Hdf5Failure("has views of sizes that cannot be");
  for (Eigen::Index i = 0; i < extents.cols(); ++i)
    object.extents.emplace_back(static_cast<int>(extents(0, i)), static_cast<int>(extents(1, i)));
  return object;
}

/// Calls `work` with the library to itself; what fails there is the file's fault.
template <typename Work>
auto with_hdf5(const std::filesystem::path& file, const Work& work) {
  const auto refuse = [&](const char* what) {
    return FileError(file, std::string(what) + "; " + std::string(views_format.remedy));
  };
  try {
    const Hdf5Lock lock;
    return work();
  } catch (const Hdf5Failure& failure) {
    throw refuse(failure.what());
  } catch (const std::logic_error& failure) {
    throw refuse(failure.what());
  } catch (const std::bad_alloc&) {
    throw refuse("needs more memory than there is");
  }
}

ConfigError not_there(const TrainingArchive& kept, const std::string& name) {
  std::string text = "there is no object \"" + name + "\" to remove; there are:";
  for (const ObjectViews& object : kept.objects()) {
    text += object.first == 0 ? " " : ", ";
    text += object.object;
  }
  return ConfigError(text);
}

std::filesystem::path checked(std::filesystem::path file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error) && !error)
    throw FileError(file, "there are no kept views; " + std::string(views_format.remedy));
  check_seal(views_format, file);
  return file;
}

}  // namespace

/// The open file. To be made, used and destroyed under an Hdf5Lock.
struct TrainingArchive::File {
  explicit File(const std::filesystem::path& path) : handle(open_hdf5(path)), root(root_of(handle)) {}
  Hdf5Handle handle;
  Hdf5Group root;
};

TrainingArchive::TrainingArchive(std::filesystem::path file) : file_(checked(std::move(file))) {
  with_hdf5(file_, [&] {
    // Closed in here where something in it is refused: under the lock.
    auto open = std::make_unique<File>(file_);
    created_ = open->root.read_text("created");
    options_ = read_options(open->root.open_group("options"));
    const Hdf5Group objects = open->root.open_group("objects");
    std::size_t first = 0;
    for (const std::string& name : objects.group_names()) {
      objects_.push_back(read_object(objects.open_group(name), first));
      first += objects_.back().count;
    }
    open_ = std::move(open);
  });
}

TrainingArchive::~TrainingArchive() {
  const Hdf5Lock lock;
  open_.reset();
}

bool TrainingArchive::belong_to(const Model& model) const {
  return created_ == model.provenance.created &&
         std::equal(objects_.begin(), objects_.end(), model.objects.begin(), model.objects.end(),
                    [](const ObjectViews& views, const ModelObject& object) {
                      return views.object == object.name && views.count == object.views;
                    });
}

void TrainingArchive::read(std::size_t o, std::span<std::uint8_t> pictures, std::span<float> energies) const {
  with_hdf5(file_, [&] {
    const Hdf5Group object = open_->root.open_group("objects").open_group(numbered(o));
    object.read_bytes("pictures", pictures);
    const Eigen::MatrixXf read = object.read_floats("energies");
    if (read.rows() != 1 || static_cast<std::size_t>(read.cols()) != energies.size())
      throw Hdf5Failure("has objects whose parts do not fit together");
    if (!(read.minCoeff() >= 0.0F) || !read.allFinite())
      throw Hdf5Failure("has views of energies that cannot be");
    std::copy_n(read.data(), energies.size(), energies.data());
  });
}

Eigen::MatrixXd TrainingArchive::products() const {
  return with_hdf5(file_, [&] {
    if (!open_->root.has("products")) return Eigen::MatrixXd();
    Eigen::MatrixXd products = open_->root.read_doubles("products");
    if (!products.allFinite()) throw Hdf5Failure("has products that are not finite");
    const auto count = objects_.empty() ? 0 : objects_.back().first + objects_.back().count;
    if (products.rows() != products.cols() || static_cast<std::size_t>(products.rows()) != count)
      throw Hdf5Failure("has products that do not fit its views");
    return products;
  });
}

std::vector<double> TrainingArchive::left_out_errors(std::size_t o) const {
  return with_hdf5(file_, [&] {
    const Hdf5Group object = open_->root.open_group("objects").open_group(numbered(o));
    if (!object.has("left_out_errors")) return std::vector<double>();
    const Eigen::MatrixXd errors = object.read_doubles("left_out_errors");
    if (errors.size() != static_cast<Eigen::Index>(objects_[o].count) || !errors.allFinite())
      throw Hdf5Failure("has objects whose parts do not fit together");
    return std::vector<double>(errors.data(), errors.data() + errors.size());
  });
}

CalibrationRecord TrainingArchive::calibration() const {
  return with_hdf5(file_, [&] { return read_calibration(open_->root, objects_); });
}

TrainingArchiveWriter::TrainingArchiveWriter(const std::filesystem::path& file, const TrainingViews& views,
                                             const LearningOptions& options, std::string created)
    : file_(std::make_unique<AtomicFile>(file)),
      views_(views),
      options_(options),
      created_(std::move(created)) {}

void TrainingArchiveWriter::keep(const Eigen::MatrixXd& products) {
  products_ = products.rows();
  const auto bytes = sizeof(double) * static_cast<std::size_t>(products.size());
  put_aside_ = std::make_unique<ScratchFile>(options_.scratch_folder, bytes);
  put_aside_->write(0, {reinterpret_cast<const std::uint8_t*>(products.data()), bytes});
}

std::unique_ptr<AtomicFile> TrainingArchiveWriter::finish(const CalibrationRecord& calibration,
                                                          const PartsModel* parts) {
  write_hdf5(*file_, seal_size, [&](const Hdf5Group& root) {
    root.write("created", created_);
    write_options(root.make_group("options"), options_);
    const Hdf5Group objects = root.make_group("objects");
    for (std::size_t o = 0; o < views_.objects().size(); ++o) {
      const Hdf5Group object = objects.make_group(numbered(o));
      write_object(object, views_, views_.objects()[o]);
      if (parts != nullptr) write_errors(object, parts->poses[o].left_out_errors());
    }
    if (!calibration.objects.empty()) write_calibration(root, calibration);
    if (!put_aside_) return;
    Eigen::MatrixXd products(products_, products_);
    put_aside_->read(0, {reinterpret_cast<std::uint8_t*>(products.data()),
                         sizeof(double) * static_cast<std::size_t>(products.size())});
    root.write("products", products);
  });
  seal_file(views_format, *file_);
  file_->prepare([](const std::filesystem::path& part) { const TrainingArchive readable(part); });
  return std::move(file_);
}

namespace {

/// The views that an interrupted `save_with_views` left staged, where they are those of the model; else null.
std::unique_ptr<TrainingArchive> staged_views(const std::filesystem::path& file, const Model& model) {
  const std::filesystem::path staged = AtomicFile::staged_name(file);
  std::error_code error;
  if (!std::filesystem::exists(staged, error)) return nullptr;
  try {
    auto views = std::make_unique<TrainingArchive>(staged);
    if (views->belong_to(model)) return views;
  } catch (const FileError&) {  // damaged, or of another version: of no use
  }
  return nullptr;
}

/// The model in the file, where there is one that can be read.
std::optional<Model> saved_model(const std::filesystem::path& file) {
  try {
    return load_model(file);
  } catch (const FileError&) {
    return std::nullopt;
  }
}

/// Puts staged views that belong to the saved model in their place, before others are staged.
void finish_interrupted_save(const std::filesystem::path& model_file, const std::filesystem::path& views) {
  std::error_code error;
  const std::filesystem::path staged = AtomicFile::staged_name(views);
  if (!std::filesystem::exists(staged, error)) return;
  const std::optional<Model> saved = saved_model(model_file);
  if (!saved || !staged_views(views, *saved)) return;
  std::filesystem::rename(staged, views, error);
  if (error) throw FileError(views, "cannot be replaced: " + error.message());
}

}  // namespace

void save_with_views(const Model& model, const std::filesystem::path& model_file, AtomicFile& views) {
  finish_interrupted_save(model_file, views.target());
  views.stage();
  try {
    save_model(model, model_file);
  } catch (...) {
    // It may have been replaced all the same: where only its folder could not be flushed.
    const std::optional<Model> saved = saved_model(model_file);
    std::error_code ignored;
    if (!saved || !staged_views(views.target(), *saved)) std::filesystem::remove(views.part(), ignored);
    throw;
  }
  try {
    views.commit();
  } catch (const FileError& error) {
    throw FileError(model_file, std::string("is replaced, but its views stand in ") +
                                    printable(views.part().string()) +
                                    ", where an update finds them: " + error.what());
  }
}

std::unique_ptr<TrainingArchive> open_kept_views(const std::filesystem::path& file, const Model& model) {
  if (auto staged = staged_views(file, model)) return staged;
  auto kept = std::make_unique<TrainingArchive>(file);
  if (kept->belong_to(model)) return kept;
  return nullptr;
}

std::vector<TrainingSet> updated_sets(const TrainingArchive& kept, std::span<const std::string> leaving,
                                      std::span<const ImageSet> joining) {
  for (const std::string& name : leaving)
    if (std::none_of(kept.objects().begin(), kept.objects().end(),
                     [&](const ObjectViews& object) { return object.object == name; }))
      throw not_there(kept, name);
  std::vector<TrainingSet> sets;
  for (std::size_t o = 0; o < kept.objects().size(); ++o)
    if (std::find(leaving.begin(), leaving.end(), kept.objects()[o].object) == leaving.end())
      sets.push_back({nullptr, {}, &kept, o});
  const std::size_t staying = sets.size();
  for (const ImageSet& set : joining) {
    const auto end = sets.begin() + static_cast<std::ptrdiff_t>(staying);
    if (std::any_of(sets.begin(), end, [&](const TrainingSet& s) { return s.object() == set.object(); }))
      throw ConfigError("object \"" + set.object() + "\" is learned already; remove it to learn it anew");
    sets.push_back({&set, {}});
  }
  std::stable_sort(sets.begin(), sets.end(), [](const TrainingSet& a, const TrainingSet& b) {
    return NaturalLess()(a.object(), b.object());
  });
  return sets;
}

namespace {

/// The first of the sets whose views are kept, or none.
const TrainingArchive* archive_of(std::span<const TrainingSet> sets) {
  const auto first = std::ranges::find_if(sets, [](const TrainingSet& s) { return s.kept != nullptr; });
  return first == sets.end() ? nullptr : first->kept;
}

}  // namespace

KnownProducts known_products(std::span<const TrainingSet> sets, const TrainingViews& views) {
  KnownProducts known;
  const TrainingArchive* kept = archive_of(sets);
  if (kept == nullptr) return known;
  known.products = kept->products();
  if (known.products.size() == 0) return known;
  for (std::size_t o = 0; o < views.objects().size(); ++o) {
    const TrainingSet& set = sets[views.sets()[o]];
    for (std::size_t i = 0; i < views.objects()[o].count; ++i)
      known.rows.push_back(
          set.kept == kept ? static_cast<Eigen::Index>(kept->objects()[set.kept_object].first + i) : -1);
  }
  return known;
}

CalibrationRecord known_calibration(std::span<const TrainingSet> sets, const TrainingViews& views) {
  const TrainingArchive* kept = archive_of(sets);
  if (kept == nullptr) return {};
  std::vector<std::optional<std::size_t>> places(kept->objects().size());
  for (std::size_t o = 0; o < views.objects().size(); ++o) {
    const TrainingSet& set = sets[views.sets()[o]];
    if (set.kept == kept) places[set.kept_object] = o;
  }
  return carry_over(kept->calibration(), places, views.objects().size());
}

}  // namespace eigenpose
