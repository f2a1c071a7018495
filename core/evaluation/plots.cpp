#include "core/evaluation/plots.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "core/evaluation/svg.h"

namespace eigenpose {
namespace {

/// "0.56 %", with as many digits as a small rate needs.
std::string percent(double rate) {
  const double value = 100.0 * rate;
  char text[32];
  std::snprintf(text, sizeof text,
                value == 0.0 || value >= 99.995 ? "%.0f %%"
                : value < 0.1                   ? "%.3f %%"
                                                : "%.2f %%",
                value);
  return text;
}

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string count_of(std::size_t count, std::string_view what) {
  return std::to_string(count).append(" ").append(what).append(count == 1 ? "" : "s");
}

void add_heading(SvgDrawing& drawing, double left, std::string_view title, std::string_view subtitle) {
  drawing.text("ink title start", {left, 36.0}, title);
  drawing.text("muted subtitle start", {left, 58.0}, subtitle);
}

/// Rates on a scale of decades, from 0 (one decade before the lowest) to 1.
class RateScale {
 public:
  /// @param views how many the rate is of: 1/views is the smallest one that is not 0.
  RateScale(std::size_t views, double begin, double end)
      : lowest_(std::min(-1, static_cast<int>(std::floor(-std::log10(static_cast<double>(views)) + 1e-9)))),
        begin_(begin),
        end_(end) {}

  [[nodiscard]] int lowest() const { return lowest_; }  ///< exponent of the first decade
  [[nodiscard]] double at(double rate) const {
    const double decades = -lowest_ + 1.0;
    const double along = rate <= 0.0 ? 0.0 : std::max(0.0, std::log10(rate) - lowest_ + 1.0);
    return begin_ + (end_ - begin_) * along / decades;
  }

