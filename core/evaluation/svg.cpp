#include "core/evaluation/svg.h"

#include <array>
#include <charconv>
#include <cmath>

#include "core/base/printable.h"

namespace eigenpose {
namespace {

constexpr std::string_view style_sheet = R"(<style>
text { font-family: "Inter", "Helvetica Neue", "Segoe UI", Arial, "DejaVu Sans", sans-serif; font-size: 12px; }
.paper { fill: #ffffff; stroke: #e2e8f0; }
.ink { fill: #0f172a; }
.muted { fill: #64748b; }
.title { font-size: 17px; font-weight: 600; }
.subtitle { font-size: 12.5px; }
.strong { font-weight: 600; }
.start { text-anchor: start; }
.middle { text-anchor: middle; }
.end { text-anchor: end; }
.grid { stroke: #e2e8f0; stroke-width: 1; fill: none; }
.fine { stroke: #f1f5f9; stroke-width: 1; fill: none; }
.axis { stroke: #94a3b8; stroke-width: 1; fill: none; }
.dashed { stroke-dasharray: 5 4; }
.curve { stroke: #2563eb; stroke-width: 2.2; stroke-linejoin: round; stroke-linecap: round; fill: none; }
.whisker { stroke: #1e3a8a; stroke-width: 1.4; fill: none; }
.right { fill: #2563eb; }
.wrong { fill: #dc2626; }
.withheld { fill: #b45309; }
.quiet { fill: #94a3b8; }
.cell { fill: #f1f5f9; }
.on { fill: #ffffff; }
.mark { stroke: #e11d48; stroke-width: 1.2; fill: none; }
.dot { fill: #e11d48; stroke: #ffffff; stroke-width: 2; }
.marked { fill: #e11d48; }
@media (prefers-color-scheme: dark) {
.paper { fill: #0f172a; stroke: #1e293b; }
.ink { fill: #f1f5f9; }
.muted { fill: #94a3b8; }
.grid { stroke: #27354b; }
.fine { stroke: #182338; }
.axis { stroke: #64748b; }
.curve { stroke: #60a5fa; }
.whisker { stroke: #bfdbfe; }
.right { fill: #3b82f6; }
.wrong { fill: #ef4444; }
.withheld { fill: #d97706; }
.quiet { fill: #64748b; }
.cell { fill: #182338; }
.mark { stroke: #fb7185; }
.dot { fill: #fb7185; stroke: #0f172a; }
.marked { fill: #fb7185; }
}
</style>
)";

std::string attribute(std::string_view name, std::string_view value) {
  return std::string(" ").append(name).append("=\"").append(value).append("\"");
}

std::string attribute(std::string_view name, double value) {
  return attribute(name, svg_number(value));
}

std::string styled(std::string_view element, std::string_view style) {
  return std::string("<").append(element).append(attribute("class", style));
}

}  // namespace

std::string xml_text(std::string_view text) {
  std::string result;
  for (const char c : printable(text)) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      case '\'':
        result += "&apos;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string svg_number(double value) {
  const double rounded = std::round(100.0 * value) / 100.0;
  std::array<char, 40> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), rounded == 0.0 ? 0.0 : rounded,
                                 std::chars_format::fixed);
  return {digits.data(), end.ptr};
}

SvgDrawing::SvgDrawing(double width, double height, std::string_view title) {
  body_ = R"(<svg xmlns="http://www.w3.org/2000/svg" role="img")" + attribute("width", width) +
          attribute("height", height) +
          attribute("viewBox", "0 0 " + svg_number(width) + " " + svg_number(height)) + ">\n<title>" +
          xml_text(title) + "</title>\n";
  body_ += style_sheet;
  body_ += styled("rect", "paper") + attribute("x", 0.5) + attribute("y", 0.5) +
           attribute("width", width - 1.0) + attribute("height", height - 1.0) + attribute("rx", 10.0) +
           "/>\n";
}

void SvgDrawing::line(std::string_view style, SvgPoint from, SvgPoint to) {
  body_ += styled("line", style) + attribute("x1", from.x) + attribute("y1", from.y) + attribute("x2", to.x) +
           attribute("y2", to.y) + "/>\n";
}

void SvgDrawing::polyline(std::string_view style, std::span<const SvgPoint> points) {
  std::string places;
  for (const SvgPoint& point : points)
    places += (places.empty() ? "" : " ") + svg_number(point.x) + "," + svg_number(point.y);
  body_ += styled("polyline", style) + attribute("points", places) + "/>\n";
}

void SvgDrawing::circle(std::string_view style, SvgPoint centre, double radius) {
  body_ += styled("circle", style) + attribute("cx", centre.x) + attribute("cy", centre.y) +
           attribute("r", radius) + "/>\n";
}

void SvgDrawing::box(std::string_view style, const SvgBox& box, double opacity, std::string_view tooltip) {
  body_ += styled("rect", style) + attribute("x", box.x) + attribute("y", box.y) +
           attribute("width", box.width) + attribute("height", box.height);
  if (opacity < 1.0) body_ += attribute("fill-opacity", opacity);
  body_ += tooltip.empty() ? "/>\n" : "><title>" + xml_text(tooltip) + "</title></rect>\n";
}

void SvgDrawing::text(std::string_view style, SvgPoint at, std::string_view words, double degrees) {
  text_of_size(style, at, words, 0.0, degrees);
}

void SvgDrawing::text_of_size(std::string_view style, SvgPoint at, std::string_view words, double size,
                              double degrees) {
  body_ += styled("text", style) + attribute("x", at.x) + attribute("y", at.y);
  if (size > 0.0) body_ += attribute("style", "font-size:" + svg_number(size) + "px");
  if (degrees != 0.0)
    body_ += attribute(
        "transform", "rotate(" + svg_number(degrees) + " " + svg_number(at.x) + " " + svg_number(at.y) + ")");
  body_ += ">" + xml_text(words) + "</text>\n";
}

std::string SvgDrawing::file() const {
  return body_ + "</svg>\n";
}

}  // namespace eigenpose
