#include "core/evaluation/region_record.h"

namespace eigenpose {

double rate_of(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

bool RegionRecord::matched() const {
  return said &&
         (verdict == Verdict::recognized || verdict == Verdict::ambiguous || verdict == Verdict::unknown);
}

void AnswerCounts::add(const RegionRecord& record) {
  if (!record.known) {
    ++unknown;
    if (record.said && (record.verdict == Verdict::recognized || record.verdict == Verdict::ambiguous))
      ++falsely_accepted;
    return;
  }
  ++known;
  if (!record.answered())
    ++withheld;
  else
    ++(record.best_is_right() ? answered_right : answered_wrong);
  if (!record.said) ++missed;
  if (!record.best_is_right()) return;
  ++best_right;
  if (record.verdict == Verdict::ambiguous)
    ++ambiguous;
  else if (record.verdict != Verdict::recognized)
    ++rejected;
}

double AnswerCounts::answered_right_rate() const {
  return rate_of(answered_right, known);
}

double AnswerCounts::answered_wrong_rate() const {
  return rate_of(answered_wrong, known);
}

double AnswerCounts::withheld_rate() const {
  return rate_of(withheld, known);
}

double AnswerCounts::recognition_rate() const {
  return rate_of(best_right, known);
}

double AnswerCounts::rejected_rate() const {
  return rate_of(rejected, known);
}

double AnswerCounts::ambiguous_rate() const {
  return rate_of(ambiguous, known);
}

std::optional<double> AnswerCounts::false_acceptance_rate() const {
  if (unknown == 0) return std::nullopt;
  return rate_of(falsely_accepted, unknown);
}

AnswerCounts count_answers(std::span<const RegionRecord> records) {
  AnswerCounts counts;
  for (const RegionRecord& record : records) counts.add(record);
  return counts;
}

std::map<std::pair<std::size_t, std::optional<std::size_t>>, std::size_t> count_confusions(
    std::span<const RegionRecord> records) {
  std::map<std::pair<std::size_t, std::optional<std::size_t>>, std::size_t> confusions;
  for (const RegionRecord& record : records)
    if (record.known && !record.best_is_right()) ++confusions[{record.object, record.said}];
  return confusions;
}

ConfusionMatrix confusion_matrix(std::span<const RegionRecord> records, std::size_t objects) {
  ConfusionMatrix matrix{{objects, std::vector<std::size_t>(objects + 1, 0)}};
  for (const RegionRecord& record : records)
    if (record.known) ++matrix.views.at(record.object).at(record.answered() ? *record.said : objects);
  return matrix;
}

}  // namespace eigenpose
