#pragma once

/// The order in which a person lists names: obj9 before obj10.

#include <string>

namespace eigenpose {

/// Strict order of names in which runs of digits count as numbers.
struct NaturalLess {
  bool operator()(const std::string& a, const std::string& b) const;
};

}  // namespace eigenpose
