#include "core/recognition/touching_objects.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <span>

#include <opencv2/imgproc.hpp>

#include "core/image/foreground.h"
#include "core/image/region.h"

namespace eigenpose {
namespace {

/// Share of an object's side that may be hidden: its box may reach that far beyond the region.
constexpr double most_beyond = 0.45;
/// A box of the wrong size loses votes. A trial is kept if it gets at least this share of the votes that the
/// object's own views get.
constexpr double least_trial_votes = 0.7;
constexpr std::size_t most_trials = 8;  ///< boxes that are matched in full
constexpr double place_step = 0.25;     ///< between boxes away from the corners, in their sides
constexpr double least_filled = 0.6;    ///< of a box away from the corners: foreground
constexpr double same_place = 0.7;      ///< of two boxes' union
constexpr int most_looks = 3000;        ///< boxes looked at in one region; then the search ends
constexpr std::size_t most_first = 3;   ///< first objects that are completed
constexpr std::size_t most_objects = 6;
/// A remaining piece may be an object if it has at least this share of the smallest learned box; else it is
/// outline.
constexpr double least_piece = 0.2;
constexpr double least_explained = 0.85;
constexpr double plainly_explained = 0.97;  ///< no other first object is tried
/// Remains of neighbouring objects lower the evidence, fully during the search and partly after they have
/// been removed.
constexpr double search_slack = 6.0;
constexpr double most_overlapped = 0.25;  ///< share of an object that others may hide; unknown ones hide more
constexpr double most_left_over = 0.1;    ///< an object occluded by more than this gets no slack in the end
constexpr double final_slack = 3.0;
constexpr double beyond_doubt = 1.0;  ///< evidence above the threshold
/// A known object in a region this many times larger than it was learned may be two.
constexpr double doubtful_size = 1.3;
constexpr double silhouette_level = 0.2;  ///< of the root mean square brightness of an object's picture

/// Whether enough of a box is foreground to hold an object. @param sums integral of a foreground.
bool filled(const cv::Rect& box, const cv::Mat& sums) {
  const cv::Rect inside = box & cv::Rect(0, 0, sums.cols - 1, sums.rows - 1);
  const auto at = [&](int x, int y) { return sums.at<int>(y, x); };
  const int sum = at(inside.br().x, inside.br().y) - at(inside.x, inside.br().y) -
                  at(inside.br().x, inside.y) + at(inside.x, inside.y);
  return sum >= 255.0 * least_filled * box.area();
}

/// The learned view nearest to a pose, in steps of each DOF; of equally near ones the first.
std::size_t nearest_view(const AlignmentEigenspace& space, const Eigen::MatrixXd& poses,
                         std::span<const double> q) {
  const auto axes = space.coarse_manifold().axes();
  std::size_t nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (Eigen::Index v = 0; v < poses.cols(); ++v) {
    double squared = 0.0;
    for (std::size_t a = 0; a < axes.size(); ++a) {
      const double steps = axes[a].dof.difference(q[a], poses(static_cast<Eigen::Index>(a), v)) *
                           static_cast<double>(axes[a].samples.size()) / axes[a].dof.period();
      squared += steps * steps;
    }
    if (squared < least) {
      least = squared;
      nearest = static_cast<std::size_t>(v);
    }
  }
  return nearest;
}

/// The pieces of a mask.
struct Piece {
  cv::Rect box;     ///< of the largest piece
  double area = 0;  ///< its pixels
  double all = 0;   ///< those of all pieces
};

Piece largest_piece(const cv::Mat& mask) {
  cv::Mat labels;
  cv::Mat stats;
  cv::Mat centres;
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, centres);
  Piece largest;
  for (int i = 1; i < count; ++i) {
    const int area = stats.at<int>(i, cv::CC_STAT_AREA);
    largest.all += area;
    if (area <= largest.area) continue;
    largest.area = area;
    largest.box = {stats.at<int>(i, cv::CC_STAT_LEFT), stats.at<int>(i, cv::CC_STAT_TOP),
                   stats.at<int>(i, cv::CC_STAT_WIDTH), stats.at<int>(i, cv::CC_STAT_HEIGHT)};
  }
  return largest;
}

/// Keeps the first of those that are the same object in about the same place.
void keep_different(std::vector<TouchingObject>& objects) {
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const auto again = [&](const TouchingObject& other) {
      return other.found.best.object == objects[i].found.best.object &&
             shared_area(other.box, objects[i].box) > same_place;
    };
    objects.erase(std::remove_if(objects.begin() + static_cast<std::ptrdiff_t>(i) + 1, objects.end(), again),
                  objects.end());
  }
}

}  // namespace

