#include "core/learning/calibration_file.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

namespace eigenpose {
namespace {

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();
constexpr Eigen::Index color_rows = 1 + 2;  // whether there are any, ColorMatch
constexpr Eigen::Index whole_rows = 3 + color_rows;
constexpr Eigen::Index windows_rows = 1 + whole_rows + 4;       // taken_for, whole, windows
constexpr Eigen::Index occluded_rows = 1 + 4 + 4 + color_rows;  // taken_for, windows, four more, colours
constexpr Eigen::Index probe_rows =
    1 + 3 + whole_rows + 1 + windows_rows + 1 + occluded_rows;  // view, what for, whole …

/// Numbers of one probe on their way into a column.
class ColumnWriter {
 public:
  explicit ColumnWriter(const Eigen::Ref<Eigen::VectorXd>& column) : column_(column) {}
  void number(double value) { column_(row_++) = value; }
  void index(std::size_t value, std::size_t /*below*/) { number(static_cast<double>(value)); }
  void optional(const std::optional<double>& value) { number(value.value_or(no_value)); }
  /// @return whether there is one: its members follow.
  template <typename T>
  bool present(const std::optional<T>& value) {
    number(value ? 1.0 : 0.0);
    return value.has_value();
  }
  void flag(bool value) { number(value ? 1.0 : 0.0); }
  void skip(Eigen::Index numbers) {
    for (Eigen::Index i = 0; i < numbers; ++i) number(0.0);
  }

 private:
  Eigen::Ref<Eigen::VectorXd> column_;
  Eigen::Index row_ = 0;
};

/// The way back. @throws Hdf5Failure for numbers that cannot be.
class ColumnReader {
 public:
  explicit ColumnReader(const Eigen::Ref<const Eigen::VectorXd>& column) : column_(column) {}
  void number(double& value) {
    value = column_(row_++);
    if (!std::isfinite(value)) throw Hdf5Failure("has a calibration whose numbers are not finite");
  }
  void index(std::size_t& value, std::size_t below) {
    const double found = column_(row_++);
    if (!(found >= 0.0 && found < static_cast<double>(below)))
      throw Hdf5Failure("has a calibration that does not fit its views");
    value = static_cast<std::size_t>(found);
  }
  void optional(std::optional<double>& value) {
    if (std::isnan(column_(row_)))
      ++row_;
    else
      number(value.emplace());
  }
  template <typename T>
  bool present(std::optional<T>& value) {
    bool there = false;
    flag(there);
    if (there) value.emplace();
    return there;
  }
  void flag(bool& value) {
    std::size_t found = 0;
    index(found, 2);
    value = found == 1;
  }
  void skip(Eigen::Index numbers) { row_ += numbers; }

