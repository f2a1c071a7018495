#pragma once

/// Reading and writing single pictures, strictly: half a picture is an error, not a grey lower half.

#include <filesystem>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "core/base/input_file.h"

namespace eigenpose {

/// Decodes a whole file: CV_8UC1, CV_8UC3 (BGR) or CV_16UC1; an alpha band is dropped.
///
/// PNG files are checked chunk by chunk first (lengths, CRCs, the end mark), JPEG files for their end mark
/// and PNM files for their length, because the decoders behind OpenCV fill what is missing with grey and say
/// nothing.
/// @throws FileError when the file is missing, empty, truncated, damaged or of another kind.
cv::Mat load_picture(const std::filesystem::path& file);

/// The same from memory; `name` is what errors call it.
cv::Mat decode_picture(std::span<const unsigned char> bytes, const std::filesystem::path& name);

/// Encodes as PNG. @throws std::invalid_argument for a type that `load_picture` does not return.
std::vector<unsigned char> encode_png(const cv::Mat& image);

}  // namespace eigenpose
