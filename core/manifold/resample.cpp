#include "core/manifold/resample.h"

#include <array>
#include <stdexcept>
#include <string>

#include "core/base/atomic_file.h"
#include "core/base/csv_text.h"

namespace eigenpose {

ResampledManifold resample(const Manifold& manifold, std::span<const std::size_t> counts) {
  const std::size_t m = manifold.dofs();
  if (counts.size() != m)
    throw std::invalid_argument("this manifold has " + std::to_string(m) + " DOFs, got " +
                                std::to_string(counts.size()) + " counts");
  std::size_t total = 1;
  for (std::size_t a = 0; a < m; ++a) {
    if (counts[a] == 0)
      throw std::invalid_argument("axis " + std::to_string(a) + " is to be resampled 0 times");
    total *= counts[a];
  }
  ResampledManifold result;
  result.q.resize(static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(total));
  result.points.resize(manifold.dimensions(), static_cast<Eigen::Index>(total));
  const std::array<int, max_manifold_dofs> orders{};
  std::array<double, max_manifold_dofs> q{};
  Eigen::VectorXd value;
  for (std::size_t i = 0; i < total; ++i) {
    std::size_t rest = i;
    for (std::size_t a = m; a-- > 0;) {
      const SampleAxis& axis = manifold.axes()[a];
      const auto step = static_cast<double>(rest % counts[a]);
      rest /= counts[a];
      if (axis.dof.periodic)
        q[a] = axis.dof.lower + axis.dof.period() * step / static_cast<double>(counts[a]);
      else if (counts[a] == 1)
        q[a] = axis.samples.front();
      else
        q[a] = axis.samples.front() +
               (axis.samples.back() - axis.samples.front()) * step / static_cast<double>(counts[a] - 1);
      result.q(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(i)) = q[a];
    }
    manifold.derivative(std::span(q).first(m), std::span(orders).first(m), value);
    result.points.col(static_cast<Eigen::Index>(i)) = value;
  }
  return result;
}

void write_csv(const std::filesystem::path& file, const Manifold& manifold,
               const ResampledManifold& resampled) {
  std::string text;
  for (std::size_t a = 0; a < manifold.dofs(); ++a) {
    const Dof& dof = manifold.axes()[a].dof;
    text += csv_field(dof.name + " [" + dof.unit + "]") + ",";
  }
  for (Eigen::Index k = 0; k < resampled.points.rows(); ++k)
    text += "e" + std::to_string(k + 1) + (k + 1 < resampled.points.rows() ? "," : "\r\n");
  for (Eigen::Index i = 0; i < resampled.points.cols(); ++i) {
    for (Eigen::Index a = 0; a < resampled.q.rows(); ++a) {
      append_number(text, resampled.q(a, i));
      text += ',';
    }
    for (Eigen::Index k = 0; k < resampled.points.rows(); ++k) {
      append_number(text, resampled.points(k, i));
      text += k + 1 < resampled.points.rows() ? "," : "\r\n";
    }
  }
  write_file_atomically(file, text);
}

}  // namespace eigenpose
