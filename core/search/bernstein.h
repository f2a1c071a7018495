#pragma once

/// Scalar polynomials in Bernstein form over [0,1]^m, and their exact minimum.
///
/// p(u) = Σ_i b_i Π_a B_{i_a}^{n_a}(u_a). The polynomial lies between its smallest and its largest
/// coefficient (convex-hull property), a bound whose error falls with the square of the width under
/// subdivision; the values at the corners are coefficients.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace eigenpose::bernstein {

inline constexpr int max_axes = 4;
/// Squared distance to a patch of degree 3 has degree 6.
inline constexpr int max_degree = 6;

/// Degrees along the axes; coefficients are stored with the last axis running fastest.
struct Shape {
  int axes = 0;
  std::array<int, max_axes> degree{};

  [[nodiscard]] std::size_t size() const {
    std::size_t n = 1;
    for (int a = 0; a < axes; ++a) n *= static_cast<std::size_t>(degree[a] + 1);
    return n;
  }
  /// Distance in memory between neighbours along axis a.
  [[nodiscard]] std::size_t stride(int a) const {
    std::size_t n = 1;
    for (int i = a + 1; i < axes; ++i) n *= static_cast<std::size_t>(degree[i] + 1);
    return n;
  }
  friend bool operator==(const Shape&, const Shape&) = default;
};

/// n over k, for n ≤ 2 · max_degree.
double binomial(int n, int k);

/// Multiplies along one axis by a matrix of rows × (degree+1), row by row: `out` gets `rows` entries there.
/// @pre in and out do not overlap.
void apply(const Shape& shape, int axis, std::span<const double> matrix, int rows, const double* in,
           double* out);

/// The two halves along one axis (de Casteljau at ½). @pre low may be `in` itself; high may not.
void split(const Shape& shape, int axis, const double* in, double* low, double* high);

struct Range {
  double low = 0.0;
  double high = 0.0;
};
/// Bounds of p over the unit cube, from the coefficients after halving every axis `levels` times.
Range range(const Shape& shape, std::span<const double> coefficients, int levels);

/// A minimum, or a proof that there is none below the cut.
struct Minimum {
  bool found = false;  ///< value ≤ cut
  double value = 0.0;  ///< p(u)
  std::array<double, max_axes> u{};
};

/// Global minimum over [0,1] of a polynomial in one variable, if it is at most `cut`. Convex pieces by
/// Newton's method inside a bracket, others halved. The value is within 2·`rounding` of the minimum,
/// `rounding` being the absolute error that the coefficients carry.
Minimum minimize_curve(int degree, const double* coefficients, double cut, double rounding);

/// Memory for minimize(); grows to what a shape needs on first use and is kept.
class MinimizeScratch {
 public:
  double* level(std::size_t depth, std::size_t size);
  void reserve(std::size_t size);

 private:
  std::vector<double> memory_;
};

/// Depth of halvings at which a piece is as small as double precision resolves.
inline constexpr std::size_t max_halvings = 60;

/// Where the polynomial's domain goes on beyond the unit cube, in another polynomial that joins this one with
/// equal first derivatives.
struct Joints {
  std::array<bool, max_axes> low{};   ///< beyond u_a = 0
  std::array<bool, max_axes> high{};  ///< beyond u_a = 1
};

/// How accurate a minimum must be.
struct Accuracy {
  double rounding = 0.0;  ///< absolute error that the coefficients carry
  double distance = 0.0;  ///< of the square root of the value: p is a squared distance
};

/// Global minimum over [0,1]^m, if it is at most `cut`: branch and bound on the coefficients.
///
/// A piece on which p rises or falls all the way along an axis (all first differences of one sign) has its
/// minimum on that face; where p goes on beyond it, lower values stand there, and the piece is left out. So
/// with `joints` "not found" may also mean that the neighbour comes lower. A piece whose Hessian is positive
/// definite everywhere (by the ranges of its entries, their middle taken as unit) is finished by
/// projected Newton, whose convex duality gap is the proof. The polynomial is a squared distance: the square
/// root of the value found is within `accuracy.distance` of the square root of the minimum.
Minimum minimize(const Shape& shape, const double* coefficients, double cut, const Accuracy& accuracy,
                 const Joints& joints, MinimizeScratch& scratch);

}  // namespace eigenpose::bernstein
