#include "core/learning/training_views.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <new>
#include <numeric>
#include <optional>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/dataset/view_import.h"
#include "core/image/appearance_maker.h"
#include "core/learning/learned_grid.h"
#include "core/learning/training_archive.h"

namespace eigenpose {
namespace {

/// Segmenters and normalisers hold scratch memory; views are worked on by several threads.
struct Scratch {
  explicit Scratch(const NormalizationOptions& options)
      : segmenter(options.segmentation),
        normalizer(options),
        maker(options),
        picture(normalizer.length()),
        appearance(appearance_length(options)) {}
  Segmenter segmenter;
  Normalizer normalizer;
  AppearanceMaker maker;
  std::vector<float> picture;
  std::vector<float> appearance;
  std::vector<std::uint8_t> bytes;
};

class ScratchPool {
 public:
  explicit ScratchPool(const NormalizationOptions& options) : options_(options) {}
  std::unique_ptr<Scratch> take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<Scratch>(options_);
    auto scratch = std::move(free_.back());
    free_.pop_back();
    return scratch;
  }
  void give_back(std::unique_ptr<Scratch> scratch) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(scratch));
  }

 private:
  const NormalizationOptions& options_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Scratch>> free_;  ///< guarded by mutex_
};

/// What all views of an object have in common.
struct Kind {
  Kind() = default;
  explicit Kind(const cv::Mat& image) : size(image.size()), type(image.type()) {}
  cv::Size size;
  int type = 0;
  [[nodiscard]] std::string text() const {
    return std::to_string(size.width) + "x" + std::to_string(size.height) +
           (CV_MAT_CN(type) == 3           ? " colour"
            : CV_MAT_DEPTH(type) == CV_16U ? " 16-bit grey"
                                           : " grey");
  }
  friend bool operator==(const Kind&, const Kind&) = default;
};

/// The picture as it is kept. Brightness is scaled to 8 bits; range keeps its unit.
void keep(std::span<const float> picture, bool range, std::vector<std::uint8_t>& bytes) {
  bytes.resize(picture.size() * (range ? 2 : 1));
  if (!range) {
    quantize(picture, bytes);
    return;
  }
  for (std::size_t i = 0; i < picture.size(); ++i) {
    const auto value = static_cast<std::uint16_t>(std::lround(std::min(picture[i], 65535.0F)));
    std::memcpy(bytes.data() + 2 * i, &value, 2);
  }
}

void kept_numbers(std::span<const std::uint8_t> bytes, bool range, std::span<float> numbers) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    std::uint16_t value = 0;
    if (range)
      std::memcpy(&value, bytes.data() + 2 * i, 2);
    else
      value = bytes[i];
    numbers[i] = static_cast<float>(value);
  }
}

/// A kept object as it stands in a store of these options, from view `first` on.
ObjectViews kept_object(const TrainingSet& set, const NormalizationOptions& options, std::size_t first) {
  NormalizationOptions kept = set.kept->options().normalization;
  kept.cropped = options.cropped;  // of all objects together; a picture does not depend on it
  if (kept != options)
    throw Error(set.kept->file().string() +
                ": its views are kept with another size, image type or segmentation than is asked for; learn "
                "from the image sets again");
  ObjectViews object = set.kept->objects()[set.kept_object];
  object.first = first;
  if (options.cropped) object.extents.clear();
  return object;
}

/// What was found of one view.
struct TakenView {
  std::string reason;  ///< why it cannot be used; empty where it can
  Kind kind;
  cv::Size extent;
};

/// The kind that most usable views have; of equally many, the first.
Kind usual_kind(const std::vector<TakenView>& views) {
  Kind usual;
  std::ptrdiff_t most = 0;
  for (const TakenView& view : views) {
    if (!view.reason.empty()) continue;
    const auto alike = std::count_if(views.begin(), views.end(), [&](const TakenView& other) {
      return other.reason.empty() && other.kind == view.kind;
    });
    if (alike > most) {
      most = alike;
      usual = view.kind;
    }
    if (2 * most > static_cast<std::ptrdiff_t>(views.size())) break;
  }
  return usual;
}

/// What of a message is not the name of the file that it begins with.
std::string without_file(const std::string& message, const std::filesystem::path& file) {
  const std::string prefix = file.string() + ": ";
  return message.starts_with(prefix) ? message.substr(prefix.size()) : message;
}

/// Work on one view after the other; each thread takes scratch memory of its own.
class ViewNormalizer {
 public:
  explicit ViewNormalizer(const NormalizationOptions& options) : options_(options), pool_(options) {}

