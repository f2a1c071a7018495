#include "core/recognition/recognizer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "core/image/appearance_maker.h"
#include "core/image/normalization.h"
#include "core/image/segmentation.h"
#include "core/recognition/decision.h"
#include "core/recognition/parts_stage.h"
#include "core/search/search.h"
#include "core/simd/projection.h"

namespace eigenpose {
namespace {

using SteadyTime = std::chrono::steady_clock;

/// Where the second best object is nearer than this times the best, the objects' own eigenspaces decide.
constexpr double second_look_ratio = 2.0;
/// A region is too small if its larger side has fewer pixels than this share of the appearance's side.
constexpr double least_side_share = 0.25;

/// Adds the time since it was made to a duration.
class Lap {
 public:
  explicit Lap(Duration& into) : into_(into), began_(SteadyTime::now()) {}
  Lap(const Lap&) = delete;
  Lap& operator=(const Lap&) = delete;
  ~Lap() { into_ += SteadyTime::now() - began_; }

 private:
  Duration& into_;
  TimePoint began_;
};

/// The limits of the next region, of a picture whose recognition began at `began`.
RecognitionLimits left_of(const RecognitionLimits& limits, TimePoint began) {
  RecognitionLimits left = limits;
  if (limits.frame_time != Duration::max())
    left.region_time = std::min(limits.region_time,
                                std::max(Duration::zero(), limits.frame_time - (SteadyTime::now() - began)));
  return left;
}

/// Whether two poses are within one and a half steps of the learned grid. The universal eigenspace chooses
/// the basin, because it has seen all objects; the object's own eigenspace refines the pose within it.
bool same_basin(const Manifold& manifold, const ClosestPoint& a, const ClosestPoint& b) {
  for (std::size_t d = 0; d < manifold.dofs(); ++d) {
    const SampleAxis& axis = manifold.axes()[d];
    const double step = axis.dof.period() / static_cast<double>(axis.samples.size());
    if (std::abs(axis.dof.difference(a.q[d], b.q[d])) > 1.5 * step) return false;
  }
  return true;
}

}  // namespace

/// The stages of recognition, each a function. They pass values on in the fields below.
struct Recognizer::Impl {
  explicit Impl(std::shared_ptr<const RecognitionIndex> shared);

  std::shared_ptr<const RecognitionIndex> index;
  const Model& model;
  Segmenter segmenter;
  Normalizer normalizer;
  AppearanceMaker maker;
  std::optional<PartsStage> parts;

  // Scratch, reused from frame to frame.
  Eigen::MatrixXf appearances;  ///< one column a region of the batch
  Eigen::MatrixXf points;       ///< likewise
  Eigen::MatrixXf typed_from;   ///< likewise, the pictures, where appearances are others
  std::array<float, most_projected> energies{};
  Eigen::Index column = 0;  ///< of the region that is looked at
  Eigen::VectorXf point;    ///< its projection
  std::array<ClosestPoint, 3> closest;
  std::size_t closest_count = 0;
  ReducedRegion reduced;
  Eigen::VectorXf squared;  ///< distances of samples
  std::array<double, max_manifold_dofs> other_q{};
  Region whole;
  std::vector<Outcome> outcomes;
  std::size_t outcome_count = 0;
  HypothesisPool pool;

  std::span<const Region> find_regions(const cv::Mat& image);
  [[nodiscard]] bool too_small(const Region& region) const;
  /// Whether the region is not recognised at all.
  [[nodiscard]] bool refused(const Region& region) const {
    return region.touches_border || too_small(region);
  }
  /// Sets `picture()`, `appearance()` and the energy of the latter.
  void normalize(const cv::Mat& image, std::size_t region);
  /// The normalised picture of the current region, and its appearance.
  [[nodiscard]] std::span<float> picture();
  [[nodiscard]] std::span<float> appearance() { return column_of(appearances); }
  [[nodiscard]] std::span<float> column_of(Eigen::MatrixXf& of_batch) const {
    return {of_batch.col(column).data(), static_cast<std::size_t>(of_batch.rows())};
  }
  /// Decides what region `region` shows, which was normalised and projected.
  void judge_region(const cv::Mat& image, std::size_t region, const RecognitionLimits& limits);
  void find_closest();
  /// Puts first the close candidate that explains the whole picture best, and takes its pose from the
  /// eigenspace with the smaller pose error.
  void look_again();
  void judge(Outcome& outcome);
  /// Replaces the last outcome by those of the touching objects of its region, if it can be split.
  void split(const cv::Mat& image, std::size_t region, const RecognitionLimits& limits);
  void estimate_pose(Outcome& outcome, const ClosestPoint& best);

