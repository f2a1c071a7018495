#include "core/dataset/table_import.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>
#include <string_view>

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/object_name.h"
#include "core/dataset/csv.h"
#include "core/dataset/natural_order.h"

namespace eigenpose {
namespace {

namespace fs = std::filesystem;

/// A unit and the period of an angle in it; 0 where it measures no angle.
struct Unit {
  std::string_view name;
  double period = 0.0;
};
constexpr std::array<Unit, 10> units{{{"deg", 360.0},
                                      {"rad", 2.0 * std::numbers::pi},
                                      {"um"},
                                      {"mm"},
                                      {"cm"},
                                      {"m"},
                                      {"s"},
                                      {"ms"},
                                      {"percent"},
                                      {"lux"}}};
/// An angle whose values leave no larger gap closes: 120 of 360 degrees.
constexpr double largest_gap_of_a_turn = 1.0 / 3.0;
constexpr double largest_value = 1e9;

/// One column that is a DOF.
struct DofColumn {
  std::size_t index = 0;
  std::string header;  ///< table_deg
  std::string name;    ///< table
  Unit unit;
  std::vector<double> values = {};  ///< one a row
};

/// A table and how it is to be read; finds columns and says what is wrong with them.
class PoseTable {
 public:
  PoseTable(const fs::path& file, const TableImportOptions& options)
      : file_(file), options_(options), csv_(read_csv(file)) {
    find_columns();
    check_options();
    for (DofColumn& column : columns_)
      for (const CsvRow& row : csv_.rows) column.values.push_back(number(row, column));
  }

  [[nodiscard]] ViewImport views(std::vector<std::string>& notes);

 private:
  [[noreturn]] void fail(const std::string& what) const { throw FileError(file_, what); }
  [[noreturn]] void fail(const CsvRow& row, const std::string& what) const {
    fail("line " + std::to_string(row.line) + ": " + what);
  }
  void find_columns();
  void check_options() const;
  [[nodiscard]] double number(const CsvRow& row, const DofColumn& column) const;
  [[nodiscard]] Dof dof(const DofColumn& column) const;
  [[nodiscard]] fs::path picture(const CsvRow& row) const;
  [[nodiscard]] std::string object(const CsvRow& row) const;