  /// The picture's bytes and the energy of its appearance. @throws Error saying what is wrong with the view.
  float normalize(const ImageSet& images, std::size_t view, TakenView& taken,
                  std::vector<std::uint8_t>& bytes) {
    const cv::Mat image = images.load(view);
    taken.kind = Kind(image);
    auto scratch = pool_.take();
    normalize_learned_view(image, images.cropped(), scratch->segmenter, scratch->normalizer, scratch->picture,
                           &taken.extent);
    const bool range = is_range(options_);
    keep(scratch->picture, range, bytes);
    kept_numbers(bytes, range, scratch->picture);
    const float energy = scratch->maker.make(scratch->picture, scratch->appearance);
    pool_.give_back(std::move(scratch));
    if (!(energy > 0.0F))
      throw Error("shows nothing of image type \"" + image_type_name(options_) +
                  "\"; learn another type or remove the view");
    return energy;
  }

 private:
  const NormalizationOptions& options_;
  ScratchPool pool_;
};

}  // namespace

float normalize_learned_view(const cv::Mat& image, bool cropped, Segmenter& segmenter, Normalizer& normalizer,
                             std::span<float> picture, cv::Size* extent) {
  float energy = 0.0F;
  if (cropped) {
    energy = normalizer.normalize(image, {0, 0, 0}, picture);
  } else {
    const auto regions = segmenter.segment(image);
    if (regions.empty())
      throw Error(
          "shows nothing that stands out from the background; light the object better or remove the view");
    const auto largest = std::max_element(regions.begin(), regions.end(),
                                          [](const Region& a, const Region& b) { return a.area < b.area; });
    if (largest->touches_border)
      throw Error(
          "shows the object cut off by the border of the picture; move the camera back or the object in");
    const auto index = static_cast<std::size_t>(largest - regions.begin());
    if (extent != nullptr) *extent = largest->box.size();
    energy = normalizer.normalize(segmenter.cut_out(image, index), segmenter.background().level, picture);
  }
  if (!(energy > 0.0F)) throw Error("is black; light the object better or remove the view");
  return energy;
}

const std::string& TrainingSet::object() const {
  return kept != nullptr ? kept->objects()[kept_object].object : images->object();
}

bool TrainingSet::cropped() const {
  return kept != nullptr ? kept->objects()[kept_object].cropped : images->cropped();
}

/// The views of one set on their way into the store.
struct TrainingViews::Intake {
  const TrainingSet* set = nullptr;
  std::size_t index = 0;                    ///< of the set
  std::vector<std::size_t> chosen = {};     ///< views of an image set
  std::vector<TakenView> views = {};        ///< one a chosen view
  std::size_t first = 0;                    ///< where its views are put before it is known which can be used
  std::size_t count = 0;                    ///< number of its views
  std::optional<std::string> refused = {};  ///< why none of them can be used

  [[nodiscard]] std::filesystem::path file(std::size_t i) const {
    return set->images->folder() / set->images->views()[chosen[i]].file;
  }
  /// Why `usable` views are too few, with what is wrong with the first of the others.
  [[nodiscard]] std::string too_few(std::size_t usable) const {
    const std::size_t needed = least_views(set->images->workspace());
    std::string text = "has " + std::to_string(usable) + " view(s) of \"" + set->images->object() +
                       "\" that can be used, of " + std::to_string(chosen.size()) + "; at least " +
                       std::to_string(needed) + " are needed" +
                       (needed == 3 ? " to close a turn" : " to span a range");
    for (std::size_t i = 0; i < views.size(); ++i)
      if (!views[i].reason.empty()) return text + "; " + file(i).filename().string() + " " + views[i].reason;
    return text + ": acquire more";
  }
};

TrainingViews::TrainingViews(std::span<const TrainingSet> sets, const ViewStoreOptions& options,
                             const Progress& progress, const std::stop_token& stop)
    : options_(options.normalization), length_(appearance_length(options_)) {
  if (sets.empty()) throw Error("there is no image set to learn from; import or acquire one");
  std::vector<Intake> intakes;
  std::size_t slots = 0;
  for (const TrainingSet& set : sets) {
    Intake intake{&set, intakes.size()};
    intake.first = slots;
    if (set.kept != nullptr) {
      intake.count = kept_object(set, options_, 0).count;
    } else {
      intake.chosen = set.views;
      if (intake.chosen.empty())
        for (std::size_t i = 0; i < set.images->views().size(); ++i) intake.chosen.push_back(i);
      if (is_range(options_) && !set.images->cropped())
        intake.refused =
            "holds views that show more than the object; range is learned from ready-cut views: import them "
            "as "
            "cropped";
      intake.count = intake.refused ? 0 : intake.chosen.size();
      intake.views.resize(intake.count);
    }
    slots += intake.count;
    intakes.push_back(std::move(intake));
  }
  allocate(slots, options);
  for (const Intake& intake : intakes)
    if (intake.set->kept != nullptr) take_kept(*intake.set, intake.first);
  normalize(intakes, options, progress, stop);
  for (Intake& intake : intakes) settle(intake, options.bad_views);
  if (objects_.empty())
    throw Error("none of " + std::to_string(sets.size()) + " image set(s) can be learned from. " +
                std::find_if(left_out_.begin(), left_out_.end(), [](const LeftOut& what) {
                  return what.whole_object;
                })->text());
  const std::size_t count = objects_.back().first + objects_.back().count;
  energies_.resize(count);
  if (!on_disk_) pictures_.resize(count * picture_bytes_);
}

