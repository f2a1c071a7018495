#pragma once

/// Luma of camera formats. For grey pictures no colour is computed.

#include <cstddef>
#include <cstdint>

namespace eigenpose {

/// How luma bytes stand for brightness.
enum class LumaRange {
  full,     ///< 0 … 255
  limited,  ///< 16 … 235 (ITU-R BT.601); spread to 0 … 255 on the way, so that black is 0
};

/// Every second byte of `source` (Y U Y V …), `pixels` of them. `source` holds 2·pixels bytes.
void luma_of_yuyv(const std::uint8_t* source, std::uint8_t* luma, std::size_t pixels, LumaRange range);

/// A row of luma as it is, or spread.
void copy_luma(const std::uint8_t* source, std::uint8_t* luma, std::size_t pixels, LumaRange range);

}  // namespace eigenpose
