#include "drivers/v4l2/camera_controls.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>

#include <linux/videodev2.h>

namespace eigenpose {
namespace {

struct Automatic {
  std::uint32_t id;
  std::int64_t off;
};
/// Everything a camera may do by itself, and the value that stops it.
constexpr std::array<Automatic, 6> automatics{{{V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL},
                                               {V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0},
                                               {V4L2_CID_AUTOGAIN, 0},
                                               {V4L2_CID_AUTO_WHITE_BALANCE, 0},
                                               {V4L2_CID_FOCUS_AUTO, 0},
                                               {V4L2_CID_HUE_AUTO, 0}}};

bool is_automatic(std::uint32_t id) {
  return std::any_of(automatics.begin(), automatics.end(), [id](const Automatic& a) { return a.id == id; });
}

bool is_number(std::uint32_t type) {
  switch (type) {
    case V4L2_CTRL_TYPE_INTEGER:
    case V4L2_CTRL_TYPE_BOOLEAN:
    case V4L2_CTRL_TYPE_MENU:
    case V4L2_CTRL_TYPE_INTEGER_MENU:
    case V4L2_CTRL_TYPE_BITMASK:
    case V4L2_CTRL_TYPE_INTEGER64:
      return true;
    default:
      return false;
  }
}

/// The class an id belongs to is part of it; a request names one control of it.
int exchange(VideoDevice& device, unsigned long request, const ControlInfo& control, std::int64_t& value) {
  const bool wide = control.minimum < INT32_MIN || control.maximum > INT32_MAX;
  v4l2_ext_control one{};
  one.id = control.id;
  if (wide) {
    one.value64 = value;
  } else {
    one.value = static_cast<std::int32_t>(value);
  }
  v4l2_ext_controls all{};
  all.which = V4L2_CTRL_WHICH_CUR_VAL;
  all.count = 1;
  all.controls = &one;
  const int error = device.control(request, &all);
  value = wide ? one.value64 : one.value;
  return error;
}

}  // namespace

std::string control_name(const std::string& title) {
  std::string name;
  bool gap = false;
  for (const char letter : title) {
    if (std::isalnum(static_cast<unsigned char>(letter)) == 0) {
      gap = !name.empty();
      continue;
    }
    if (gap) name += '_';
    gap = false;
    name += static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  }
  return name;
}

bool is_picture_control(std::uint32_t id) {
  constexpr std::array shaping{V4L2_CID_EXPOSURE_ABSOLUTE,
                               V4L2_CID_EXPOSURE,
                               V4L2_CID_GAIN,
                               V4L2_CID_ANALOGUE_GAIN,
                               V4L2_CID_DIGITAL_GAIN,
                               V4L2_CID_WHITE_BALANCE_TEMPERATURE,
                               V4L2_CID_RED_BALANCE,
                               V4L2_CID_BLUE_BALANCE,
                               V4L2_CID_FOCUS_ABSOLUTE,
                               V4L2_CID_ZOOM_ABSOLUTE,
                               V4L2_CID_BRIGHTNESS,
                               V4L2_CID_CONTRAST,
                               V4L2_CID_SATURATION,
                               V4L2_CID_HUE,
                               V4L2_CID_GAMMA,
                               V4L2_CID_SHARPNESS,
                               V4L2_CID_BACKLIGHT_COMPENSATION,
                               V4L2_CID_POWER_LINE_FREQUENCY};
  return is_automatic(id) || std::find(shaping.begin(), shaping.end(), id) != shaping.end();
}

CameraControls::CameraControls(VideoDevice& device) : device_(device) {
  v4l2_query_ext_ctrl query{};
  query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
  std::uint32_t last = 0;
  while (device_.control(VIDIOC_QUERY_EXT_CTRL, &query) == 0 && query.id > last) {
    last = query.id;
    if (query.type != V4L2_CTRL_TYPE_CTRL_CLASS && (query.flags & V4L2_CTRL_FLAG_DISABLED) == 0) {
      ControlInfo control;
      control.id = query.id;
      control.name = control_name(std::string(query.name, strnlen(query.name, sizeof query.name)));
      control.minimum = query.minimum;
      control.maximum = query.maximum;
      control.step = static_cast<std::int64_t>(query.step);
      control.preset = query.default_value;
      const bool number = is_number(query.type);
      control.settable = number && (query.flags & V4L2_CTRL_FLAG_READ_ONLY) == 0;
      control.has_value = number && (query.flags & V4L2_CTRL_FLAG_WRITE_ONLY) == 0;
      controls_.push_back(std::move(control));
    }
    query = {};
    query.id = last | V4L2_CTRL_FLAG_NEXT_CTRL;
  }
}

const ControlInfo* CameraControls::find(const std::string& name) const {
  const auto at =
      std::find_if(controls_.begin(), controls_.end(), [&](const auto& c) { return c.name == name; });
  return at == controls_.end() ? nullptr : &*at;
}

const ControlInfo* CameraControls::find(std::uint32_t id) const {
  const auto at = std::find_if(controls_.begin(), controls_.end(), [&](const auto& c) { return c.id == id; });
  return at == controls_.end() ? nullptr : &*at;
}

std::optional<std::int64_t> CameraControls::read(const ControlInfo& control) const {
  std::int64_t value = 0;
  if (!control.has_value || exchange(device_, VIDIOC_G_EXT_CTRLS, control, value) != 0) return std::nullopt;
  return value;
}

ControlResult CameraControls::set(const ControlInfo& control, std::int64_t value) {
  ControlResult result{control.name, value, std::nullopt, {}};
  std::int64_t granted = value;
  const int error = exchange(device_, VIDIOC_S_EXT_CTRLS, control, granted);
  result.granted = read(control);
  if (error != 0) {
    result.problem = std::strerror(error);
    result.problem +=
        "; it takes " + std::to_string(control.minimum) + " to " + std::to_string(control.maximum);
  } else if (result.granted && *result.granted != value) {
    result.problem = "the camera made it " + std::to_string(*result.granted);
  }
  return result;
}

std::vector<ControlResult> CameraControls::lock_automatics() {
  std::vector<ControlResult> results;
  for (const auto& automatic : automatics) {
    const ControlInfo* control = find(automatic.id);
    if (control != nullptr && control->settable) results.push_back(set(*control, automatic.off));
  }
  return results;
}

std::vector<ControlResult> CameraControls::apply(const std::map<std::string, std::int64_t>& values) {
  std::vector<ControlResult> results;
  for (const bool automatic : {true, false}) {
    for (const auto& [name, value] : values) {
      const ControlInfo* control = find(name);
      if (control == nullptr) {
        if (!automatic) results.push_back({name, value, std::nullopt, "this camera has no such control"});
      } else if (is_automatic(control->id) == automatic) {
        results.push_back(set(*control, value));
      }
    }
  }
  return results;
}

std::map<std::string, std::int64_t> CameraControls::snapshot() const {
  std::map<std::string, std::int64_t> values;
  for (const ControlInfo& control : controls_) {
    if (const auto value = read(control)) values[control.name] = *value;
  }
  return values;
}

std::optional<Duration> CameraControls::locked_exposure() const {
  const ControlInfo* automatic = find(V4L2_CID_EXPOSURE_AUTO);
  const ControlInfo* exposure = find(V4L2_CID_EXPOSURE_ABSOLUTE);
  if (exposure == nullptr) return std::nullopt;
  if (automatic != nullptr) {
    const auto mode = read(*automatic);
    if (mode != V4L2_EXPOSURE_MANUAL && mode != V4L2_EXPOSURE_SHUTTER_PRIORITY) return std::nullopt;
  }
  const auto value = read(*exposure);
  if (!value || *value <= 0) return std::nullopt;
  return std::chrono::microseconds(*value * 100);  // the control counts in units of 100 µs
}

}  // namespace eigenpose
