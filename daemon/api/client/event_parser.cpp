#include <charconv>

#include "daemon/api/client/api_client.h"

namespace eigenpose {

bool EventParser::feed(std::string_view piece, const std::function<bool(const ApiEvent&)>& handle) {
  for (const char c : piece) {
    if (c == '\r') continue;
    if (c != '\n') {
      line_ += c;
      continue;
    }
    if (!end_line(handle)) return false;
    line_.clear();
  }
  return true;
}

bool EventParser::end_line(const std::function<bool(const ApiEvent&)>& handle) {
  if (line_.empty()) {
    const bool whole = has_data_;
    has_data_ = false;
    const bool go_on = !whole || handle(event_);
    event_.name.clear();
    event_.data.clear();
    return go_on;
  }
  const std::size_t colon = line_.find(':');
  if (colon == 0) return true;  // a comment that keeps the connection alive
  const std::string_view line = line_;
  const std::string_view field = line.substr(0, colon);
  std::string_view value = colon == std::string_view::npos ? std::string_view() : line.substr(colon + 1);
  if (value.starts_with(' ')) value.remove_prefix(1);
  if (field == "event") event_.name = value;
  if (field == "id") {
    // "3f29ab01-12": the run and the number in it.
    const std::size_t mark = value.rfind('-');
    event_.run = mark == std::string_view::npos ? "" : value.substr(0, mark);
    if (mark != std::string_view::npos) value.remove_prefix(mark + 1);
    std::from_chars(value.data(), value.data() + value.size(), event_.id);
  }
  if (field == "data") {
    if (has_data_) event_.data += '\n';
    event_.data += value;
    has_data_ = true;
  }
  return true;
}

}  // namespace eigenpose
