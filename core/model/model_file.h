#pragma once

/// The model on disk: one HDF5 file that Python, MATLAB or h5dump can open.
///
/// It is sealed (sealed_file.h), and the same bytes whenever the same model is written.
///
///     /normalization   attributes size, color, type, cropped, …
///     /eigenspace      mean (N), basis (K×N), eigenvalues (K), attribute total_scatter
///     /decision        weights, required, required_occluded, settled, rates; known and unknown evidence;
///                      tuning
///     /objects/0000…   attributes name, typical_distance, …; coefficients (count×K);
///                      axes/0… attributes name, unit, lower, upper, periodic; samples (n)
///     /parts           windows and alignment eigenspaces, see parts_file.h
///     /provenance      attributes
///
/// Only this program's version of the format is read. An attribute that was added to a version is optional,
/// and its default is what the program did before.

#include <filesystem>

#include "core/model/model.h"

namespace eigenpose {

/// Writes the model, reads it back from the disk, and only then replaces a former file. @throws FileError,
/// and then the former file is unchanged.
void save_model(const Model& model, const std::filesystem::path& file);

/// @throws FileError saying what is wrong (missing, no model, another version, truncated, damaged, values
/// that cannot be, see check_model) and what to do.
Model load_model(const std::filesystem::path& file);

}  // namespace eigenpose