TouchingObjects::TouchingObjects(const Model& model, const ViewExtents& extents, PartsRecognizer& recognizer)
    : normalization_(model.normalization),
      parts_(*model.parts),
      decision_(model.decision),
      recognizer_(recognizer),
      normalizer_(model.normalization),
      extents_(extents),
      picture_(model.normalization.size, model.normalization.size,
               picture_bands(model.normalization) == 3 ? CV_8UC3 : CV_8UC1) {}

bool TouchingObjects::may_look() {
  const bool late = limits_->region_time != Duration::max() && std::chrono::steady_clock::now() >= deadline_;
  unfinished_ = unfinished_ || late || looks_left_ == 0 || limits_->stop.stop_requested();
  if (!unfinished_) --looks_left_;
  return !unfinished_;
}

std::optional<PartsRecognizer::Look> TouchingObjects::look(const cv::Rect& box, std::vector<float>& picture) {
  crop_.create(box.size(), work_.type());
  crop_.setTo(background_.color());
  const cv::Rect inside = box & cv::Rect(0, 0, work_.cols, work_.rows);
  if (inside.empty() || !may_look()) return std::nullopt;
  work_(inside).copyTo(crop_(inside - box.tl()));
  picture.resize(picture_length(normalization_));
  if (!(normalizer_.normalize(crop_, background_.level, picture) > 0.0F)) return std::nullopt;
  quantize(picture, {picture_.ptr<std::uint8_t>(), picture_.total() * picture_.elemSize()});
  return recognizer_.look(picture_);
}

cv::Size TouchingObjects::learned_size(std::size_t object, std::span<const double> q) const {
  return parts_.extents[object][nearest_view(parts_.poses[object], parts_.view_poses[object], q)];
}

bool TouchingObjects::too_large(const cv::Size& region, std::size_t object, std::span<const double> q) const {
  if (extents_.empty()) return false;
  const cv::Size learned = learned_size(object, q);
  return !learned.empty() &&
         (region.width > doubtful_size * learned.width || region.height > doubtful_size * learned.height);
}

std::vector<TouchingObjects::Trial> TouchingObjects::trials(const cv::Rect& outline, double visible,
                                                            Places places) {
  std::vector<Trial> all;
  std::vector<float> picture;
  cv::Mat sums;
  if (places == Places::all) cv::integral(foreground_of(work_, background_), sums, CV_32S);
  for (std::size_t e = 0; e < extents_.groups().size(); ++e) {
    const cv::Size& size = extents_.groups()[e].size;
    if ((1.0 - most_beyond) * size.width > outline.width ||
        (1.0 - most_beyond) * size.height > outline.height)
      continue;
    const cv::Size room(outline.width - size.width, outline.height - size.height);
    const auto steps = [&](int free, int side) {
      return places == Places::corners ? 1
                                       : std::max(1, static_cast<int>(std::ceil(free / (place_step * side))));
    };
    const int across = steps(room.width, size.width);
    const int down = steps(room.height, size.height);
    for (int i = 0; i <= across; ++i) {
      for (int k = 0; k <= down; ++k) {
        const cv::Rect box({outline.x + room.width * i / across, outline.y + room.height * k / down}, size);
        const bool corner = (i == 0 || i == across) && (k == 0 || k == down);
        if (places == Places::all && (corner || !filled(box, sums))) continue;  // corners were tried before
        const auto seen = look(box, picture);
        if (!seen) continue;
        const PartsRecognizer::Votes votes = seen->vote(extents_.groups()[e].objects);
        const std::size_t object = votes.ranked()[0].object;
        const WindowsMatch match = votes.match(object);
        if (match.votes >= least_trial_votes * visible * match.typical_votes)
          all.push_back({box, e, match.votes});
      }
    }
  }
  const auto kept = std::min(all.size(), most_trials);
  std::partial_sort(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(kept), all.end(),
                    [](const Trial& a, const Trial& b) { return a.votes > b.votes; });
  all.resize(kept);
  return all;
}

