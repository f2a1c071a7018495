#pragma once

/// Warnings of import and learning, on stderr.

#include <span>
#include <string>

#include "core/dataset/left_out.h"

namespace eigenpose::cli {

/// One line each: "warning: …".
void print_warnings(std::span<const std::string> warnings);

/// One line each: "warning: left out mug: SETS/mug/000003.png: is truncated …". Of very many of one kind only
/// the first are named, and the others counted.
void print_left_out(std::span<const LeftOut> left_out);

}  // namespace eigenpose::cli
