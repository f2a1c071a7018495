#include "core/recognition/outcome.h"

#include <cmath>
#include <limits>

namespace eigenpose {

std::string_view verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::recognized:
      return "recognized";
    case Verdict::unknown:
      return "unknown";
    case Verdict::ambiguous:
      return "ambiguous";
    case Verdict::touches_border:
      return "touches_border";
    case Verdict::too_small:
      return "too_small";
  }
  return "unknown";
}

void Outcome::set_covariance(std::span<const double> covariance, double scale,
                             const std::vector<bool>& observable) {
  const std::size_t m = observable.size();
  q_sigma.clear();
  q_covariance.clear();
  for (std::size_t a = 0; a < m; ++a) {
    for (std::size_t b = 0; b < m; ++b) {
      const bool seen = observable[a] && observable[b];
      q_covariance.push_back(seen     ? scale * covariance[a * m + b]
                             : a == b ? std::numeric_limits<double>::infinity()
                                      : 0.0);
    }
    q_sigma.push_back(std::sqrt(q_covariance[a * m + a]));
  }
}

std::vector<std::vector<double>> covariance_rows(const Outcome& outcome) {
  const std::size_t m = outcome.q_sigma.size();
  std::vector<std::vector<double>> rows;
  rows.reserve(m);
  for (auto row = outcome.q_covariance.begin(); row != outcome.q_covariance.end();
       row += static_cast<std::ptrdiff_t>(m))
    rows.emplace_back(row, row + static_cast<std::ptrdiff_t>(m));
  return rows;
}

}  // namespace eigenpose