TouchingObject TouchingObjects::settle(const cv::Rect& box, std::span<const std::size_t> shortlist) {
  TouchingObject object{box, {}, {}, decision_.required_occluded};
  const auto seen = look(box, object.picture);
  if (!seen) return object;
  object.found = seen->vote(shortlist).identify_occluded();
  const PartsPose& pose = object.found.best.poses.front();
  // The size of the learned view, about the middle corrected by the misalignment.
  const cv::Size learned = learned_size(object.found.best.object, pose.q);
  const cv::Size size = learned.empty() ? box.size() : learned;
  const double side = std::max(box.width, box.height);
  const double x = box.x + 0.5 * box.width + side * pose.misalignment.dx;
  const double y = box.y + 0.5 * box.height + side * pose.misalignment.dy;
  object.box = {cv::Point(static_cast<int>(std::lround(x - 0.5 * size.width)),
                          static_cast<int>(std::lround(y - 0.5 * size.height))),
                size};
  return object;
}

std::vector<TouchingObject> TouchingObjects::candidates(const cv::Rect& outline, double visible) {
  for (const Places places : {Places::corners, Places::all}) {
    std::vector<TouchingObject> found = candidates(trials(outline, visible, places));
    if (!found.empty()) return found;
  }
  return {};
}

std::vector<TouchingObject> TouchingObjects::candidates(std::span<const Trial> trials) {
  std::vector<TouchingObject> found;
  for (const Trial& trial : trials) {
    TouchingObject object = settle(trial.box, extents_.groups()[trial.extent].objects);
    if (!object.found.best.poses.empty()) found.push_back(std::move(object));
  }
  const auto by_evidence = [](const TouchingObject& a, const TouchingObject& b) {
    return a.found.evidence > b.found.evidence;
  };
  std::ranges::sort(found, by_evidence);
  keep_different(found);
  found.resize(std::min(found.size(), most_first));
  // Again in the corrected box, where less misalignment is left.
  for (TouchingObject& object : found) {
    TouchingObject again = settle(object.box, {});
    if (!again.found.best.poses.empty() && again.found.evidence > object.found.evidence)
      object = std::move(again);
  }
  std::erase_if(found, [&](const TouchingObject& object) {
    return object.found.evidence < decision_.required_occluded - search_slack;
  });
  std::ranges::sort(found, by_evidence);
  keep_different(found);
  return found;
}

cv::Mat TouchingObjects::silhouette(const TouchingObject& object) const {
  const AlignmentEigenspace& space = parts_.poses[object.found.best.object];
  const int side = space.coarse().side;
  Eigen::VectorXf pixels;
  space.render(object.found.best.poses.front().q, pixels);
  const auto level = static_cast<float>(silhouette_level / side);
  const cv::Mat picture(side, side, CV_32F, pixels.data());
  const int square = std::max(object.box.width, object.box.height);
  cv::Mat scaled;
  cv::resize(picture, scaled, {square, square}, 0.0, 0.0, cv::INTER_LINEAR);
  const cv::Mat mask = scaled > level;
  cv::Mat out = cv::Mat::zeros(work_.size(), CV_8U);
  const cv::Rect place(object.box.x + object.box.width / 2 - square / 2,
                       object.box.y + object.box.height / 2 - square / 2, square, square);
  const cv::Rect inside = place & object.box & cv::Rect(0, 0, work_.cols, work_.rows);
  if (!inside.empty()) mask(inside - place.tl()).copyTo(out(inside));
  return out;
}

