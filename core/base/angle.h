#pragma once

/// Angles as a type, so that degrees and radians are never confused.
///
/// A bare number that leaves the program (configuration key, JSON field, register) names its unit instead:
/// `table_angle_deg`.

#include <cmath>
#include <compare>
#include <numbers>

namespace eigenpose {

/// A plane angle, any number of turns. Value type, no invariant.
class Angle {
 public:
  constexpr Angle() = default;

  [[nodiscard]] constexpr double degrees() const { return radians_ * 180.0 / std::numbers::pi; }
  [[nodiscard]] constexpr double radians() const { return radians_; }

  friend constexpr auto operator<=>(Angle, Angle) = default;
  friend constexpr Angle operator+(Angle a, Angle b) { return Angle(a.radians_ + b.radians_); }
  friend constexpr Angle operator-(Angle a, Angle b) { return Angle(a.radians_ - b.radians_); }
  friend constexpr Angle operator-(Angle a) { return Angle(-a.radians_); }
  friend constexpr Angle operator*(double s, Angle a) { return Angle(s * a.radians_); }
  friend constexpr double operator/(Angle a, Angle b) { return a.radians_ / b.radians_; }

  static constexpr Angle from_radians(double radians) { return Angle(radians); }
  static constexpr Angle from_degrees(double degrees) { return Angle(degrees * std::numbers::pi / 180.0); }

 private:
  explicit constexpr Angle(double radians) : radians_(radians) {}
  double radians_ = 0.0;
};

constexpr Angle degrees(double value) {
  return Angle::from_degrees(value);
}
constexpr Angle radians(double value) {
  return Angle::from_radians(value);
}

/// `value` moved by whole periods into [lower, lower + period). @pre period > 0.
inline double wrap(double value, double lower, double period) {
  const double turns = std::floor((value - lower) / period);
  const double wrapped = value - turns * period;
  // Rounding may land exactly on the excluded end.
  return wrapped >= lower + period ? lower : wrapped;
}

/// Signed difference a − b on a circle of the given period, in [−period/2, period/2).
inline double circular_difference(double a, double b, double period) {
  return wrap(a - b, -0.5 * period, period);
}

/// The same for angles, on the full turn: in [−180°, 180°).
inline Angle circular_difference(Angle a, Angle b) {
  return radians(circular_difference(a.radians(), b.radians(), 2.0 * std::numbers::pi));
}

}  // namespace eigenpose
