#include "core/evaluation/tables.h"

#include <optional>
#include <vector>

#include "core/base/csv_text.h"

namespace eigenpose {
namespace {

/// One line, field after field.
class Line {
 public:
  explicit Line(std::string& text) : text_(text) {}

  Line& add(std::string_view field) {
    separate();
    text_ += csv_field(field);
    return *this;
  }
  Line& add(double value) {
    separate();
    append_number(text_, value);
    return *this;
  }
  Line& add(std::size_t value) {
    separate();
    text_ += std::to_string(value);
    return *this;
  }
  Line& add(const std::optional<double>& value) { return value ? add(*value) : add(std::string_view()); }
  Line& add(std::span<const double> values) {
    separate();
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (i > 0) text_ += ' ';
      append_number(text_, values[i]);
    }
    return *this;
  }
  void end() { text_ += csv_line_end; }

 private:
  void separate() {
    if (!first_) text_ += ',';
    first_ = false;
  }

  std::string& text_;
  bool first_ = true;
};

std::string header(std::string_view names) {
  return std::string(names).append(csv_line_end);
}

std::string_view answer_name(const RegionRecord& record) {
  AnswerCounts one;
  one.add(record);
  if (!record.known) return one.falsely_accepted == 1 ? "accepted" : "rejected";
  if (one.withheld == 1) return "withheld";
  return one.answered_right == 1 ? "right" : "wrong";
}

void append_point(std::string& text, const EvidenceCurve::Point& point, bool in_use) {
  Line line(text);
  line.add(point.threshold).add(point.false_rejection).add(point.false_acceptance).add(point.answered_wrong);
  line.add(std::size_t{in_use}).end();
}

}  // namespace

std::string records_csv(std::span<const RegionRecord> records, std::span<const std::string> names) {
  std::string text = header(
      "object,known,view,true_q,verdict,said,said_q,answer,evidence,required_evidence,confidence,"
      "pose_error,other_pose_error");
  for (const RegionRecord& record : records) {
    Line line(text);
    line.add(names[record.object]).add(std::size_t{record.known}).add(record.view).add(record.true_q);
    line.add(record.verdict ? verdict_name(*record.verdict) : "nothing_found");
    line.add(record.said ? std::string_view(names[*record.said]) : "").add(record.said_q);
    const auto value = [&](double of) { return record.matched() ? std::optional(of) : std::nullopt; };
    line.add(answer_name(record)).add(value(record.evidence)).add(value(record.required_evidence));
    line.add(value(record.confidence));
    line.add(record.pose_error).add(record.other_pose_error).end();
  }
  return text;
}

std::string curve_csv(const EvidenceCurve& curve) {
  std::string text = header("threshold,false_rejection,false_acceptance,answered_wrong,in_use");
  bool shown = false;
  for (const EvidenceCurve::Point& point : curve.points) {
    if (!shown && !(point.threshold < curve.in_use.threshold)) {
      append_point(text, curve.in_use, true);
      shown = true;
    }
    append_point(text, point, false);
  }
  return text;
}

std::string reliability_csv(const Reliability& reliability) {
  std::string text = header("from,to,regions,right,mean_confidence,right_share");
  for (std::size_t b = 0; b < Reliability::bin_count; ++b) {
    const Reliability::Bin& bin = reliability.bins[b];
    const auto value = [&](double of) { return bin.regions > 0 ? std::optional(of) : std::nullopt; };
    Line line(text);
    line.add(static_cast<double>(b) / Reliability::bin_count);
    line.add(static_cast<double>(b + 1) / Reliability::bin_count).add(bin.regions).add(bin.right);
    line.add(value(bin.mean_confidence)).add(value(bin.right_share())).end();
  }
  return text;
}

}  // namespace eigenpose
