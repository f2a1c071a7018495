#pragma once

/// Making a region comparable: cut out, scale to N×N keeping its aspect, unit energy (sections 2 and 3 of the
/// paper).

namespace eigenpose {

/// How a region becomes an appearance. Part of the model: learned and watched views must agree.
struct NormalizationOptions {
  int size = 64;      ///< side of the square appearance, pixels; 8…256
  bool color = true;  ///< three bands normalised jointly; false: grey
};

}  // namespace eigenpose
