#pragma once

/// Reading and writing single pictures, strictly: half a picture is an error, not a grey lower half.

#include <filesystem>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "core/base/input_file.h"

namespace eigenpose {

/// Decodes a whole file: CV_8UC1, CV_8UC3 (BGR) or CV_16UC1.
///
/// PNG, JPEG, TIFF, BMP, PBM, PGM and PPM are read, known by their content and not by their name, every other
/// format is refused. For all of them:
///  - a picture with a missing or damaged pixel is refused; bytes after its end are ignored;
///  - samples are scaled from the range of the format, grey of more than 8 bits to CV_16UC1, all else to
///    8 bits; gamma and colour profiles are ignored;
///  - what is transparent is black, which is background: samples are multiplied by their opacity;
///  - the picture is turned and mirrored as EXIF or TIFF orientation says;
///  - more than 134 million pixels are refused before anything is decoded.
/// @throws FileError when the file is missing, empty, no plain file (a pipe, a device), truncated, damaged,
/// too large or of another kind.
cv::Mat load_picture(const std::filesystem::path& file);

/// The same from memory; `name` is what errors call it.
cv::Mat decode_picture(std::span<const unsigned char> bytes, const std::filesystem::path& name);

/// Encodes as PNG. @throws std::invalid_argument for a type that `load_picture` does not return, Error where
/// the picture cannot be encoded: a million pixels wide or high.
std::vector<unsigned char> encode_png(const cv::Mat& image);

/// Encodes 8-bit grey or BGR as JPEG. @param quality 1…100. @throws Error where it cannot be encoded: more
/// than 65,500 pixels wide or high.
std::vector<unsigned char> encode_jpeg(const cv::Mat& image, int quality);

}  // namespace eigenpose