 private:
  Eigen::Ref<const Eigen::VectorXd> column_;
  Eigen::Index row_ = 0;
};

void visit_color(auto& match, auto& column) {
  if (column.present(match)) {
    column.number(match->distance);
    column.number(match->typical);
  } else {
    column.skip(color_rows - 1);
  }
}

void visit_whole(auto& match, auto& column) {
  column.number(match.distance);
  column.number(match.typical);
  column.number(match.other);
  visit_color(match.color, column);
}

void visit_windows(auto& match, auto& column) {
  column.number(match.votes);
  column.number(match.typical_votes);
  column.number(match.discriminating);
  column.optional(match.next);
}

/// A probe but for its object: `probe_rows` numbers, that of the shown view among them.
void visit_probe(auto& probe, std::size_t objects, auto& column) {
  column.index(probe.taken_for, objects);
  column.flag(probe.known);
  column.flag(probe.hidden);
  visit_whole(probe.whole, column);
  if (column.present(probe.windows)) {
    column.index(probe.windows->taken_for, objects);
    visit_whole(probe.windows->whole, column);
    visit_windows(probe.windows->windows, column);
  } else {
    column.skip(windows_rows);
  }
  if (column.present(probe.occluded)) {
    column.index(probe.occluded->taken_for, objects);
    visit_windows(probe.occluded->match.windows, column);
    column.number(probe.occluded->match.occluded);
    column.number(probe.occluded->match.merit);
    column.number(probe.occluded->match.unexplained);
    column.number(probe.occluded->match.foreign_likeness);
    visit_color(probe.occluded->match.color, column);
  } else {
    column.skip(occluded_rows);
  }
}

void write_columns(const Hdf5Group& group, const std::string& name, const Eigen::MatrixXd& matrix) {
  if (matrix.cols() > 0) group.write(name, matrix);
}

Eigen::MatrixXd read_columns(const Hdf5Group& group, const std::string& name, Eigen::Index rows) {
  Eigen::MatrixXd matrix(rows, 0);
  if (group.has(name)) matrix = group.read_doubles(name);
  if (matrix.rows() != rows) throw Hdf5Failure("has a calibration that does not fit its views");
  return matrix;
}

void write_object(const Hdf5Group& group, const ObjectRecord& record) {
  Eigen::MatrixXd misalignments(Misalignment::unknowns,
                                static_cast<Eigen::Index>(record.misalignments.size()));
  Eigen::Index column = 0;
  for (const Misalignment& m : record.misalignments)
    misalignments.col(column++) << m.gain, m.dx, m.dy, m.scale, m.rotation;
  write_columns(group, "misalignments", misalignments);
  Eigen::MatrixXd votes(3, static_cast<Eigen::Index>(record.votes.votes.size()));
  column = 0;
  for (const auto& shares : record.votes.votes) votes.col(column++) << shares[0], shares[1], shares[2];
  write_columns(group, "votes", votes);
  Eigen::MatrixXd colors(2, static_cast<Eigen::Index>(record.votes.colors.size()));
  column = 0;
  for (const auto& distances : record.votes.colors) colors.col(column++) << distances[0], distances[1];
  write_columns(group, "colors", colors);
  group.write("foreign", record.votes.foreign);
}

ObjectRecord read_object_record(const Hdf5Group& group, const ObjectViews& object) {
  ObjectRecord record;
  const Eigen::MatrixXd misalignments = read_columns(group, "misalignments", Misalignment::unknowns);
  const Eigen::MatrixXd votes = read_columns(group, "votes", 3);
  const Eigen::MatrixXd colors = read_columns(group, "colors", 2);
  record.votes.foreign = group.read_double("foreign");
  if (misalignments.cols() != static_cast<Eigen::Index>(object.count) || !misalignments.allFinite() ||
      !votes.allFinite() || !colors.allFinite() || !std::isfinite(record.votes.foreign))
    throw Hdf5Failure("has a calibration that does not fit its views");
  for (const auto& m : misalignments.colwise())
    record.misalignments.push_back({m(0), m(1), m(2), m(3), m(4)});
  for (const auto& shares : votes.colwise()) record.votes.votes.push_back({shares(0), shares(1), shares(2)});
  for (const auto& distances : colors.colwise()) record.votes.colors.push_back({distances(0), distances(1)});
  return record;
}

void write_shown(const Hdf5Group& group, const std::vector<ShownProbes>& all) {
  std::size_t probe_count = 0;
  std::size_t rival_count = 0;
  for (const ShownProbes& one : all) {
    probe_count += one.probes.size();
    rival_count += one.rivals.size();
  }
  Eigen::MatrixXd shown(4, static_cast<Eigen::Index>(all.size()));
  Eigen::MatrixXd probes(probe_rows, static_cast<Eigen::Index>(probe_count));
  Eigen::MatrixXd rivals(2, static_cast<Eigen::Index>(rival_count));
  Eigen::Index view = 0;
  Eigen::Index probe_column = 0;
  Eigen::Index rival_column = 0;
  for (const ShownProbes& one : all) {
    const auto index = static_cast<double>(view);
    shown.col(view++) << static_cast<double>(one.object), static_cast<double>(one.view),
        one.windows ? 1.0 : 0.0, one.hidden ? 1.0 : 0.0;
    for (const std::size_t rival : one.rivals)
      rivals.col(rival_column++) << index, static_cast<double>(rival);
    for (const Probe& probe : one.probes) {
      ColumnWriter column(probes.col(probe_column++));
      column.number(index);
      visit_probe(probe, 0, column);
    }
  }
  write_columns(group, "shown", shown);
  write_columns(group, "probes", probes);
  write_columns(group, "rivals", rivals);
}

std::vector<ShownProbes> read_shown(const Hdf5Group& group, std::span<const ObjectViews> objects) {
  std::vector<ShownProbes> result;
  const Eigen::MatrixXd shown = read_columns(group, "shown", 4);
  for (const auto& numbers : shown.colwise()) {
    ColumnReader column(numbers);
    ShownProbes& one = result.emplace_back();
    column.index(one.object, objects.size());
    column.index(one.view, objects[one.object].count);
    column.flag(one.windows);
    column.flag(one.hidden);
  }
  std::size_t index = 0;
  const Eigen::MatrixXd probes = read_columns(group, "probes", probe_rows);
  for (const auto& numbers : probes.colwise()) {
    ColumnReader column(numbers);
    column.index(index, result.size());
    Probe probe{result[index].object};
    visit_probe(probe, objects.size(), column);
    result[index].probes.push_back(probe);
  }
  const Eigen::MatrixXd rivals = read_columns(group, "rivals", 2);
  for (const auto& numbers : rivals.colwise()) {
    ColumnReader column(numbers);
    column.index(index, result.size());
    column.index(result[index].rivals.emplace_back(), objects.size());
  }
  return result;
}

}  // namespace

void write_calibration(const Hdf5Group& root, const CalibrationRecord& record) {
  const Hdf5Group group = root.make_group("calibration");
  group.write("measured_among", static_cast<std::int64_t>(record.measured_among));
  group.write("changes", static_cast<std::int64_t>(record.changes));
  const Hdf5Group objects = group.make_group("objects");
  for (std::size_t o = 0; o < record.objects.size(); ++o)
    write_object(objects.make_group(numbered(o)), record.objects[o]);
  write_shown(group, record.shown);
}

CalibrationRecord read_calibration(const Hdf5Group& root, std::span<const ObjectViews> objects) {
  CalibrationRecord record;
  if (!root.has("calibration")) return record;
  const Hdf5Group group = root.open_group("calibration");
  constexpr std::int64_t most_objects = 1 << 20;
  record.measured_among = static_cast<std::size_t>(group.read_integer("measured_among", 1, most_objects));
  record.changes = static_cast<std::size_t>(group.read_integer("changes", 0, most_objects));
  const Hdf5Group stored = group.open_group("objects");
  const std::vector<std::string> names = stored.group_names();
  if (names.size() != objects.size()) throw Hdf5Failure("has a calibration that does not fit its views");
  for (std::size_t o = 0; o < objects.size(); ++o)
    record.objects.push_back(read_object_record(stored.open_group(names[o]), objects[o]));
  record.shown = read_shown(group, objects);
  return record;
}

}  // namespace eigenpose