void TrainingViews::allocate(std::size_t views, const ViewStoreOptions& options) {
  picture_bytes_ = picture_length(options_) * (is_range(options_) ? 2 : 1);
  const std::size_t all = views * picture_bytes_;
  if (options.memory_limit > 0 && all > options.memory_limit)
    on_disk_ = std::make_unique<ScratchFile>(options.scratch_folder, all);
  else
    pictures_.resize(all);
  energies_.resize(views);
}

void TrainingViews::take_kept(const TrainingSet& set, std::size_t first) {
  const std::size_t count = set.kept->objects()[set.kept_object].count;
  std::vector<std::uint8_t> bytes(count * picture_bytes_);
  set.kept->read(set.kept_object, bytes, std::span(energies_).subspan(first, count));
  write_pictures(first, bytes);
}

void TrainingViews::normalize(std::vector<Intake>& intakes, const ViewStoreOptions& options,
                              const Progress& progress, const std::stop_token& stop) {
  std::vector<std::pair<Intake*, std::size_t>> jobs;
  for (Intake& intake : intakes)
    for (std::size_t i = 0; i < intake.views.size(); ++i) jobs.emplace_back(&intake, i);
  ViewNormalizer normalizer(options_);
  std::mutex progress_mutex;
  std::size_t done = 0;  // guarded by progress_mutex
  parallel_for(jobs.size(), options.threads, [&](std::size_t j) {
    if (stop.stop_requested()) throw Interrupted();
    const auto [intake, i] = jobs[j];
    TakenView& taken = intake->views[i];
    std::vector<std::uint8_t> bytes;
    try {
      energies_[intake->first + i] =
          normalizer.normalize(*intake->set->images, intake->chosen[i], taken, bytes);
    } catch (const std::bad_alloc&) {
      throw;  // says nothing of the view
    } catch (const std::exception& trouble) {
      taken.reason = without_file(trouble.what(), intake->file(i));
    }
    if (taken.reason.empty())
      write_pictures(intake->first + i, bytes);
    else if (options.bad_views == BadViews::refuse)
      throw FileError(intake->file(i), taken.reason);
    const std::lock_guard lock(progress_mutex);
    if (progress) progress({"normalising", ++done, jobs.size()});
  });
}

void TrainingViews::leave_out(LeftOut what, BadViews bad_views) {
  if (bad_views == BadViews::refuse) throw FileError(what.file, what.reason);
  left_out_.push_back(std::move(what));
}

