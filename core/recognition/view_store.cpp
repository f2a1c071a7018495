#include "core/recognition/view_store.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <mutex>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/recognition/pose_grid.h"

namespace eigenpose {
namespace {

/// One view to be read: where from, and where to in the store.
struct Job {
  const ImageSet* images = nullptr;
  std::size_t view = 0;
};

/// Segmenters and normalisers hold scratch memory; views are worked on by several threads.
struct Scratch {
  explicit Scratch(const NormalizationOptions& options)
      : segmenter(options.segmentation), normalizer(options), appearance(normalizer.length()) {}
  Segmenter segmenter;
  Normalizer normalizer;
  std::vector<float> appearance;
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

std::string size_text(const cv::Mat& image) {
  return std::to_string(image.cols) + "x" + std::to_string(image.rows) +
         (image.channels() == 3 ? " colour" : " grey");
}

}  // namespace

float normalize_learned_view(const cv::Mat& image, bool cropped, Segmenter& segmenter, Normalizer& normalizer,
                             std::span<float> appearance) {
  float energy = 0.0F;
  if (cropped) {
    energy = normalizer.normalize(image, {0, 0, 0}, appearance);
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
    energy = normalizer.normalize(segmenter.cut_out(image, index), segmenter.background().level, appearance);
  }
  if (!(energy > 0.0F)) throw Error("is black; light the object better or remove the view");
  return energy;
}

ViewStore::ViewStore(std::span<const TrainingSet> sets, const NormalizationOptions& options, unsigned threads,
                     const Progress& progress, std::stop_token stop)
    : options_(options), length_(appearance_length(options)) {
  if (sets.empty()) throw Error("there is no image set to learn from; import or acquire one");
  std::vector<Job> jobs;
  for (const TrainingSet& set : sets) {
    const auto& views = set.images->views();
    std::vector<std::size_t> chosen = set.views;
    if (chosen.empty())
      for (std::size_t i = 0; i < views.size(); ++i) chosen.push_back(i);
    if (chosen.size() < 2)
      throw FileError(set.images->folder(),
                      "has " + std::to_string(chosen.size()) + " view(s) of \"" + set.images->object() +
                          "\" to learn from; at least 3 around a turn are " + "needed: acquire more");
    std::vector<std::vector<double>> poses;
    for (const std::size_t i : chosen) poses.push_back(views.at(i).q);
    PoseGrid grid = find_pose_grid(set.images->workspace(), poses, set.images->object());
    objects_.push_back(
        {set.images->object(), set.images->workspace(), std::move(grid.axes), jobs.size(), chosen.size()});
    for (const std::size_t place : grid.order) jobs.push_back({set.images, chosen[place]});
  }

  bytes_.resize(jobs.size() * length_);
  energies_.resize(jobs.size());
  std::vector<cv::Mat> first_of_set(objects_.size());
  for (std::size_t o = 0; o < objects_.size(); ++o)
    first_of_set[o] = jobs[objects_[o].first].images->load(jobs[objects_[o].first].view);
  std::vector<std::size_t> object_of(jobs.size());
  for (std::size_t o = 0; o < objects_.size(); ++o)
    std::fill_n(object_of.begin() + static_cast<std::ptrdiff_t>(objects_[o].first), objects_[o].count, o);

  ScratchPool pool(options_);
  std::mutex progress_mutex;
  std::size_t done = 0;  // guarded by progress_mutex
  parallel_for(jobs.size(), threads, [&](std::size_t i) {
    if (stop.stop_requested()) throw Interrupted();
    const Job& job = jobs[i];
    const cv::Mat image = job.images->load(job.view);
    const auto file = job.images->folder() / job.images->views()[job.view].file;
    const cv::Mat& first = first_of_set[object_of[i]];
    if (image.size() != first.size() || image.type() != first.type())
      throw FileError(file, "is " + size_text(image) + ", the first view of \"" + job.images->object() +
                                "\" is " + size_text(first) +
                                "; all views of an object must be alike: acquire it again");
    auto scratch = pool.take();
    try {
      normalize_learned_view(image, job.images->cropped(), scratch->segmenter, scratch->normalizer,
                             scratch->appearance);
    } catch (const FileError&) {
      throw;
    } catch (const std::exception& trouble) {
      throw FileError(file, trouble.what());
    }
    const std::span<std::uint8_t> bytes(bytes_.data() + i * length_, length_);
    quantize(scratch->appearance, bytes);
    double energy = 0.0;
    for (const std::uint8_t b : bytes) energy += static_cast<double>(b) * b;
    energies_[i] = static_cast<float>(std::sqrt(energy));
    pool.give_back(std::move(scratch));
    const std::lock_guard lock(progress_mutex);
    if (progress) progress({"normalising", ++done, jobs.size()});
  });
}

void ViewStore::read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const {
  for (Eigen::Index c = 0; c < tile.cols(); ++c) {
    const std::size_t i = first + static_cast<std::size_t>(c);
    const Eigen::Map<const Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 1>> view(
        bytes_.data() + i * length_, static_cast<Eigen::Index>(length_));
    tile.col(c) = view.cast<float>() / energies_[i];
  }
}

void ViewStore::read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const {
  std::memcpy(tile, bytes_.data() + first * length_, n * length_);
}

}  // namespace eigenpose