  const fs::path& file_;
  const TableImportOptions& options_;
  CsvTable csv_;
  std::size_t file_column_ = 0;
  std::size_t object_column_ = 0;
  std::vector<DofColumn> columns_;
};

bool named(const std::vector<std::string>& names, const DofColumn& column) {
  return std::any_of(names.begin(), names.end(),
                     [&](const std::string& name) { return name == column.header || name == column.name; });
}

void PoseTable::find_columns() {
  const auto find = [&](std::string_view name) {
    const auto found = std::find(csv_.header.begin(), csv_.header.end(), name);
    if (found != csv_.header.end()) return static_cast<std::size_t>(found - csv_.header.begin());
    if (csv_.header.size() == 1 && csv_.header.front().find_first_of(";\t") != std::string::npos)
      fail("line 1: its columns are not separated by commas; save the table as comma-separated values");
    fail("line 1: there is no column \"" + std::string(name) +
         "\"; the first line names the columns: file,object,table_deg");
  };
  file_column_ = find("file");
  object_column_ = find("object");
  for (std::size_t i = 0; i < csv_.header.size(); ++i) {
    const std::string& header = csv_.header[i];
    if (std::count(csv_.header.begin(), csv_.header.end(), header) > 1)
      fail("line 1: two columns are named \"" + header + "\"");
    if (i == file_column_ || i == object_column_ ||
        std::find(options_.ignore.begin(), options_.ignore.end(), header) != options_.ignore.end())
      continue;
    const auto mark = header.rfind('_');
    const std::string_view ending =
        mark == std::string::npos ? std::string_view() : std::string_view(header).substr(mark + 1);
    const auto unit =
        std::find_if(units.begin(), units.end(), [&](const Unit& known) { return known.name == ending; });
    if (unit == units.end() || mark == 0)
      fail("line 1: column \"" + header + "\" does not end in a unit (" + table_units() +
           "), as table_deg does; name it so, or ignore it");
    columns_.push_back({i, header, header.substr(0, mark), *unit});
  }
  for (const DofColumn& a : columns_)
    for (const DofColumn& b : columns_)
      if (a.index < b.index && a.name == b.name)
        fail("line 1: the columns \"" + a.header + "\" and \"" + b.header + "\" are one DOF in two units");
  if (columns_.empty())
    fail("line 1: no column gives a pose; add one whose name ends in its unit, such as table_deg");
}

void PoseTable::check_options() const {
  const auto check = [&](const std::vector<std::string>& names, const std::string& what) {
    const auto is_there = [&](const std::string& name) {
      return std::any_of(columns_.begin(), columns_.end(), [&](const DofColumn& column) {
        return name == column.header || name == column.name;
      });
    };
    const auto missing = std::find_if_not(names.begin(), names.end(), is_there);
    if (missing != names.end())
      throw std::invalid_argument("\"" + *missing + "\" is to be " + what + ", but no column of " +
                                  file_.string() + " is named so");
  };
  check(options_.periodic, "periodic");
  check(options_.open, "open");
  for (const std::string& name : options_.ignore)
    if (std::find(csv_.header.begin(), csv_.header.end(), name) == csv_.header.end() || name == "file" ||
        name == "object")
      throw std::invalid_argument("\"" + name + "\" is to be ignored, but " + file_.string() +
                                  " has no such column beside file and object");
  for (const DofColumn& column : columns_) {
    if (!named(options_.periodic, column)) continue;
    if (named(options_.open, column))
      throw std::invalid_argument("\"" + column.header + "\" is to be periodic and open");
    if (column.unit.period == 0.0)
      throw std::invalid_argument("\"" + column.header + "\" is to be periodic, but " +
                                  std::string(column.unit.name) + " is no unit of angles");
  }
}

double PoseTable::number(const CsvRow& row, const DofColumn& column) const {
  std::string_view text = row.fields[column.index];
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  if (text.empty()) fail(row, column.header + " is empty; every view needs its whole pose");
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    fail(row, column.header + " is \"" + row.fields[column.index] +
                  "\", which is no number; write it as 12.5, without a unit");
  if (std::abs(value) > largest_value)
    fail(row, column.header + " is " + row.fields[column.index] + ", beyond ±1e9");
  return value;
}

/// Largest gap between neighbouring values around the circle, as a share of it.
double largest_gap(const std::vector<double>& values, double period) {
  std::vector<double> turned;
  turned.reserve(values.size());
  for (const double value : values) turned.push_back(value - period * std::floor(value / period));
  std::sort(turned.begin(), turned.end());
  double gap = turned.front() + period - turned.back();
  for (std::size_t i = 1; i < turned.size(); ++i) gap = std::max(gap, turned[i] - turned[i - 1]);
  return gap / period;
}

Dof PoseTable::dof(const DofColumn& column) const {
  const auto [lowest, highest] = std::minmax_element(column.values.begin(), column.values.end());
  Dof dof{column.name, std::string(column.unit.name), *lowest, *highest, false};
  const bool angle = column.unit.period > 0.0;
  // A tolerance for turns of exactly three views, whose thirds are rounded.
  const bool closes =
      angle && (named(options_.periodic, column) ||
                (!named(options_.open, column) &&
                 largest_gap(column.values, column.unit.period) <= largest_gap_of_a_turn + 1e-6));
  if (!closes) return dof;
  dof.lower = 0.0;
  dof.upper = column.unit.period;
  dof.periodic = true;
  return dof;
}

fs::path PoseTable::picture(const CsvRow& row) const {
  const std::string& name = row.fields[file_column_];
  if (name.empty()) fail(row, "file is empty; every row names a picture");
  fs::path path = fs::path(name).is_absolute() ? fs::path(name) : file_.parent_path() / name;
  std::error_code error;
  if (!fs::is_regular_file(path, error))
    fail(row, "there is no picture \"" + path.string() + "\"; a file is relative to the table's folder");
  return path;
}

std::string PoseTable::object(const CsvRow& row) const {
  const std::string& name = row.fields[object_column_];
  try {
    check_object_name(name);
  } catch (const std::invalid_argument& wrong) {
    fail(row, wrong.what());
  }
  return name;
}

ViewImport PoseTable::views(std::vector<std::string>& notes) {
  std::erase_if(columns_, [&](const DofColumn& column) {
    const bool constant = std::all_of(column.values.begin(), column.values.end(),
                                      [&](double value) { return value == column.values.front(); });
    if (constant)
      notes.push_back("\"" + column.header +
                      "\" has the same value in every row; it is no degree of freedom");
    return constant;
  });
  if (columns_.empty()) fail("all views have the same pose; a column must change from row to row");
  std::vector<Dof> dofs;
  for (const DofColumn& column : columns_) dofs.push_back(dof(column));
  ViewImport import;
  import.workspace = Workspace(std::move(dofs));
  import.kind = options_.views;
  import.bad_views = options_.bad_views;
  std::map<std::string, std::vector<ImportView>, NaturalLess> objects;
  std::map<std::pair<std::string, fs::path>, std::size_t> lines;
  for (std::size_t r = 0; r < csv_.rows.size(); ++r) {
    const CsvRow& row = csv_.rows[r];
    ImportView view{picture(row), {}};
    for (const DofColumn& column : columns_) view.q.push_back(column.values[r]);
    const std::string name = object(row);
    const auto [at, fresh] = lines.emplace(std::pair(name, view.file.lexically_normal()), row.line);
    if (!fresh)
      fail(row, "\"" + row.fields[file_column_] + "\" is listed for \"" + name + "\" in line " +
                    std::to_string(at->second) + " already");
    objects[name].push_back(std::move(view));
  }
  for (auto& [name, views] : objects) import.objects.push_back({name, std::move(views)});
  return import;
}

}  // namespace

std::string table_units() {
  std::string text;
  for (const Unit& unit : units) text += (text.empty() ? "" : ", ") + std::string(unit.name);
  return text;
}

ImportReport import_table(const fs::path& table, const fs::path& root, const TableImportOptions& options,
                          const Progress& progress, const std::stop_token& stop) {
  std::vector<std::string> notes;
  const ViewImport import = PoseTable(table, options).views(notes);
  const nlohmann::json source = {{"imported_from", fs::absolute(table).string()}, {"naming", "table"}};
  ImportReport report = import_views(import, root, source, progress, stop);
  report.warnings.insert(report.warnings.begin(), notes.begin(), notes.end());
  return report;
}

}  // namespace eigenpose
