#pragma once

/// Drawings as SVG 1.1: shapes and text with a style each, on paper of their own, so that they can be read on
/// light and on dark pages. Where the reader prefers dark pages, paper and ink change places.

#include <span>
#include <string>
#include <string_view>

namespace eigenpose {

/// `text` as character data or attribute value of XML: & < > " ' are escaped; control characters and
/// bytes that are not UTF-8 are made printable.
std::string xml_text(std::string_view text);

/// A length or place in pixels: at most two digits after the point, none that say nothing.
std::string svg_number(double value);

struct SvgPoint {
  double x = 0.0;  ///< pixels, to the right
  double y = 0.0;  ///< pixels, down
};

struct SvgBox {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;
};

/// One drawing. The style of a shape is a list of classes of the style sheet in svg.cpp: ink, muted, grid,
/// axis, curve, area, right, wrong, withheld, mark, …
class SvgDrawing {
 public:
  /// @param title what it shows, for those who cannot see it; escaped here.
  SvgDrawing(double width, double height, std::string_view title);

  void line(std::string_view style, SvgPoint from, SvgPoint to);
  void polyline(std::string_view style, std::span<const SvgPoint> points);
  void circle(std::string_view style, SvgPoint centre, double radius);
  /// @param tooltip shown under the pointer; empty: none. @param opacity 0…1
  void box(std::string_view style, const SvgBox& box, double opacity = 1.0, std::string_view tooltip = {});
  /// Text of one line whose base line begins, has its middle or ends at `at` as the style says (start,
  /// middle, end). @param degrees it is turned by, clockwise.
  void text(std::string_view style, SvgPoint at, std::string_view words, double degrees = 0.0);
  /// The same in another font size, pixels.
  void text_of_size(std::string_view style, SvgPoint at, std::string_view words, double size,
                    double degrees = 0.0);

  /// The whole file. The drawing takes more shapes afterwards.
  [[nodiscard]] std::string file() const;

 private:
  std::string body_;
};

}  // namespace eigenpose
