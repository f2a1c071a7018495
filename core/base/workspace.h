#pragma once

/// The visual workspace: the degrees of freedom that change what the camera sees (eq. 1 of Nayar, Murase,
/// Nene).

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace eigenpose {

/// One degree of freedom (DOF): a named variable with unit and range.
struct Dof {
  std::string name;      ///< "table", "light_azimuth", "x"
  std::string unit;      ///< "deg", "mm"
  double lower = 0.0;    ///< smallest value, in `unit`
  double upper = 360.0;  ///< largest value; for a periodic DOF lower + period, which equals `lower`
  bool periodic = true;  ///< closes on itself

  [[nodiscard]] double period() const { return upper - lower; }
  /// `value` moved into [lower, upper) if periodic; unchanged otherwise.
  [[nodiscard]] double canonical(double value) const;
  /// Signed a − b, the short way round if periodic, in `unit`.
  [[nodiscard]] double difference(double a, double b) const;

  friend bool operator==(const Dof&, const Dof&) = default;
};

/// The ordered list of DOFs, m ≥ 1. A point of the workspace is m numbers, each in its DOF's unit.
/// @throws std::invalid_argument on an empty list, equal names, or an empty range.
class Workspace {
 public:
  Workspace() = default;  ///< no DOF: only a place to assign to
  explicit Workspace(std::vector<Dof> dofs);

  [[nodiscard]] std::size_t size() const { return dofs_.size(); }
  [[nodiscard]] const Dof& operator[](std::size_t i) const { return dofs_[i]; }
  [[nodiscard]] std::span<const Dof> dofs() const { return dofs_; }
  /// Each value canonical in its DOF. @throws std::invalid_argument when `q.size()` ≠ m.
  [[nodiscard]] std::vector<double> canonical(std::span<const double> q) const;

  friend bool operator==(const Workspace&, const Workspace&) = default;

 private:
  std::vector<Dof> dofs_;
};

/// The workspace of a plain turntable: one periodic DOF "table" in degrees, 0…360.
Workspace turntable_workspace();

}  // namespace eigenpose