double TouchingObjects::complete(TouchingObject first, const cv::Mat& foreground, SplitRegion& way) {
  const double whole = cv::countNonZero(foreground);
  cv::Mat left = foreground.clone();
  way.objects.clear();
  way.objects.push_back(std::move(first));
  while (true) {
    const cv::Mat taken = silhouette(way.objects.back());
    left.setTo(0, taken);
    work_.setTo(background_.color(), taken);
    cv::Mat pieces;
    cv::morphologyEx(left, pieces, cv::MORPH_OPEN, cv::Mat::ones(5, 5, CV_8U));
    const Piece piece = largest_piece(pieces);
    const double explained = 1.0 - piece.all / whole;
    way.unknown.clear();
    if (piece.area < least_piece * extents_.least().area()) return explained;
    way.unknown.push_back(piece.box);
    if (way.objects.size() == most_objects) return explained;
    std::vector<TouchingObject> next = candidates(piece.box, 1.0 - most_overlapped);
    if (next.empty()) return explained;
    way.objects.push_back(std::move(next.front()));
  }
}

double TouchingObjects::search(const cv::Mat& cut, const cv::Mat& foreground, const cv::Rect& outline) {
  double most = 0.0;
  SplitRegion way;
  cut.copyTo(work_);
  // Of objects that overlap, the one in front is visible as a whole.
  for (const TouchingObject& first : candidates(outline, 1.0)) {
    cut.copyTo(work_);
    const double explained = complete(first, foreground, way);
    if (explained > most) {
      most = explained;
      result_ = way;
    }
    if (most > plainly_explained) break;
  }
  return most;
}

void TouchingObjects::match_again(const cv::Mat& cut) {
  std::vector<TouchingObject>& objects = result_.objects;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    cut.copyTo(work_);
    const cv::Mat own = silhouette(objects[i]);
    for (std::size_t k = 0; k < objects.size(); ++k) {
      if (k == i) continue;
      cv::Mat other = silhouette(objects[k]);
      other.setTo(0, own);
      work_.setTo(background_.color(), other);
    }
    TouchingObject again = settle(objects[i].box, std::span(&objects[i].found.best.object, 1));
    if (again.found.best.poses.empty()) continue;
    again.found.second = objects[i].found.second;
    again.found.second_evidence =
        again.found.evidence - (objects[i].found.evidence - objects[i].found.second_evidence);
    objects[i] = std::move(again);
  }
}

void TouchingObjects::accept(double explained) {
  std::vector<TouchingObject>& objects = result_.objects;
  const auto require = [&](auto slack_of) {
    for (TouchingObject& object : objects) object.required = decision_.required_occluded - slack_of(object);
  };
  const auto sure = [](const TouchingObject& object) {
    return object.found.best.occluded <= most_overlapped && object.found.evidence >= object.required;
  };
  require([](const TouchingObject& object) {
    return object.found.best.occluded <= most_left_over ? final_slack : 0.0;
  });
  if (objects.size() > 1 && explained > least_explained && std::ranges::all_of(objects, sure)) return;
  // An object beyond doubt is reported even beside something unknown.
  require([](const TouchingObject&) { return -beyond_doubt; });
  std::erase_if(objects, [&](const TouchingObject& object) {
    if (sure(object)) return false;
    result_.unknown.push_back(object.box);
    return true;
  });
  if (objects.empty() || result_.unknown.empty()) result_ = {};
}

const SplitRegion& TouchingObjects::split(const cv::Mat& cut, const Background& background,
                                          const RecognitionLimits& limits) {
  background_ = background;
  limits_ = &limits;
  if (limits.region_time != Duration::max())
    deadline_ = std::chrono::steady_clock::now() + limits.region_time;
  looks_left_ = most_looks;
  unfinished_ = false;
  result_ = {};
  if (!extents_.may_be_two(cut.size())) return result_;
  const cv::Mat foreground = foreground_of(cut, background);
  const cv::Rect outline = largest_piece(foreground).box;
  if (outline.empty()) return result_;
  const double explained = search(cut, foreground, outline);
  match_again(cut);
  accept(explained);
  result_.unfinished = unfinished_;
  return result_;
}

}  // namespace eigenpose
