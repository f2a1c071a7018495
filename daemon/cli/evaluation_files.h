#pragma once

/// The files that `evaluate` writes its results to.

#include <string>

#include "core/evaluation/evaluation.h"

namespace eigenpose::cli {

/// Empty: not wanted.
struct EvaluationFiles {
  std::string roc;          ///< --roc, .csv or .svg
  std::string calibration;  ///< --calibration, .csv or .svg
  std::string csv;          ///< --csv
  std::string confusion;    ///< --confusion, .svg
};

/// Finds what cannot be written before anything is learned. @throws ConfigError: an ending that is not known,
/// two options with one file, a curve without unknown objects; FileError: it cannot be written there.
void check_evaluation_files(const EvaluationFiles& files, bool leave_one_out);

/// @throws FileError.
void write_evaluation_files(const EvaluationFiles& files, const EvaluationReport& report);

}  // namespace eigenpose::cli