void TrainingViews::settle(Intake& intake, BadViews bad_views) {
  const std::size_t place = objects_.empty() ? 0 : objects_.back().first + objects_.back().count;
  std::vector<std::size_t> order(intake.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (intake.set->kept != nullptr) {
    objects_.push_back(kept_object(*intake.set, options_, place));
    set_of_object_.push_back(intake.index);
    move_views(intake, order, place);
    return;
  }
  const ImageSet& images = *intake.set->images;
  const Kind usual = usual_kind(intake.views);
  std::vector<std::size_t> usable;
  std::vector<std::vector<double>> poses;
  for (std::size_t i = 0; i < intake.views.size(); ++i) {
    TakenView& view = intake.views[i];
    if (view.reason.empty() && view.kind != usual)
      view.reason = "is " + view.kind.text() + ", most views of \"" + images.object() + "\" are " +
                    usual.text() + "; all views of an object must be alike: acquire it again";
    if (!view.reason.empty()) {
      leave_out({images.object(), intake.file(i), false, view.reason}, bad_views);
      continue;
    }
    usable.push_back(i);
    poses.push_back(images.views()[intake.chosen[i]].q);
  }
  if (!intake.refused && usable.size() < least_views(images.workspace()))
    intake.refused = intake.too_few(usable.size());
  LearnedGrid grid;
  if (!intake.refused) try {
      grid = find_learned_grid(images.workspace(), poses, images.object());
    } catch (const Error& wrong) {
      intake.refused = wrong.what();
    }
  if (intake.refused) {
    leave_out({images.object(), images.folder(), true, *intake.refused}, bad_views);
    return;
  }
  for (const DoubledView& doubled : grid.doubled)
    leave_out({images.object(), intake.file(usable[doubled.view]), false,
               "has the pose of " + intake.file(usable[doubled.same_as]).filename().string() + " (" +
                   pose_text(images.workspace(), poses[doubled.view]) + "); remove one of them"},
              bad_views);
  ObjectViews object{
      images.object(),  images.workspace(),   std::move(grid.axes), place, grid.order.size(), {},
      images.cropped(), std::move(grid.poses)};
  order.clear();
  for (const std::size_t i : grid.order) {
    order.push_back(usable[i]);
    if (!options_.cropped) object.extents.push_back(intake.views[usable[i]].extent);
  }
  objects_.push_back(std::move(object));
  set_of_object_.push_back(intake.index);
  move_views(intake, order, place);
}

/// Puts views intake.first + order[i] to first + i. Never upwards: those of later sets stay.
void TrainingViews::move_views(const Intake& intake, std::span<const std::size_t> order, std::size_t first) {
  if (intake.first == first && std::is_sorted(order.begin(), order.end()) &&
      (order.empty() || order.back() + 1 == order.size()))
    return;
  std::vector<std::uint8_t> bytes(order.size() * picture_bytes_);
  std::vector<float> energies;
  energies.reserve(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    read_pictures(intake.first + order[i], std::span(bytes).subspan(i * picture_bytes_, picture_bytes_));
    energies.push_back(energies_[intake.first + order[i]]);
  }
  write_pictures(first, bytes);
  std::copy(energies.begin(), energies.end(), energies_.begin() + static_cast<std::ptrdiff_t>(first));
}

TrainingViews::~TrainingViews() = default;

AppearanceShape TrainingViews::shape() const {
  const auto size = static_cast<std::size_t>(options_.size);
  return {size, size, static_cast<std::size_t>(appearance_bands(options_))};
}

std::vector<std::size_t> TrainingViews::groups() const {
  std::vector<std::size_t> sizes;
  for (const ObjectViews& object : objects_) sizes.push_back(object.count);
  return sizes;
}

bool TrainingViews::has_bytes() const {
  return appearance_is_picture(options_);
}

const std::uint8_t* TrainingViews::resident_bytes() const {
  return has_bytes() && !on_disk_ ? pictures_.data() : nullptr;
}

void TrainingViews::read_pictures(std::size_t first, std::span<std::uint8_t> bytes) const {
  if (on_disk_)
    on_disk_->read(first * picture_bytes_, bytes);
  else
    std::memcpy(bytes.data(), pictures_.data() + first * picture_bytes_, bytes.size());
}

void TrainingViews::write_pictures(std::size_t first, std::span<const std::uint8_t> bytes) {
  if (on_disk_)
    on_disk_->write(first * picture_bytes_, bytes);
  else
    std::memcpy(pictures_.data() + first * picture_bytes_, bytes.data(), bytes.size());
}

void TrainingViews::read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const {
  AppearanceMaker maker(options_);
  const bool range = is_range(options_);
  std::vector<std::uint8_t> bytes(picture_bytes_);
  std::vector<float> picture(picture_length(options_));
  for (Eigen::Index c = 0; c < tile.cols(); ++c) {
    const std::size_t i = first + static_cast<std::size_t>(c);
    read_pictures(i, bytes);
    kept_numbers(bytes, range, picture);
    auto column = tile.col(c);
    maker.make(picture, {column.data(), length_});
    column /= energies_[i];
  }
}

void TrainingViews::read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const {
  read_pictures(first, {tile, n * picture_bytes_});
}

cv::Mat TrainingViews::picture(std::size_t i) const {
  const int type = is_range(options_) ? CV_16UC1 : CV_8UC(picture_bands(options_));
  cv::Mat picture(options_.size, options_.size, type);
  read_pictures(i, {picture.ptr<std::uint8_t>(), picture_bytes_});
  return picture;
}

std::vector<std::uint8_t> TrainingViews::pictures(std::size_t first, std::size_t n) const {
  std::vector<std::uint8_t> bytes(n * picture_bytes_);
  read_pictures(first, bytes);
  return bytes;
}

void picture_numbers(const cv::Mat& picture, std::span<float> numbers) {
  const std::size_t n = numbers.size();
  kept_numbers({picture.ptr<std::uint8_t>(), n * picture.elemSize1()}, picture.depth() == CV_16U, numbers);
}

}  // namespace eigenpose
