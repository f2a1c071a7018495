#pragma once

/// The model on disk: one HDF5 file that Python, MATLAB or h5dump can open.
///
/// It is sealed (sealed_file.h), and the same bytes whenever the same model is written.
///
///     /normalization   attributes size, color, type, cropped, …
///     /eigenspace      mean (N), basis (K×N), eigenvalues (K), attribute total_scatter
///     /objects/0000…   attributes name, rejection_distance, …; coefficients (count×K);
///                      axes/0… attributes name, unit, lower, upper, periodic; samples (n)
///     /provenance      attributes

#include <filesystem>

#include "core/model/model.h"

namespace eigenpose {

/// Writes atomically: a reader sees the former file or the whole new one. @throws FileError.
void save_model(const Model& model, const std::filesystem::path& file);

/// @throws FileError saying what is wrong (missing, no model, another version, truncated, damaged) and what
/// to do.
Model load_model(const std::filesystem::path& file);

}  // namespace eigenpose
