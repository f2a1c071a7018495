#include "core/learning/calibration/observability.h"

#include <utility>

#include "core/base/statistics.h"
#include "core/learning/calibration/cross_validation.h"

namespace eigenpose {
namespace {

/// A DOF is observable when the median error of left-out views is at most this share of its range. Blind
/// guessing gives a quarter of the range; half a turn wrong every second time gives about as much.
constexpr double observable_error_share = 0.12;

}  // namespace

PoseEvidence measure_observability(const ObjectViews& object, const Eigen::MatrixXd& points, int degree) {
  PoseEvidence found;
  for (std::size_t d = 0; d < object.axes.size(); ++d) {
    auto errors = left_out_errors(object, d, degree, [&](const Fold& fold) {
      return FoldPoints{points(Eigen::all, fold.kept), points(Eigen::all, fold.left_out)};
    });
    found.dof_observable.push_back(errors.empty() ||
                                   quantile(std::vector<double>(errors), 0.5) <=
                                       observable_error_share * object.axes[d].dof.period());
    found.left_out_errors.push_back(std::move(errors));
  }
  return found;
}

}  // namespace eigenpose
