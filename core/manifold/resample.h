#pragma once

/// Dense resampling of a manifold, to memory and to a file that opens in a spreadsheet.

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/manifold/manifold.h"

namespace eigenpose {

struct ResampledManifold {
  Eigen::MatrixXd q;       ///< m × n: the DOF values, last axis fastest
  Eigen::MatrixXd points;  ///< K × n
};

/// Evenly spaced along each axis: from `lower` over the whole period if periodic, from the first to the last
/// sample otherwise, both ends included.
/// @param counts m numbers ≥ 1. @throws std::invalid_argument for another number of counts or a zero.
ResampledManifold resample(const Manifold& manifold, std::span<const std::size_t> counts);

/// Writes it as CSV (RFC 4180, decimal point, 9 significant digits): one header line "table [deg],e1,e2,…",
/// then one line a point. Atomic: the file is there whole or not at all. @throws FileError.
void write_csv(const std::filesystem::path& file, const Manifold& manifold,
               const ResampledManifold& resampled);

}  // namespace eigenpose
