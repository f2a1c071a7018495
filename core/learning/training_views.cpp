#include "core/learning/training_views.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <mutex>
#include <optional>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/image/appearance_maker.h"
#include "core/learning/learned_grid.h"
#include "core/learning/training_archive.h"

namespace eigenpose {
namespace {

/// One view to be read: where from, and where to in the store.
struct Job {
  const ImageSet* images = nullptr;
  std::size_t view = 0;
  std::size_t object = 0;
  std::size_t place = 0;
};

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
  explicit Kind(const cv::Mat& image) : size(image.size()), type(image.type()) {}
  cv::Size size;
  int type;
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

TrainingViews::TrainingViews(std::span<const TrainingSet> sets, const ViewStoreOptions& options,
                             const Progress& progress, std::stop_token stop)
    : options_(options.normalization), length_(appearance_length(options_)) {
  if (sets.empty()) throw Error("there is no image set to learn from; import or acquire one");
  const bool range = is_range(options_);
  picture_bytes_ = picture_length(options_) * (range ? 2 : 1);
  std::size_t count = 0;
  std::vector<Job> jobs;
  std::vector<std::optional<Kind>> kinds(sets.size());
  for (const TrainingSet& set : sets) {
    if (set.kept != nullptr) {
      objects_.push_back(kept_object(set, options_, count));
      count += objects_.back().count;
      continue;
    }
    const auto& views = set.images->views();
    if (range && !set.images->cropped())
      throw FileError(
          set.images->folder(),
          "holds views that show more than the object; range is learned from ready-cut views: import them "
          "with --views cropped");
    std::vector<std::size_t> chosen = set.views;
    if (chosen.empty())
      for (std::size_t i = 0; i < views.size(); ++i) chosen.push_back(i);
    if (chosen.size() < 2)
      throw FileError(set.images->folder(),
                      "has " + std::to_string(chosen.size()) + " view(s) of \"" + set.images->object() +
                          "\" to learn from; at least 3 around a turn are " + "needed: acquire more");
    std::vector<std::vector<double>> poses;
    poses.reserve(chosen.size());
    for (const std::size_t i : chosen) poses.push_back(views.at(i).q);
    LearnedGrid grid = find_learned_grid(set.images->workspace(), poses, set.images->object());
    const std::size_t object = objects_.size();
    kinds[object].emplace(set.images->load(chosen[grid.order.front()]));
    objects_.push_back({set.images->object(), set.images->workspace(), std::move(grid.axes), count,
                        chosen.size(), std::vector<cv::Size>(options_.cropped ? 0 : chosen.size()),
                        set.images->cropped()});
    for (const std::size_t place : grid.order) jobs.push_back({set.images, chosen[place], object, count++});
  }

  const std::size_t all = count * picture_bytes_;
  if (options.memory_limit > 0 && all > options.memory_limit)
    on_disk_ = std::make_unique<ScratchFile>(options.scratch_folder, all);
  else
    pictures_.resize(all);
  energies_.resize(count);
  for (std::size_t o = 0; o < sets.size(); ++o) {
    if (sets[o].kept == nullptr) continue;
    const ObjectViews& object = objects_[o];
    std::vector<std::uint8_t> bytes(object.count * picture_bytes_);
    sets[o].kept->read(sets[o].kept_object, bytes, std::span(energies_).subspan(object.first, object.count));
    write_pictures(object.first, bytes);
  }

  ScratchPool pool(options_);
  std::mutex progress_mutex;
  std::size_t done = 0;  // guarded by progress_mutex
  parallel_for(jobs.size(), options.threads, [&](std::size_t i) {
    if (stop.stop_requested()) throw Interrupted();
    const Job& job = jobs[i];
    ObjectViews& object = objects_[job.object];
    const cv::Mat image = job.images->load(job.view);
    const auto file = job.images->folder() / job.images->views()[job.view].file;
    const Kind kind(image);
    const Kind& first = *kinds[job.object];
    if (kind != first)
      throw FileError(file, "is " + kind.text() + ", the first view of \"" + job.images->object() + "\" is " +
                                first.text() + "; all views of an object must be alike: acquire it again");
    auto scratch = pool.take();
    try {
      cv::Size extent;
      normalize_learned_view(image, job.images->cropped(), scratch->segmenter, scratch->normalizer,
                             scratch->picture, &extent);
      if (!options_.cropped) object.extents[job.place - object.first] = extent;
      keep(scratch->picture, range, scratch->bytes);
      kept_numbers(scratch->bytes, range, scratch->picture);
      energies_[job.place] = scratch->maker.make(scratch->picture, scratch->appearance);
      if (!(energies_[job.place] > 0.0F))
        throw Error("shows nothing of image type \"" + image_type_name(options_) +
                    "\"; learn another type or remove the view");
    } catch (const FileError&) {
      throw;
    } catch (const std::exception& trouble) {
      throw FileError(file, trouble.what());
    }
    write_pictures(job.place, scratch->bytes);
    pool.give_back(std::move(scratch));
    const std::lock_guard lock(progress_mutex);
    if (progress) progress({"normalising", ++done, jobs.size()});
  });
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
