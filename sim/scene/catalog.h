#pragma once

/// The objects that the simulated lab owns, and their shapes.

#include <span>
#include <string>

#include "sim/scene/shape.h"

namespace eigenpose::sim {

struct ObjectDescription {
  std::string name;
  bool symmetric = false;  ///< looks the same at every angle
  bool held_out = false;   ///< kept from learning
  Shape shape;
};

/// All of them, in a fixed order. Lives for ever.
std::span<const ObjectDescription> built_objects();

/// The hand that places things; it can't be placed itself. Its tip is at the origin, the arm goes along +x.
const Shape& hand_shape();

}  // namespace eigenpose::sim
