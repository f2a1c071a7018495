#pragma once

/// Distances as likelihoods: how sure a recogniser is of the nearest object, and of its pose.

#include <algorithm>
#include <cmath>

namespace eigenpose {

/// Numbers of a point that vary independently when a view is moved: the typical distance spreads over about
/// so many. It turns distances into likelihoods.
inline constexpr double effective_dimensions = 6.0;

/// How likely a region is at one distance over another, where new views of its object typically (root mean
/// square) have the third.
inline double likelihood(double distance, double over, double typical) {
  const double variance = std::max(typical * typical / effective_dimensions, 1e-12);
  return std::exp(-(distance * distance - over * over) / (2.0 * variance));
}

/// The best is not sure enough of itself beside a second best that is so likely over it: its own probability
/// is below 0.7.
inline bool is_ambiguous(double second) {
  return 0.7 * (1.0 + second) > 1.0;
}

}  // namespace eigenpose