 private:
  int lowest_;
  double begin_;
  double end_;
};

constexpr SvgBox curve_frame{92.0, 84.0, 580.0, 400.0};
constexpr double label_width = 260.0;  // of the words at the point in use

/// Calls `draw(rate, label)` for 0 and each decade, and `fine(rate)` for the lines between.
template <typename Draw, typename Fine>
void for_each_tick(const RateScale& scale, const Draw& draw, const Fine& fine) {
  draw(0.0, std::string("0"));
  for (int decade = scale.lowest(); decade <= 0; ++decade) {
    const double rate = std::pow(10.0, decade);
    draw(rate, short_number(100.0 * rate) + " %");
    for (int k = 2; k < 10 && decade < 0; ++k) fine(k * rate);
  }
}

void draw_curve_axes(SvgDrawing& drawing, const RateScale& across, const RateScale& up) {
  const double left = curve_frame.x;
  const double right = curve_frame.x + curve_frame.width;
  const double top = curve_frame.y;
  const double bottom = curve_frame.y + curve_frame.height;
  const auto fine_across = [&](double rate) {
    drawing.line("fine", {across.at(rate), top}, {across.at(rate), bottom});
  };
  const auto fine_up = [&](double rate) { drawing.line("fine", {left, up.at(rate)}, {right, up.at(rate)}); };
  const auto nothing = [](auto&&...) {};
  for_each_tick(across, nothing, fine_across);
  for_each_tick(up, nothing, fine_up);
  for_each_tick(
      across,
      [&](double rate, const std::string& label) {
        drawing.line("grid", {across.at(rate), top}, {across.at(rate), bottom});
        drawing.text("muted middle", {across.at(rate), bottom + 20.0}, label);
      },
      nothing);
  for_each_tick(
      up,
      [&](double rate, const std::string& label) {
        drawing.line("grid", {left, up.at(rate)}, {right, up.at(rate)});
        drawing.text("muted end", {left - 10.0, up.at(rate) + 4.0}, label);
      },
      nothing);
  drawing.line("axis", {left, bottom}, {right, bottom});
  drawing.line("axis", {left, top}, {left, bottom});
  drawing.text("ink middle", {0.5 * (left + right), bottom + 46.0},
               "false acceptance: unknown objects that get a name");
  drawing.text("ink middle", {26.0, 0.5 * (top + bottom)}, "false rejection: known objects called unknown",
               -90.0);
}

/// The points in pixels; of several on one horizontal or vertical line only the ends.
std::vector<SvgPoint> stairs(const EvidenceCurve& curve, const RateScale& across, const RateScale& up) {
  std::vector<SvgPoint> places;
  for (const EvidenceCurve::Point& point : curve.points) {
    const SvgPoint place{across.at(point.false_acceptance), up.at(point.false_rejection)};
    const std::size_t n = places.size();
    const auto along = [&](double SvgPoint::*side) {
      return n >= 2 && places[n - 1].*side == place.*side && places[n - 2].*side == place.*side;
    };
    if (along(&SvgPoint::x) || along(&SvgPoint::y))
      places.back() = place;
    else
      places.push_back(place);
  }
  return places;
}

void draw_point_in_use(SvgDrawing& drawing, const EvidenceCurve& curve, const RateScale& across,
                       const RateScale& up) {
  const EvidenceCurve::Point& in_use = curve.in_use;
  const SvgPoint at{across.at(in_use.false_acceptance), up.at(in_use.false_rejection)};
  drawing.line("mark dashed", at, {at.x, curve_frame.y + curve_frame.height});
  drawing.line("mark dashed", {curve_frame.x, at.y}, at);
  drawing.circle("dot", at, 6.0);
  // The curve falls: above it on the right and below it on the left there is room.
  const double right_end = curve_frame.x + curve_frame.width;
  const bool room_right = at.x + label_width < right_end;
  const bool below = !room_right && at.y + 50.0 < curve_frame.y + curve_frame.height;
  const bool high = at.y < curve_frame.y + 40.0;
  const SvgPoint words{room_right ? at.x + 14.0 : at.x - 14.0, at.y + (below || high ? 24.0 : -28.0)};
  const std::string anchor = room_right ? " start" : " end";
  drawing.text("marked strong" + anchor, words, "in use: evidence ≥ " + short_number(in_use.threshold));
  drawing.text("marked" + anchor, {words.x, words.y + 16.0},
               percent(in_use.false_rejection) + " rejected, " + percent(in_use.false_acceptance) +
                   " falsely accepted");
}

}  // namespace

std::string curve_svg(const EvidenceCurve& curve) {
  const std::string title = "False rejection against false acceptance";
  SvgDrawing drawing(704.0, 552.0, title);
  add_heading(drawing, 26.0, title,
              "in use: " + percent(curve.in_use.false_rejection) + " of " +
                  count_of(curve.known, "known view") + " rejected, " +
                  percent(curve.in_use.false_acceptance) + " of " + count_of(curve.unknown, "unknown view") +
                  " falsely accepted");
  const RateScale across(curve.unknown, curve_frame.x, curve_frame.x + curve_frame.width);
  const RateScale up(curve.known, curve_frame.y + curve_frame.height, curve_frame.y);
  draw_curve_axes(drawing, across, up);
  drawing.polyline("curve", stairs(curve, across, up));
  draw_point_in_use(drawing, curve, across, up);
  return drawing.file();
}

namespace {

constexpr SvgBox reliability_frame{84.0, 84.0, 440.0, 440.0};
constexpr SvgBox histogram_frame{84.0, 560.0, 440.0, 90.0};

struct Interval {
  double lower = 0.0;
  double upper = 1.0;
};

/// 95 % confidence interval of a proportion, from `hits` in `n` ≥ 1 trials (Wilson score).
Interval wilson(std::size_t hits, std::size_t n) {
  constexpr double z = 1.96;
  const auto count = static_cast<double>(n);
  const double rate = static_cast<double>(hits) / count;
  const double middle = (rate + z * z / (2.0 * count)) / (1.0 + z * z / count);
  const double half =
      z / (1.0 + z * z / count) * std::sqrt(rate * (1.0 - rate) / count + z * z / (4.0 * count * count));
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

SvgPoint reliability_place(double confidence, double share) {
  return {reliability_frame.x + confidence * reliability_frame.width,
          reliability_frame.y + (1.0 - share) * reliability_frame.height};
}

void draw_reliability_axes(SvgDrawing& drawing) {
  const double bottom = histogram_frame.y + histogram_frame.height;
  for (int tick = 0; tick <= 10; ++tick) {
    const double value = 0.1 * tick;
    const std::string style = tick % 2 == 0 ? "grid" : "fine";
    drawing.line(style, reliability_place(0.0, value), reliability_place(1.0, value));
    drawing.line(style, reliability_place(value, 0.0), reliability_place(value, 1.0));
    if (tick % 2 != 0) continue;
    const SvgPoint left = reliability_place(0.0, value);
    drawing.text("muted end", {left.x - 10.0, left.y + 4.0}, short_number(100.0 * value) + " %");
    drawing.text("muted middle", {reliability_place(value, 0.0).x, bottom + 20.0}, short_number(value));
  }
  drawing.line("axis dashed", reliability_place(0.0, 0.0), reliability_place(1.0, 1.0));
  drawing.line("axis", reliability_place(0.0, 0.0), reliability_place(1.0, 0.0));
  drawing.line("axis", reliability_place(0.0, 0.0), reliability_place(0.0, 1.0));
  drawing.line("axis", {histogram_frame.x, bottom}, {histogram_frame.x + histogram_frame.width, bottom});
  const double middle = histogram_frame.x + 0.5 * histogram_frame.width;
  drawing.text("ink middle", {middle, bottom + 46.0}, "confidence");
  drawing.text("ink middle", {26.0, reliability_frame.y + 0.5 * reliability_frame.height},
               "share that is right", -90.0);
  drawing.text("ink middle", {26.0, histogram_frame.y + 0.5 * histogram_frame.height}, "regions", -90.0);
}

void draw_bin(SvgDrawing& drawing, const Reliability& reliability, std::size_t b) {
  const Reliability::Bin& bin = reliability.bins[b];
  if (bin.regions == 0) return;
  const double width = reliability_frame.width / Reliability::bin_count;
  const double from = static_cast<double>(b) / Reliability::bin_count;
  const SvgPoint corner = reliability_place(from, bin.right_share());
  const std::string said = count_of(bin.regions, "region") + ", " + percent(bin.right_share()) +
                           " right, mean confidence " + short_number(bin.mean_confidence);
  drawing.box("right", {corner.x + 3.0, corner.y, width - 6.0, reliability_place(0.0, 0.0).y - corner.y},
              0.25, said);
  const Interval interval = wilson(bin.right, bin.regions);
  const SvgPoint low = reliability_place(bin.mean_confidence, interval.lower);
  const SvgPoint high = reliability_place(bin.mean_confidence, interval.upper);
  drawing.line("whisker", low, high);
  for (const SvgPoint& end : {low, high}) drawing.line("whisker", {end.x - 4.0, end.y}, {end.x + 4.0, end.y});
  drawing.circle("right", reliability_place(bin.mean_confidence, bin.right_share()), 4.5);

  std::size_t most = 1;
  for (const Reliability::Bin& each : reliability.bins) most = std::max(most, each.regions);
  const double share = static_cast<double>(bin.regions) / static_cast<double>(most);
  const double height = std::max(1.5, (histogram_frame.height - 18.0) * share);
  const double bottom = histogram_frame.y + histogram_frame.height;
  drawing.box("quiet", {corner.x + 3.0, bottom - height, width - 6.0, height}, 1.0, said);
  drawing.text("muted middle", {corner.x + 0.5 * width, bottom - height - 5.0}, std::to_string(bin.regions));
}

}  // namespace

std::string reliability_svg(const Reliability& reliability) {
  const std::string title = "Confidence against correctness";
  SvgDrawing drawing(560.0, 716.0, title);
  add_heading(drawing, 26.0, title,
              "expected calibration error " + percent(reliability.expected_calibration_error) + " over " +
                  count_of(reliability.regions, "region") + ", " + std::to_string(reliability.unknown) +
                  " of unknown objects");
  draw_reliability_axes(drawing);
  for (std::size_t b = 0; b < Reliability::bin_count; ++b) draw_bin(drawing, reliability, b);
  return drawing.file();
}

namespace {

constexpr std::size_t longest_label = 20;  // characters of a name that are shown
constexpr double numbers_from = 26.0;      // pixels of a cell that has room for its percentage

/// Where the cells of a matrix stand.
struct MatrixLayout {
  std::size_t objects = 0;
  double cell = 0.0;    ///< side, pixels
  double font = 0.0;    ///< of labels
  double labels = 0.0;  ///< width of the rows' labels, height of the columns'
  double left = 0.0;    ///< of the first cell
  double top = 0.0;