  Outcome& next_outcome();
  void describe(std::optional<Hypothesis>& hypothesis, const ClosestPoint& found);
};

Recognizer::Impl::Impl(std::shared_ptr<const RecognitionIndex> shared)
    : index(std::move(shared)),
      model(index->model()),
      segmenter(model.normalization.segmentation),
      normalizer(model.normalization),
      maker(model.normalization),
      appearances(model.eigenspace.length(), most_projected),
      points(model.eigenspace.components(), most_projected),
      typed_from(maker.is_picture() ? 0 : static_cast<Eigen::Index>(picture_length(model.normalization)),
                 most_projected),
      point(model.eigenspace.components()) {
  if (model.parts) parts.emplace(*index, pool);
}

std::span<const Region> Recognizer::Impl::find_regions(const cv::Mat& image) {
  if (!model.normalization.cropped) return segmenter.segment(image);
  whole = {cv::Rect(0, 0, image.cols, image.rows), image.rows * image.cols, false};
  return {&whole, 1};
}

bool Recognizer::Impl::too_small(const Region& region) const {
  return std::max(region.box.width, region.box.height) < least_side_share * model.normalization.size;
}

std::span<float> Recognizer::Impl::picture() {
  return column_of(maker.is_picture() ? appearances : typed_from);
}

void Recognizer::Impl::normalize(const cv::Mat& image, std::size_t region) {
  float& energy = energies[static_cast<std::size_t>(column)];
  energy = model.normalization.cropped ? normalizer.normalize(image, {0, 0, 0}, picture())
                                       : normalizer.normalize(segmenter.cut_out(image, region),
                                                              segmenter.background().level, picture());
  if (!maker.is_picture()) energy = maker.make(picture(), appearance());
}

void Recognizer::Impl::find_closest() {
  closest_count = index->within_reach().nearest_into(point, closest, index->reach());
  // Nothing within reach: the nearest is reported all the same.
  if (closest_count == 0)
    closest_count = index->searches().all->nearest_into(point, std::span(closest).first(1));
}

void Recognizer::Impl::look_again() {
  const ObjectEigenspaceIndex& spaces = index->object_eigenspaces();
  const auto has_space = [&](const ClosestPoint& found) { return spaces.has(found.manifold); };
  const auto end = closest.begin() + static_cast<std::ptrdiff_t>(closest_count);
  const auto close = std::find_if(closest.begin() + 1, end, [&](const ClosestPoint& found) {
    return found.distance > second_look_ratio * closest[0].distance;
  });
  const bool doubtful = close - closest.begin() > 1;
  const auto better_pose = [&](const ClosestPoint& found) {
    return model.objects[found.manifold].space->better_pose;
  };
  if (!std::all_of(closest.begin(), close, has_space) || (!doubtful && !better_pose(closest[0]))) return;
  spaces.reduce(appearance(), reduced);
  std::array<ClosestPoint, 3> seen;
  for (auto found = closest.begin(); found != close; ++found)
    seen[static_cast<std::size_t>(found - closest.begin())] = spaces.closest(found->manifold, reduced);
  const auto count = close - closest.begin();
  const auto winner =
      std::min_element(seen.begin(), seen.begin() + count,
                       [](const ClosestPoint& a, const ClosestPoint& b) { return a.distance < b.distance; }) -
      seen.begin();
  std::rotate(closest.begin(), closest.begin() + winner, closest.begin() + winner + 1);
  const ClosestPoint& own = seen[static_cast<std::size_t>(winner)];
  if (better_pose(closest[0]) && same_basin(model.objects[own.manifold].manifold, own, closest[0]))
    closest[0].q = own.q;
}

void Recognizer::Impl::judge_region(const cv::Mat& image, std::size_t region,
                                    const RecognitionLimits& limits) {
  const float energy = energies[static_cast<std::size_t>(column)];
  if (!(energy > 0.0F)) return;  // black: nothing to compare
  // Norm and mean are folded in: basisᵀ (x/‖x‖ − mean).
  point = points.col(column) / energy - index->searches().mean_point;
  find_closest();
  Outcome& outcome = outcomes[outcome_count - 1];
  if (!parts) {
    look_again();
    judge(outcome);
    return;
  }
  const std::size_t object = parts->judge(picture(), closest[0].manifold, outcome);
  if (outcome.verdict == Verdict::unknown || parts->too_large(outcome.box.size(), object, outcome))
    split(image, region, limits);
}

void Recognizer::Impl::judge(Outcome& outcome) {
  const ClosestPoint& best = closest[0];
  const DecisionModel& decision = model.decision;
  const auto evidence_at = [&](double distance, std::size_t object) {
    return evidence_of(decision.weights, WholeMatch{distance, model.objects[object].typical_distance});
  };
  describe(outcome.best, best);
  if (closest_count > 1) describe(outcome.runner_up, closest[1]);
  Evidence evidence{.best = evidence_at(best.distance, best.manifold), .required = decision.required};
  if (closest_count > 1) evidence.second = evidence_at(closest[1].distance, closest[1].manifold);
  outcome.decide(evidence, decision.tuning);
  if (outcome.verdict == Verdict::unknown) return;
  estimate_pose(outcome, best);
  const ModelObject& object = model.objects[best.manifold];
  const std::span<double> q(other_q.data(), object.workspace.size());
  const auto other =
      index->samples(best.manifold).other_minimum(point, outcome.best->q, poses_apart, q, squared);
  if (other && lead_of_distance(decision.tuning, object.typical_distance, best.distance, other->distance) <
                   decision.tuning.pose_lead)
    pool.fill(outcome.other_pose, object.name, q, other->distance);
}

void Recognizer::Impl::split(const cv::Mat& image, std::size_t region, const RecognitionLimits& limits) {
  if (model.normalization.cropped) return;
  const SplitRegion& found = parts->split(segmenter.cut_out(image, region), segmenter.background(), limits);
  outcomes[outcome_count - 1].unfinished = found.unfinished;
  // A region recognised as one object is replaced only by objects that explain all of it.
  const bool known = outcomes[outcome_count - 1].verdict != Verdict::unknown;
  if (found.objects.empty() || (known && !found.unknown.empty())) return;
  const cv::Rect frame(0, 0, image.cols, image.rows);
  const cv::Point corner = outcomes[--outcome_count].box.tl();
  for (const TouchingObject& object : found.objects) {
    Outcome& outcome = next_outcome();
    outcome.box = (object.box + corner) & frame;
    outcome.unfinished = found.unfinished;
    parts->describe(object, outcome);
  }
  for (const cv::Rect& box : found.unknown) {
    Outcome& outcome = next_outcome();
    outcome.box = (box + corner) & frame;
    outcome.unfinished = found.unfinished;
  }
}

void Recognizer::Impl::estimate_pose(Outcome& outcome, const ClosestPoint& best) {
  const ModelObject& object = model.objects[best.manifold];
  const double sigma = std::max(best.distance, object.typical_distance) /
                       std::sqrt(model.decision.tuning.effective_dimensions);
  outcome.set_covariance(index->samples(best.manifold).covariance(outcome.best->q), sigma * sigma,
                         object.dof_observable);
}

Outcome& Recognizer::Impl::next_outcome() {
  if (outcome_count == outcomes.size()) outcomes.emplace_back();
  Outcome& outcome = outcomes[outcome_count++];
  pool.clear(outcome);
  return outcome;
}

void Recognizer::Impl::describe(std::optional<Hypothesis>& hypothesis, const ClosestPoint& found) {
  const ModelObject& object = model.objects[found.manifold];
  pool.fill(hypothesis, object.name, std::span(found.q).first(object.workspace.size()), found.distance);
}

Recognizer::Recognizer(std::shared_ptr<const RecognitionIndex> index) {
  if (index == nullptr) throw std::invalid_argument("a recogniser needs an index");
  impl_ = std::make_unique<Impl>(std::move(index));
}

Recognizer::Recognizer(std::shared_ptr<const Model> model, const RecognizerOptions& options)
    : Recognizer(std::make_shared<const RecognitionIndex>(std::move(model), options)) {}

Recognizer::~Recognizer() = default;
Recognizer::Recognizer(Recognizer&&) noexcept = default;
Recognizer& Recognizer::operator=(Recognizer&&) noexcept = default;

const Model& Recognizer::model() const {
  return impl_->model;
}

std::span<const Outcome> Recognizer::recognize(const cv::Mat& image, const RecognitionLimits& limits,
                                               RecognitionTimes* times) {
  RecognitionTimes local;
  RecognitionTimes& spent = times != nullptr ? *times : local;
  spent = {};
  const Lap total(spent.total);
  const TimePoint began = SteadyTime::now();
  Impl& impl = *impl_;
  if (image.empty() || (image.depth() != CV_8U && image.type() != CV_16UC1))
    throw std::invalid_argument("a picture is 8-bit grey, 8-bit BGR or 16-bit grey and not empty; got type " +
                                cv::typeToString(image.type()));
  if (impl.model.normalization.color && image.channels() != 3)
    throw std::invalid_argument(
        "the model was learned in colour, the picture is grey; learn it from grey views "
        "(NormalizationOptions::color)");
  std::span<const Region> regions;
  {
    const Lap lap(spent.segment);
    regions = impl.find_regions(image);
  }
  impl.outcome_count = 0;
  for (std::size_t begin = 0, end = 0; begin < regions.size(); begin = end) {
    // As many regions as are projected together.
    {
      const Lap lap(spent.normalize);
      for (impl.column = 0; end < regions.size() && impl.column < most_projected; ++end) {
        if (impl.refused(regions[end])) continue;
        impl.normalize(image, end);
        ++impl.column;
      }
    }
    {
      const Lap lap(spent.project);
      project_onto(impl.model.eigenspace.basis, impl.appearances, impl.column, impl.points);
    }
    const Lap lap(spent.search);
    impl.column = 0;
    for (std::size_t i = begin; i < end; ++i) {
      Outcome& outcome = impl.next_outcome();
      outcome.box = regions[i].box;
      if (impl.refused(regions[i])) {
        outcome.verdict = regions[i].touches_border ? Verdict::touches_border : Verdict::too_small;
      } else {
        impl.judge_region(image, i, left_of(limits, began));
        ++impl.column;
      }
    }
  }
  return {impl.outcomes.data(), impl.outcome_count};
}

}  // namespace eigenpose
