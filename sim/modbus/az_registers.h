#pragma once

/// The register map of the simulated drive: addresses, what may be read and written, and the bits of input
/// and output. After "AZ Series function edition" (HM-60262E), chapter Modbus RTU. For AzDrive only.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>

namespace eigenpose::sim {

// Registers -----------------------------------------------------------------------------------------------
inline constexpr std::uint16_t reg_operation_type = 0x005A;
inline constexpr std::uint16_t reg_position = 0x005C;
inline constexpr std::uint16_t reg_speed = 0x005E;
inline constexpr std::uint16_t reg_changing_rate = 0x0060;
inline constexpr std::uint16_t reg_stopping_rate = 0x0062;
inline constexpr std::uint16_t reg_data_number = 0x0058;
inline constexpr std::uint16_t reg_trigger = 0x0066;
inline constexpr std::uint16_t reg_input_automatic_off = 0x0078;
inline constexpr std::uint16_t reg_input = 0x007C;
inline constexpr std::uint16_t reg_output = 0x007E;
inline constexpr std::uint16_t reg_alarm = 0x0080;
inline constexpr std::uint16_t reg_command_position = 0x00C6;
inline constexpr std::uint16_t reg_command_speed_rpm = 0x00C8;
inline constexpr std::uint16_t reg_command_speed_hz = 0x00CA;
inline constexpr std::uint16_t reg_feedback_position = 0x00CC;
inline constexpr std::uint16_t reg_feedback_speed_rpm = 0x00CE;
inline constexpr std::uint16_t reg_feedback_speed_hz = 0x00D0;
inline constexpr std::uint16_t reg_alarm_reset = 0x0180;
inline constexpr std::uint16_t reg_preset = 0x018A;
inline constexpr std::uint16_t reg_communication_timeout = 0x138A;

struct RegisterRange {
  std::uint16_t first;
  std::uint16_t last;
};
/// What can be read and written back.
inline constexpr RegisterRange kept_ranges[] = {
    {0x0058, 0x0069}, {0x0078, 0x007D}, {0x0180, 0x0181}, {0x018A, 0x018B}, {0x1380, 0x1393}};
/// What can only be read.
inline constexpr RegisterRange monitor_ranges[] = {{0x007E, 0x0081}, {0x00C6, 0x00D1}};

template <std::size_t n>
bool within(const RegisterRange (&ranges)[n], std::uint16_t address) {
  return std::any_of(std::begin(ranges), std::end(ranges),
                     [&](const RegisterRange& r) { return address >= r.first && address <= r.last; });
}

// Input and output bits -----------------------------------------------------------------------------------
inline constexpr unsigned in_zhome = 1U << 4U;
inline constexpr unsigned in_stop = 1U << 5U;
inline constexpr unsigned in_free = 1U << 6U;
inline constexpr unsigned in_alarm_reset = 1U << 7U;
inline constexpr unsigned in_forward = 1U << 14U;
inline constexpr unsigned in_reverse = 1U << 15U;
/// START and what moves by stored operation data.
inline constexpr unsigned in_unserved = (1U << 3U) | (1U << 8U) | (1U << 9U) | (1U << 10U) | (1U << 11U);

inline constexpr unsigned out_home_end = 1U << 4U;
inline constexpr unsigned out_ready = 1U << 5U;
inline constexpr unsigned out_alarm = 1U << 7U;
inline constexpr unsigned out_move = 1U << 13U;
inline constexpr unsigned out_in_position = 1U << 14U;

}  // namespace eigenpose::sim
