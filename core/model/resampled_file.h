#pragma once

/// Manifolds resampled densely, in a file that a person opens with Python, MATLAB or a spreadsheet.

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "core/model/model.h"

namespace eigenpose {

struct ResamplingOptions {
  std::size_t per_turn = 360;  ///< points on a periodic axis
  std::size_t per_step = 10;   ///< on an open axis: from one learned value to the next
};

/// Points along each axis of a manifold. @throws std::invalid_argument for zeros.
std::vector<std::size_t> resampling_counts(const Manifold& manifold, const ResamplingOptions& options);

/// Writes the manifolds of `objects` (numbers in the model) as the file's ending says:
/// - ".h5": one group an object, /mug/q (n × m) and /mug/points (n × K), its attributes naming the axes;
/// - ".csv": a table; of several objects one each, FILE-mug.csv.
/// Atomic: each file is there whole or not at all.
/// @return the files written. @throws FileError, also for another ending.
std::vector<std::filesystem::path> write_resampled(const Model& model, std::span<const std::size_t> objects,
                                                   const ResamplingOptions& options,
                                                   const std::filesystem::path& file);

}  // namespace eigenpose
