#pragma once

/// The shapes of the catalogue, one function each. All stand on z = 0 around the z axis; front is −y.

#include "sim/scene/shape.h"

namespace eigenpose::sim::objects {

// vessels.cpp
Shape mug_red();
Shape mug_blue();
Shape bottle();
Shape teapot();
// toys.cpp
Shape car();
Shape photo_camera();
Shape boat();
Shape robot();
// blocks.cpp
Shape block_a();
Shape block_b();
Shape house();
Shape shoe();
// animals.cpp
Shape duck();
Shape cat();
Shape pig();
Shape pig_patched();
// objects_held_out.cpp
Shape rocket();
Shape snail();
Shape kettle_bell();
Shape locomotive();
// hand.cpp
Shape hand();

}  // namespace eigenpose::sim::objects
