#pragma once

/// What an object may be called. Names become folders, file names, groups of HDF5 files, words in logs and on
/// terminals.

#include <string>

namespace eigenpose {

/// 1 to 64 of A–Z a–z 0–9 _ . - and a letter or digit first.
/// @throws std::invalid_argument saying so, with the name made printable.
void check_object_name(const std::string& name);

}  // namespace eigenpose
