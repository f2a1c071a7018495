#pragma once

/// The record of a calibration, in the file of kept views (training_archive.h).
///
/// Group `calibration`, attributes measured_among, changes:
///
///     objects/000000…  misalignments (5 × n: gain, dx, dy, scale, rotation),
///                      votes (3 × views that voted), colors (2 × the same), attribute foreign
///     shown            4 × S: object, view, windows, hidden
///     probes           35 × P: index of the shown view, then the members of a Probe
///                      in their order; NaN for none
///     rivals           2 × R: index of the shown view, object

#include <span>

#include "core/learning/calibration/calibration_record.h"
#include "core/learning/training_views.h"
#include "core/model/hdf5_file.h"

namespace eigenpose {

/// @throws Hdf5Failure.
void write_calibration(const Hdf5Group& root, const CalibrationRecord& record);
/// An empty record where the file has none. @param objects of the file. @throws Hdf5Failure for one that does
/// not fit them.
CalibrationRecord read_calibration(const Hdf5Group& root, std::span<const ObjectViews> objects);

}  // namespace eigenpose