  [[nodiscard]] SvgBox box(std::size_t row, std::size_t column) const {
    const double gap = column == objects ? 0.5 * cell : 0.0;
    return {left + static_cast<double>(column) * cell + gap, top + static_cast<double>(row) * cell, cell,
            cell};
  }
  [[nodiscard]] double width() const { return (static_cast<double>(objects) + 1.5) * cell; }
  [[nodiscard]] double height() const { return static_cast<double>(objects) * cell; }
};

std::string label(const std::string& name) {
  return name.size() <= longest_label ? name : name.substr(0, longest_label - 1) + "…";
}

MatrixLayout matrix_layout(std::span<const std::string> names) {
  MatrixLayout layout;
  layout.objects = names.size();
  layout.cell = std::clamp(640.0 / (static_cast<double>(names.size()) + 1.5), 9.5, 64.0);
  layout.font = std::clamp(0.82 * layout.cell, 7.5, 13.0);
  std::size_t longest = std::string_view("withheld").size();
  for (const std::string& name : names) longest = std::max(longest, std::min(name.size(), longest_label));
  layout.labels = 0.62 * layout.font * static_cast<double>(longest) + 12.0;
  layout.left = 50.0 + layout.labels;
  layout.top = 98.0 + layout.labels;
  return layout;
}

void draw_matrix_labels(SvgDrawing& drawing, const MatrixLayout& layout, std::span<const std::string> names) {
  const double down = 0.35 * layout.font;  // from the middle of a line to its base
  for (std::size_t o = 0; o < layout.objects; ++o) {
    const SvgBox row = layout.box(o, 0);
    drawing.text_of_size("ink end", {layout.left - 7.0, row.y + 0.5 * layout.cell + down}, label(names[o]),
                         layout.font);
    const SvgBox column = layout.box(0, o);
    drawing.text_of_size("ink start", {column.x + 0.5 * layout.cell + down, layout.top - 7.0},
                         label(names[o]), layout.font, -90.0);
  }
  const SvgBox last = layout.box(0, layout.objects);
  drawing.text_of_size("withheld strong start", {last.x + 0.5 * layout.cell + down, layout.top - 7.0},
                       "withheld", layout.font, -90.0);
  drawing.text("muted middle", {layout.left + 0.5 * layout.height(), 88.0}, "said");
  drawing.text("muted middle", {30.0, layout.top + 0.5 * layout.height()}, "shown", -90.0);
}

/// One cell, if any view fell into it. @param share of the views of its row.
void draw_cell(SvgDrawing& drawing, const SvgBox& box, std::string_view style, double share,
               std::string_view tooltip) {
  const double opacity = 0.25 + 0.75 * std::sqrt(share);
  drawing.box(style, {box.x + 0.5, box.y + 0.5, box.width - 1.0, box.height - 1.0}, opacity, tooltip);
  if (box.width < numbers_from) return;
  const double value = 100.0 * share;
  char text[16];
  std::snprintf(text, sizeof text, value < 9.95 && box.width >= 34.0 ? "%.1f" : "%.0f", value);
  drawing.text_of_size(opacity > 0.6 ? "on middle" : "ink middle",
                       {box.x + 0.5 * box.width, box.y + 0.5 * box.height + 4.0}, text,
                       std::min(13.0, 0.4 * box.width));
}

void draw_row(SvgDrawing& drawing, const MatrixLayout& layout, std::span<const std::size_t> row,
              std::span<const std::string> names, std::size_t object) {
  std::size_t all = 0;
  for (const std::size_t views : row) all += views;
  for (std::size_t said = 0; said < row.size(); ++said) {
    if (row[said] == 0) continue;
    const bool withheld = said == layout.objects;
    const std::string_view style = withheld ? "withheld" : said == object ? "right" : "wrong";
    draw_cell(drawing, layout.box(object, said), style, rate_of(row[said], all),
              names[object] + (withheld ? ": withheld" : " called " + names[said]) + ", " +
                  std::to_string(row[said]) + " of " + count_of(all, "view"));
  }
}

void draw_legend(SvgDrawing& drawing, double left, double y) {
  double x = left;
  for (const char* style : {"right", "wrong", "withheld"}) {
    drawing.box(style, {x, y - 10.0, 12.0, 12.0});
    drawing.text("ink start", {x + 18.0, y}, style);
    x += 84.0;
  }
  drawing.text("muted start", {left, y + 22.0},
               "% of the row's views; the colour grows with its square root");
}

}  // namespace

std::string confusion_svg(const ConfusionMatrix& matrix, std::span<const std::string> names) {
  const MatrixLayout layout = matrix_layout(names);
  const std::string title = "Confusion matrix";
  const double width = std::max(470.0, layout.left + layout.width() + 30.0);
  SvgDrawing drawing(width, layout.top + layout.height() + 84.0, title);
  std::size_t all = 0;
  std::size_t right = 0;
  std::size_t withheld = 0;
  for (std::size_t o = 0; o < names.size(); ++o) {
    for (const std::size_t views : matrix.views[o]) all += views;
    right += matrix.views[o][o];
    withheld += matrix.views[o].back();
  }
  add_heading(drawing, 26.0, title,
              count_of(all, "view") + ": " + percent(rate_of(right, all)) + " answered right, " +
                  percent(rate_of(all - right - withheld, all)) + " wrong, " +
                  percent(rate_of(withheld, all)) + " withheld");
  draw_matrix_labels(drawing, layout, names);
  drawing.box("cell", {layout.left, layout.top, layout.height(), layout.height()});
  const SvgBox last = layout.box(0, layout.objects);
  drawing.box("cell", {last.x, last.y, layout.cell, layout.height()});
  for (std::size_t o = 0; o < names.size(); ++o) draw_row(drawing, layout, matrix.views[o], names, o);
  draw_legend(drawing, 26.0, layout.top + layout.height() + 38.0);
  return drawing.file();
}

}  // namespace eigenpose
