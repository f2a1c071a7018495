#pragma once

/// What was said of one shown region, and how often it was right.

#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/recognition/outcome.h"

namespace eigenpose {

/// part/whole; 0 of nothing.
double rate_of(std::size_t part, std::size_t whole);

/// One view that was shown, and the outcome of its largest region. Objects are indices into those of the
/// evaluation.
struct RegionRecord {
  std::size_t object = 0;           ///< the one that was shown
  bool known = true;                ///< false: shown to a model without this object
  std::size_t view = 0;             ///< of the object's image set
  std::vector<double> true_q;       ///< its pose, in the units of the workspace
  std::optional<Verdict> verdict;   ///< absent: no region was found
  std::optional<std::size_t> said;  ///< the best object, whatever the verdict; absent where none was compared
  std::vector<double> said_q;       ///< pose of `said`
  double evidence = 0.0;            ///< as in Outcome
  double required_evidence = 0.0;   ///< as in Outcome
  double confidence = 0.0;          ///< as in Outcome
  /// |error| of the first DOF in its unit. Present where the best object is right, and of `other_pose_error`
  /// where a second pose was given too.
  std::optional<double> pose_error;
  std::optional<double> other_pose_error;

  /// The region was compared with the model: recognized, ambiguous or unknown.
  [[nodiscard]] bool matched() const;
  /// The best object is the true one, whatever the verdict. Never of an unknown object.
  [[nodiscard]] bool best_is_right() const { return known && said == object; }
  /// Recognized, with the object or another one.
  [[nodiscard]] bool answered() const { return said.has_value() && verdict == Verdict::recognized; }
};

/// Counts over records. Every known view is answered right, answered wrong or withheld.
struct AnswerCounts {
  std::size_t known = 0;           ///< views of objects that the model holds
  std::size_t answered_right = 0;  ///< recognized as what they are
  std::size_t answered_wrong = 0;  ///< recognized as another object
  std::size_t withheld = 0;        ///< unknown, ambiguous, at the border, or nothing found

  std::size_t best_right = 0;  ///< known views whose best object is the true one, whatever the verdict
  std::size_t rejected = 0;    ///< of these, neither recognized nor ambiguous
  std::size_t ambiguous = 0;   ///< of these, ambiguous
  std::size_t missed = 0;      ///< known views without a best object

  std::size_t unknown = 0;           ///< views shown to a model without their object
  std::size_t falsely_accepted = 0;  ///< of these, recognized or ambiguous: they got a name

  void add(const RegionRecord& record);

  /// Shares of `known`, 0…1. The first three add up to 1; without known views all are 0.
  [[nodiscard]] double answered_right_rate() const;
  [[nodiscard]] double answered_wrong_rate() const;
  [[nodiscard]] double withheld_rate() const;
  [[nodiscard]] double recognition_rate() const;  ///< of best_right
  [[nodiscard]] double rejected_rate() const;
  [[nodiscard]] double ambiguous_rate() const;
  /// Share of `unknown`, 0…1; absent where no unknown object was shown.
  [[nodiscard]] std::optional<double> false_acceptance_rate() const;
};

AnswerCounts count_answers(std::span<const RegionRecord> records);

/// (true object, best object or none) → known views, only where the best object is another or absent.
std::map<std::pair<std::size_t, std::optional<std::size_t>>, std::size_t> count_confusions(
    std::span<const RegionRecord> records);

/// What was said of the known views of every object.
struct ConfusionMatrix {
  /// Row: the true object. Columns: the object that was said, as far as answered; the last one: withheld.
  std::vector<std::vector<std::size_t>> views;
};

/// @param objects how many there are; every record's index is below it.
ConfusionMatrix confusion_matrix(std::span<const RegionRecord> records, std::size_t objects);

}  // namespace eigenpose
