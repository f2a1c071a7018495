#include "sim/scene/catalog.h"

#include <array>

#include "sim/scene/objects.h"

namespace eigenpose::sim {

std::span<const ObjectDescription> built_objects() {
  static const std::array<ObjectDescription, 20> all{{
      {"mug", false, false, objects::mug_red()},
      {"mug_blue", false, false, objects::mug_blue()},
      {"duck", false, false, objects::duck()},
      {"car", false, false, objects::car()},
      {"camera", false, false, objects::photo_camera()},
      {"bottle", true, false, objects::bottle()},
      {"teapot", false, false, objects::teapot()},
      {"block_a", false, false, objects::block_a()},
      {"block_b", false, false, objects::block_b()},
      {"house", false, false, objects::house()},
      {"boat", false, false, objects::boat()},
      {"robot", false, false, objects::robot()},
      {"cat", false, false, objects::cat()},
      {"pig", false, false, objects::pig()},
      {"pig_patched", false, false, objects::pig_patched()},
      {"boot", false, false, objects::shoe()},
      {"rocket", false, true, objects::rocket()},
      {"snail", false, true, objects::snail()},
      {"kettle_bell", false, true, objects::kettle_bell()},
      {"locomotive", false, true, objects::locomotive()},
  }};
  return all;
}

const Shape& hand_shape() {
  static const Shape shape = objects::hand();
  return shape;
}

}  // namespace eigenpose::sim
