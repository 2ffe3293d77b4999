// A camera's controls: exposure, gain, white balance and so on.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "capture/frames/file_descriptor.h"

namespace huetrack::capture {

struct ControlMenuItem {
  std::int64_t value = 0;
  std::string name;  // "Manual Mode"; for an integer menu its number
};
struct Control {
  std::uint32_t id = 0;
  std::string name;  // as v4l2-ctl writes it: "exposure_time_absolute"
  std::int64_t min = 0, max = 0, step = 1, default_value = 0;
  std::optional<std::int64_t> value;  // nullopt: cannot be read
  std::vector<ControlMenuItem> menu;  // of menus only
  bool is_boolean = false;
  bool is_64_bit = false;
  bool is_button = false;  // any value presses it; it cannot be read
  bool is_read_only = false;
  bool is_write_only = false;
  bool is_inactive = false;  // overridden by another control, mostly an automatic one
};
// By its name, or its older one: "exposure_auto". nullptr: the camera does not have it.
const Control* find_control(const std::vector<Control>& controls, std::string_view name);

// A menu entry may be given by its name; case, blanks and punctuation do not matter ("manual_mode", "50 Hz").
using ControlValue = std::variant<std::int64_t, std::string>;
struct ControlSetting {
  std::string name;
  ControlValue value;
};
// From a configuration's text: a number, true or false (1 or 0), or else a menu entry's name.
ControlSetting control_setting(std::string name, const std::string& text);
struct ControlResult {
  std::string name;
  std::string asked;                // as text
  std::optional<std::int64_t> got;  // read back; nullopt: unreadable or not there
  std::string problem;              // refused, rounded, unknown, overridden: one sentence; empty: it was set
  bool is_implied = false;          // not requested: an automatic control that had to be off for a requested value
  bool is_unanswered = false;       // the camera is gone or locked up; later settings were not tried
};
std::string to_string(const ControlResult& result);  // "exposure_time_absolute: asked 100, got 100"

namespace v4l2 {

std::vector<Control> read_controls(const FileDescriptor& fd);
// V4l2Device::set_controls(), or set_controls_plainly() when not with_implied. previous:
// V4l2Device::previous_controls(), extended when with_implied.
std::vector<ControlResult> apply_controls(const FileDescriptor& fd, std::span<const ControlSetting> settings,
                                          bool with_implied, std::vector<ControlSetting>& previous);

}  // namespace v4l2
}  // namespace huetrack::capture
