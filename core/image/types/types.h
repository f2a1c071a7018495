#pragma once

/// The makers of all image types, one file each. For a picture of `size` × `size` pixels.

#include <memory>

#include "core/image/image_type.h"

namespace eigenpose::types {

std::unique_ptr<ImageType> make_brightness(int size);
std::unique_ptr<ImageType> make_opponent(int size);
std::unique_ptr<ImageType> make_gradient(int size);
std::unique_ptr<ImageType> make_laplacian(int size);
std::unique_ptr<ImageType> make_fourier(int size);

}  // namespace eigenpose::types
