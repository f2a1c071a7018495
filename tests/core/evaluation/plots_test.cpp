#include "core/evaluation/plots.h"

#include <algorithm>
#include <limits>

#include <gmock/gmock.h>

#include "core/evaluation/svg.h"
#include "tests/core/evaluation/made_records.h"

namespace eigenpose {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::made_record;
using ::testing::Not;
using testing::nothing_found;
using testing::unknown_object;

/// What is wrong with the XML of `text`, or nothing: tags that do not close in turn, characters that must be
/// escaped, references that XML does not define, text outside the one root.
std::string fault_of_xml(const std::string& text) {
  std::vector<std::string> open;
  std::size_t at = 0;
  bool root_ended = false;
  while (at < text.size()) {
    if (text[at] == '<') {
      const std::size_t end = text.find('>', at);
      if (end == std::string::npos) return "a tag does not end: " + text.substr(at, 40);
      const std::string tag = text.substr(at + 1, end - at - 1);
      if (tag.find('<') != std::string::npos) return "< within the tag " + tag;
      if (std::ranges::count(tag, '"') % 2 != 0) return "an odd number of quotes in " + tag;
      if (root_ended) return "after the root: " + tag;
      if (tag.front() == '/') {
        if (open.empty() || open.back() != tag.substr(1)) return "</" + tag.substr(1) + "> closes nothing";
        open.pop_back();
        root_ended = open.empty();
      } else if (tag.back() != '/') {
        open.push_back(tag.substr(0, tag.find(' ')));
      }
      at = end + 1;
      continue;
    }
    if (text[at] == '&') {
      const std::string reference = text.substr(at, text.find(';', at) - at + 1);
      if (reference != "&amp;" && reference != "&lt;" && reference != "&gt;" && reference != "&quot;" &&
          reference != "&apos;")
        return "no reference: " + reference;
    }
    if (open.empty() && text[at] != '\n') return "text outside the root";
    ++at;
  }
  return open.empty() ? "" : open.back() + " is not closed";
}

std::size_t occurrences(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST(Svg, EscapesTextAndMakesControlCharactersPrintable) {
  EXPECT_EQ(xml_text("a<b>&\"c\"'d'"), "a&lt;b&gt;&amp;&quot;c&quot;&apos;d&apos;");
  EXPECT_EQ(xml_text("a\x01\n"), "a\\x01\\n");
  EXPECT_EQ(xml_text("Maß ≥ 1"), "Maß ≥ 1");
}

TEST(Svg, WritesLengthsInTwoDigitsAtMost) {
  EXPECT_EQ(svg_number(12.0), "12");
  EXPECT_EQ(svg_number(0.125), "0.13");
  EXPECT_EQ(svg_number(-0.001), "0");
  EXPECT_EQ(svg_number(-3.5), "-3.5");
}

TEST(Svg, IsWellFormedWhateverTheWordsAre) {
  SvgDrawing drawing(100.0, 50.0, "<title> & \"more\"");
  drawing.text("ink", {1.0, 2.0}, "</svg>", 45.0);
  drawing.box("right", {0.0, 0.0, 1.0, 1.0}, 0.5, "a & b");
  drawing.line("axis", {0.0, 0.0}, {1.0, 1.0});
  drawing.circle("dot", {1.0, 1.0}, 2.0);
  drawing.polyline("curve", std::vector<SvgPoint>{{0.0, 0.0}, {1.0, 2.5}});
  const std::string file = drawing.file();
  EXPECT_EQ(fault_of_xml(file), "");
  EXPECT_THAT(file, AllOf(HasSubstr("points=\"0,0 1,2.5\""), HasSubstr("rotate(45 1 2)"),
                          HasSubstr("fill-opacity=\"0.5\""), HasSubstr("prefers-color-scheme: dark")));
}

EvidenceCurve small_curve() {
  EvidenceCurve curve;
  curve.known = 1000;
  curve.unknown = 100;
  curve.points = {{-3.0, 0.0, 1.0, 0.0},
                  {0.0, 0.001, 0.1, 0.0},
                  {2.0, 0.1, 0.01, 0.0},
                  {std::numeric_limits<double>::infinity(), 1.0, 0.0, 0.0}};
  curve.in_use = {0.0, 0.001, 0.1, 0.0};
  return curve;
}

TEST(CurveSvg, ShowsThePointInUseAndItsRates) {
  const std::string file = curve_svg(small_curve());
  EXPECT_EQ(fault_of_xml(file), "");
  EXPECT_EQ(occurrences(file, "class=\"dot\""), 1U);
  EXPECT_THAT(file,
              AllOf(HasSubstr("in use: evidence ≥ 0<"), HasSubstr("0.10 % of 1000 known views rejected"),
                    HasSubstr("10.00 % of 100 unknown views falsely accepted")));
}

TEST(CurveSvg, PlacesRatesByDecadesAndZeroOneDecadeBelow) {
  // 92 + 580 across: 0, 1 %, 10 %, 100 % are a third each; 484 − 400 up: 0, 0.1 %, …, 100 % a quarter each.
  const std::string file = curve_svg(small_curve());
  EXPECT_THAT(file, HasSubstr("cx=\"478.67\" cy=\"384\""));
  EXPECT_THAT(file, HasSubstr("points=\"672,484 478.67,384 285.33,184 92,84\""));
}

TEST(CurveSvg, KeepsTheWordsOfThePointInUseInsideTheFrame) {
  EvidenceCurve curve = small_curve();
  EXPECT_THAT(curve_svg(curve), HasSubstr("class=\"marked strong end\""));
  curve.in_use = {2.0, 0.1, 0.01, 0.0};
  EXPECT_THAT(curve_svg(curve), HasSubstr("class=\"marked strong start\""));
}

TEST(ReliabilitySvg, ShowsEveryBinThatHoldsRegionsAndTheExpectedCalibrationError) {
  Reliability reliability;
  reliability.regions = 5;
  reliability.unknown = 1;
  reliability.expected_calibration_error = 0.0345;
  reliability.bins[9] = {.regions = 4, .right = 3, .mean_confidence = 0.95};
  reliability.bins[2] = {.regions = 1, .right = 0, .mean_confidence = 0.25};
  const std::string file = reliability_svg(reliability);
  EXPECT_EQ(fault_of_xml(file), "");
  EXPECT_THAT(file, AllOf(HasSubstr("expected calibration error 3.45 % over 5 regions, 1 of unknown objects"),
                          HasSubstr("<title>4 regions, 75.00 % right, mean confidence 0.95</title>"),
                          HasSubstr("<title>1 region, 0 % right, mean confidence 0.25</title>"),
                          HasSubstr("cx=\"502\" cy=\"194\"")));
  EXPECT_EQ(occurrences(file, "<circle"), 2U);
}

TEST(ReliabilitySvg, DrawsTheWilsonIntervalOfEachBin) {
  // 95 % of 3 in 4: 0.3006…0.9544; of 0 in 1: 0…0.7935. Shares go from 524 up to 84, confidences from 84 to
  // 524.
  Reliability reliability;
  reliability.regions = 5;
  reliability.bins[9] = {.regions = 4, .right = 3, .mean_confidence = 0.95};
  reliability.bins[2] = {.regions = 1, .right = 0, .mean_confidence = 0.25};
  const std::string file = reliability_svg(reliability);
  EXPECT_THAT(file, HasSubstr(R"(class="whisker" x1="502" y1="391.72" x2="502" y2="104.06")"));
  EXPECT_THAT(file, HasSubstr(R"(class="whisker" x1="194" y1="524" x2="194" y2="174.88")"));
}

TEST(ConfusionSvg, ColoursEachCellThatHoldsViewsByWhatItMeans) {
  const std::vector records{
      made_record(0, 0, Verdict::recognized), made_record(0, 0, Verdict::recognized),
      made_record(0, 0, Verdict::recognized), made_record(0, 1, Verdict::recognized),
      made_record(1, 1, Verdict::unknown),    unknown_object(made_record(1, 0, Verdict::recognized))};
  const std::string file =
      confusion_svg(confusion_matrix(records, 2), std::vector<std::string>{"mug", "<duck>"});
  EXPECT_EQ(fault_of_xml(file), "");
  EXPECT_THAT(file, AllOf(HasSubstr("mug called mug, 3 of 4 views"),
                          HasSubstr("mug called &lt;duck&gt;, 1 of 4 views"),
                          HasSubstr("&lt;duck&gt;: withheld, 1 of 1 view<"),
                          HasSubstr("5 views: 60.00 % answered right, 20.00 % wrong, 20.00 % withheld"),
                          Not(HasSubstr("&lt;duck&gt; called"))));
  EXPECT_EQ(occurrences(file, "fill-opacity=\"0.63\""), 1U) << "a quarter: 0.25 + 0.75 √0.25 of the colour";
}

TEST(ConfusionSvg, CanBeReadWithTwoAndWithAHundredObjects) {
  for (const std::size_t count : {2U, 100U}) {
    std::vector<std::string> names;
    std::vector<RegionRecord> records;
    for (std::size_t o = 0; o < count; ++o) {
      names.push_back("a_name_of_twenty-two_" + std::to_string(o % 10));
      records.push_back(made_record(o, o, Verdict::recognized));
    }
    const std::string file = confusion_svg(confusion_matrix(records, count), names);
    EXPECT_EQ(fault_of_xml(file), "");
    EXPECT_EQ(occurrences(file, " views</title>") + occurrences(file, " view</title>"), count);
    EXPECT_EQ(occurrences(file, "a_name_of_twenty-tw…<"), 2 * count) << "each row and column has its label";
  }
}

}  // namespace
}  // namespace eigenpose
