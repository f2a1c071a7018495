#include "core/dataset/coil_import.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/dataset/natural_order.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;

/// Pictures of one object by the number in their names.
using Numbered = std::map<double, fs::path>;
using Objects = std::map<std::string, Numbered, NaturalLess>;

/// A gap counts as one when it is larger than this many even steps.
constexpr double gap_steps = 2.5;
constexpr double same_angle_deg = 1e-6;

/// "obj3__17.png" → obj3, 17.
std::optional<std::pair<std::string, double>> parse_name(const std::string& name) {
  constexpr std::string_view extension = ".png";
  const auto mark = name.rfind("__");
  if (!name.ends_with(extension) || mark == std::string::npos || mark == 0) return std::nullopt;
  const char* first = name.data() + mark + 2;
  const char* last = name.data() + name.size() - extension.size();
  double number = 0;
  const auto [end, error] = std::from_chars(first, last, number, std::chars_format::fixed);
  if (error != std::errc() || end != last || first == last || !(number >= 0.0)) return std::nullopt;
  return std::pair(name.substr(0, mark), number);
}

Objects list_objects(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error))
    throw FileError(folder, "is not a folder; give the one that holds the pictures");
  Objects objects;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with('.')) continue;
    const auto parsed = entry.is_regular_file() ? parse_name(name) : std::nullopt;
    if (!parsed)
      throw FileError(entry.path(),
                      "is not named as COIL pictures are (obj3__17.png); move it out of the folder");
    const auto [at, fresh] = objects[parsed->first].emplace(parsed->second, entry.path());
    if (!fresh)
      throw FileError(entry.path(), "and " + at->second.string() + " have the same number; remove one");
  }
  if (objects.empty()) throw FileError(folder, "holds no picture; COIL pictures are named obj3__17.png");
  return objects;
}

/// "22.5": at most two decimals.
std::string degrees_text(double value) {
  std::string text = std::to_string(std::round(value * 100.0) / 100.0);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

/// The largest gap between neighbouring angles of a turn.
struct Gap {
  double after = 0.0;  ///< begins there, degrees
  double size = 0.0;   ///< degrees
};

/// @throws FileError unless the numbers are at least 3 different angles within one turn.
Gap check_turn(const std::string& object, const Numbered& pictures, const fs::path& folder,
               double degrees_per_step) {
  if (pictures.size() < 3)
    throw FileError(folder, "has " + std::to_string(pictures.size()) + " picture(s) of \"" + object +
                                "\"; a turn needs at least 3");
  Gap largest;
  const double first = pictures.begin()->first * degrees_per_step;
  for (auto at = pictures.begin(); at != pictures.end(); ++at) {
    const double angle = at->first * degrees_per_step;
    if (angle - first >= 360.0 - same_angle_deg)
      throw FileError(at->second,
                      "would show \"" + object + "\" at " + degrees_text(angle) +
                          " degrees, a full turn or more after its first picture; --angle is wrong, "
                          "or the picture belongs to another turn");
    const auto next = std::next(at);
    const double gap = (next != pictures.end() ? next->first * degrees_per_step : first + 360.0) - angle;
    if (gap > largest.size) largest = {angle, gap};
  }
  return largest;
}

/// What is uneven about a turn of `count` views; empty where nothing is.
std::string gap_text(const std::string& object, const Gap& gap, std::size_t count, double limit) {
  const double even = 360.0 / static_cast<double>(count);
  if (gap.size <= limit * even + same_angle_deg) return {};
  return "the " + std::to_string(count) + " views of \"" + object + "\" leave a gap of " +
         degrees_text(gap.size) + " degrees after " + degrees_text(gap.after) +
         "; evenly spaced ones would stand " + degrees_text(even) +
         " degrees apart: a picture is missing, or --angle is wrong";
}

}  // namespace

ImportReport import_coil(const fs::path& folder, const fs::path& root, const CoilImportOptions& options,
                         const Progress& progress, std::stop_token stop) {
  const double step = options.angle.degrees_per_step;
  if (!(step > 0.0) || !std::isfinite(step))
    throw std::invalid_argument("degrees per step is " + std::to_string(step) + ", must be above 0");
  ViewImport import;
  import.workspace = turntable_workspace();
  import.kind = options.views;
  import.bad_views = options.bad_views;
  std::vector<std::string> warnings;
  for (const auto& [name, pictures] : list_objects(folder)) {
    const Gap gap = check_turn(name, pictures, folder, step);
    const bool strict = options.bad_views == BadViews::refuse;
    const std::string uneven = gap_text(name, gap, pictures.size(), strict ? 1.0 : gap_steps);
    if (strict && !uneven.empty()) throw FileError(folder, uneven);
    if (!uneven.empty()) warnings.push_back(uneven);
    ImportObject object{name, {}};
    for (const auto& [number, file] : pictures) object.views.push_back({file, {number * step}});
    import.objects.push_back(std::move(object));
  }
  const nlohmann::json source = {
      {"imported_from", fs::absolute(folder).string()}, {"naming", "coil"}, {"degrees_per_step", step}};
  ImportReport report = import_views(import, root, source, progress, stop);
  report.warnings.insert(report.warnings.begin(), warnings.begin(), warnings.end());
  return report;
}

}  // namespace eigenpose
