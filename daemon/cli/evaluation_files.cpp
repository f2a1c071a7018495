#include "daemon/cli/evaluation_files.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <string_view>
#include <vector>

#include "core/base/atomic_file.h"
#include "core/base/error.h"
#include "core/evaluation/evidence_curve.h"
#include "core/evaluation/plots.h"
#include "core/evaluation/reliability.h"
#include "core/evaluation/tables.h"

namespace eigenpose::cli {
namespace {

bool is_svg(const std::string& file) {
  return std::filesystem::path(file).extension() == ".svg";
}

/// An option that names a file, and the endings that it takes.
struct FileOption {
  std::string_view option;
  const std::string& file;
  std::vector<std::string_view> endings;
};

void check_ending(const FileOption& given) {
  const std::string ending = std::filesystem::path(given.file).extension().string();
  if (std::ranges::find(given.endings, ending) != given.endings.end()) return;
  std::string known;
  for (const std::string_view each : given.endings) known.append(known.empty() ? "" : " or ").append(each);
  throw ConfigError(std::string(given.option)
                        .append(": \"")
                        .append(given.file)
                        .append("\" does not end in ")
                        .append(known));
}

}  // namespace

void check_evaluation_files(const EvaluationFiles& files, bool leave_one_out) {
  if (!files.roc.empty() && !leave_one_out)
    throw ConfigError("--roc: the curve of both errors needs unknown objects; add --leave-one-out");
  std::map<std::filesystem::path, std::string_view> named;
  for (const FileOption& given :
       std::vector<FileOption>{{"--roc", files.roc, {".csv", ".svg"}},
                               {"--calibration", files.calibration, {".csv", ".svg"}},
                               {"--csv", files.csv, {".csv"}},
                               {"--confusion", files.confusion, {".svg"}}}) {
    if (given.file.empty()) continue;
    check_ending(given);
    // Links followed, of the file and of its folder: two names of one file would overwrite each other.
    const AtomicFile writable(given.file);
    const std::filesystem::path target = std::filesystem::absolute(writable.target());
    const std::filesystem::path resolved =
        std::filesystem::canonical(target.parent_path()) / target.filename();
    const auto [other, is_new] = named.emplace(resolved, given.option);
    if (!is_new)
      throw ConfigError(std::string(given.option)
                            .append(": \"")
                            .append(given.file)
                            .append("\" is the file of ")
                            .append(other->second)
                            .append(" too; give each its own"));
  }
}

void write_evaluation_files(const EvaluationFiles& files, const EvaluationReport& report) {
  const std::vector<std::string> names = report.object_names();
  if (!files.roc.empty()) {
    const EvidenceCurve curve = evidence_curve(report.records);
    write_file_atomically(files.roc, is_svg(files.roc) ? curve_svg(curve) : curve_csv(curve));
  }
  if (!files.calibration.empty()) {
    const Reliability bins = reliability(report.records);
    write_file_atomically(files.calibration,
                          is_svg(files.calibration) ? reliability_svg(bins) : reliability_csv(bins));
  }
  if (!files.csv.empty()) write_file_atomically(files.csv, records_csv(report.records, names));
  if (!files.confusion.empty())
    write_file_atomically(files.confusion,
                          confusion_svg(confusion_matrix(report.records, names.size()), names));
}

}  // namespace eigenpose::cli
