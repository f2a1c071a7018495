#include "core/base/utc_text.h"

#include <array>
#include <cstdio>
#include <ctime>

namespace eigenpose {

std::string utc_text(std::chrono::system_clock::time_point time, UtcDigits digits) {
  using std::chrono::milliseconds;
  const auto whole = std::chrono::floor<std::chrono::seconds>(time);
  const std::time_t seconds = std::chrono::system_clock::to_time_t(whole);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  std::array<char, 48> text{};
  const std::size_t length = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &parts);
  std::string result(text.data(), length);
  if (digits == UtcDigits::milliseconds) {
    const auto rest = static_cast<int>(std::chrono::floor<milliseconds>(time - whole).count());
    std::snprintf(text.data(), text.size(), ".%03d", rest);
    result += text.data();
  }
  return result + "Z";
}

}  // namespace eigenpose
