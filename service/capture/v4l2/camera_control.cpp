#include "capture/v4l2/camera_control.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <utility>

#include "calib/files/nearest_word.h"
#include "capture/v4l2/v4l2_call.h"

namespace huetrack::capture {
namespace {

using v4l2::AnswerWatch, v4l2::call, v4l2::text_of, v4l2::zeroed;

// As v4l2-ctl does: "Exposure Time, Absolute" is exposure_time_absolute.
std::string variable_name(std::string_view text) {
  std::string name;
  bool gap = false;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) {
      gap = true;
      continue;
    }
    if (gap && !name.empty()) name += '_';
    gap = false;
    name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return name;
}

// Names before about Linux 5.14, which tutorials still use.
constexpr std::array<std::pair<std::string_view, std::uint32_t>, 8> older_names{
    {{"exposure_auto", V4L2_CID_EXPOSURE_AUTO},
     {"exposure_absolute", V4L2_CID_EXPOSURE_ABSOLUTE},
     {"exposure_auto_priority", V4L2_CID_EXPOSURE_AUTO_PRIORITY},
     {"white_balance_temperature_auto", V4L2_CID_AUTO_WHITE_BALANCE},
     {"focus_auto", V4L2_CID_FOCUS_AUTO},
     {"gain_auto", V4L2_CID_AUTOGAIN},
     {"hue_auto", V4L2_CID_HUE_AUTO},
     {"white_balance", V4L2_CID_WHITE_BALANCE_TEMPERATURE}}};

// A manual value and the automatic control that overrides it.
struct Override {
  std::uint32_t id, automatic;
  std::int64_t manual;  // value of the automatic control that enables manual setting
};
constexpr std::array<Override, 11> overrides{
    {{V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL},
     {V4L2_CID_EXPOSURE, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL},
     {V4L2_CID_WHITE_BALANCE_TEMPERATURE, V4L2_CID_AUTO_WHITE_BALANCE, 0},
     {V4L2_CID_RED_BALANCE, V4L2_CID_AUTO_WHITE_BALANCE, 0},
     {V4L2_CID_BLUE_BALANCE, V4L2_CID_AUTO_WHITE_BALANCE, 0},
     {V4L2_CID_FOCUS_ABSOLUTE, V4L2_CID_FOCUS_AUTO, 0},
     {V4L2_CID_GAIN, V4L2_CID_AUTOGAIN, 0},
     {V4L2_CID_ISO_SENSITIVITY, V4L2_CID_ISO_SENSITIVITY_AUTO, V4L2_ISO_SENSITIVITY_MANUAL},
     {V4L2_CID_HUE, V4L2_CID_HUE_AUTO, 0},
     {V4L2_CID_BRIGHTNESS, V4L2_CID_AUTOBRIGHTNESS, 0},
     {V4L2_CID_CHROMA_GAIN, V4L2_CID_CHROMA_AGC, 0}}};

const Override* override_of(std::uint32_t id) {
  const auto* over = std::ranges::find(overrides, id, &Override::id);
  return over == overrides.end() ? nullptr : over;
}

bool is_automatic(std::uint32_t id) {
  return std::ranges::find(overrides, id, &Override::automatic) != overrides.end();
}

// 0, or errno. value: nullopt where it cannot be read.
int read_value(const FileDescriptor& fd, Control& into) {
  auto control = zeroed<v4l2_ext_control>();
  control.id = into.id;
  auto list = zeroed<v4l2_ext_controls>();
  list.which = V4L2_CTRL_WHICH_CUR_VAL;
  list.count = 1;
  list.controls = &control;
  into.value.reset();
  if (const int e = call(fd, VIDIOC_G_EXT_CTRLS, list)) return e;
  into.value = into.is_64_bit ? control.value64 : control.value;
  return 0;
}

int set_value(const FileDescriptor& fd, std::uint32_t id, bool is_64_bit, std::int64_t value) {
  auto control = zeroed<v4l2_ext_control>();
  control.id = id;
  if (is_64_bit)
    control.value64 = value;
  else
    control.value = static_cast<std::int32_t>(value);
  auto list = zeroed<v4l2_ext_controls>();
  list.which = V4L2_CTRL_WHICH_CUR_VAL;
  list.count = 1;
  list.controls = &control;
  return call(fd, VIDIOC_S_EXT_CTRLS, list);
}

// All controls, without values. Ends early when the camera does not answer.
std::vector<Control> controls_of(const FileDescriptor& fd, AnswerWatch& answers) {
  std::vector<Control> controls;
  std::uint32_t last = 0;
  while (true) {
    auto query = zeroed<v4l2_query_ext_ctrl>();
    query.id = last | V4L2_CTRL_FLAG_NEXT_CTRL;
    if (answers.watch([&] { return call(fd, VIDIOC_QUERY_EXT_CTRL, query); }) != 0 || query.id <= last) break;
    last = query.id;
    switch (query.type) {
      case V4L2_CTRL_TYPE_INTEGER:
      case V4L2_CTRL_TYPE_INTEGER64:
      case V4L2_CTRL_TYPE_BOOLEAN:
      case V4L2_CTRL_TYPE_MENU:
      case V4L2_CTRL_TYPE_INTEGER_MENU:
      case V4L2_CTRL_TYPE_BITMASK:
      case V4L2_CTRL_TYPE_BUTTON:
        break;
      default:
        continue;  // headings, strings, compound ones
    }
    if ((query.flags & V4L2_CTRL_FLAG_DISABLED) != 0) continue;
    Control control;
    control.id = query.id;
    control.name = variable_name(query.name);
    control.min = query.minimum;
    control.max = query.maximum;
    control.step = static_cast<std::int64_t>(std::max<__u64>(query.step, 1));
    control.default_value = query.default_value;
    control.is_boolean = query.type == V4L2_CTRL_TYPE_BOOLEAN;
    control.is_64_bit = query.type == V4L2_CTRL_TYPE_INTEGER64;
    control.is_button = query.type == V4L2_CTRL_TYPE_BUTTON;
    control.is_read_only = (query.flags & V4L2_CTRL_FLAG_READ_ONLY) != 0;
    control.is_write_only = (query.flags & V4L2_CTRL_FLAG_WRITE_ONLY) != 0;
    control.is_inactive = (query.flags & V4L2_CTRL_FLAG_INACTIVE) != 0;
    if (query.type == V4L2_CTRL_TYPE_MENU || query.type == V4L2_CTRL_TYPE_INTEGER_MENU)
      for (std::int64_t i = query.minimum; i <= query.maximum && i < query.minimum + 256; ++i) {
        auto item = zeroed<v4l2_querymenu>();
        item.id = query.id;
        item.index = static_cast<std::uint32_t>(i);
        if (call(fd, VIDIOC_QUERYMENU, item) != 0) continue;
        control.menu.push_back(
            {i, query.type == V4L2_CTRL_TYPE_MENU ? text_of(item.name) : std::to_string(item.value)});
      }
    controls.push_back(std::move(control));
  }
  return controls;
}

// Updates the value and is_inactive.
void read_state(const FileDescriptor& fd, Control& control, AnswerWatch& answers) {
  if (answers.has_given_up()) return;
  auto query = zeroed<v4l2_query_ext_ctrl>();
  query.id = control.id;
  if (answers.watch([&] { return call(fd, VIDIOC_QUERY_EXT_CTRL, query); }) == 0)
    control.is_inactive = (query.flags & V4L2_CTRL_FLAG_INACTIVE) != 0;
  if (!control.is_write_only && !answers.has_given_up()) answers.watch([&] { return read_value(fd, control); });
}

Control* find_control(std::vector<Control>& controls, std::uint32_t id) {
  const auto found = std::ranges::find(controls, id, &Control::id);
  return found == controls.end() ? nullptr : &*found;
}

std::string value_text(const Control& control, std::int64_t value) {
  const auto item = std::ranges::find(control.menu, value, &ControlMenuItem::value);
  return std::to_string(value) + (item == control.menu.end() ? "" : " (" + item->name + ")");
}

std::string range_text(const Control& control) {
  if (control.menu.empty())
    return std::to_string(control.min) + " to " + std::to_string(control.max) +
           (control.step > 1 ? " in steps of " + std::to_string(control.step) : "");
  std::vector<std::string> values;
  for (const auto& item : control.menu) values.push_back(value_text(control, item.value));
  return fmt::format("{}", fmt::join(values, ", "));
}

// The number, or a sentence on what is wrong with the value.
std::variant<std::int64_t, std::string> number_for(const Control& control, const ControlValue& value) {
  if (const auto* number = std::get_if<std::int64_t>(&value)) {
    if (control.is_button) return *number;
    const bool is_known =
        control.menu.empty() || std::ranges::find(control.menu, *number, &ControlMenuItem::value) != control.menu.end();
    if (is_known && *number >= control.min && *number <= control.max) return *number;
    return "is out of range: it takes " + range_text(control);
  }
  const std::string& text = std::get<std::string>(value);
  const std::string wanted = variable_name(text);
  for (const auto& item : control.menu)
    if (variable_name(item.name) == wanted) return item.value;
  if (control.is_boolean) {
    if (wanted == "on" || wanted == "true" || wanted == "yes") return 1;
    if (wanted == "off" || wanted == "false" || wanted == "no") return 0;
  }
  return "'" + text + "' is none of its values: it takes " + range_text(control);
}

}  // namespace

const Control* find_control(const std::vector<Control>& controls, std::string_view name) {
  const std::string wanted = variable_name(name);
  auto found = std::ranges::find(controls, wanted, &Control::name);
  if (found == controls.end())
    if (const auto* older = std::ranges::find(older_names, wanted, &std::pair<std::string_view, std::uint32_t>::first);
        older != older_names.end())
      found = std::ranges::find(controls, older->second, &Control::id);
  return found == controls.end() ? nullptr : &*found;
}

ControlSetting control_setting(std::string name, const std::string& text) {
  if (text == "true" || text == "false") return {std::move(name), std::int64_t{text == "true"}};
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc{} && end == text.data() + text.size()) return {std::move(name), number};
  return {std::move(name), text};
}

std::string to_string(const ControlResult& result) {
  return result.name + (result.is_implied ? ": set to " : ": asked ") + result.asked +
         (result.got ? ", got " + std::to_string(*result.got) : std::string()) +
         (result.problem.empty() ? "" : ": " + result.problem);
}

namespace {

struct ControlStep {
  std::optional<std::uint32_t> id;  // nullopt: nothing to set, see result.problem
  std::int64_t value = 0;
  bool is_64_bit = false;
  int error = 0;  // from setting it
  ControlResult result;
};

// The steps of V4l2Device::set_controls(), in the order of the public functions.
class ControlChange {
 public:
  ControlChange(const FileDescriptor& fd, std::span<const ControlSetting> settings)
      : fd_(fd), controls_(controls_of(fd, answers_)) {
    for (const auto& setting : settings) steps_.push_back(step_for(setting));
    for (const auto& step : steps_)
      if (const Override* over = step.id ? override_of(*step.id) : nullptr)
        if (Control* automatic = find_control(controls_, over->automatic);
            automatic && std::ranges::find(automatics_, automatic) == automatics_.end())
          automatics_.push_back(automatic);
    for (Control* automatic : automatics_) read_state(fd_, *automatic, answers_);
  }

  // Adds steps that switch off the automatic controls which override requested values.
  void switch_off_overriding() {
    const auto asked = steps_.size();
    for (std::size_t i = 0; i < asked; ++i) {
      const Override* over = steps_[i].id ? override_of(*steps_[i].id) : nullptr;
      const Control* automatic = over ? find_control(controls_, over->automatic) : nullptr;
      if (!automatic || automatic->value == over->manual || automatic->is_read_only) continue;
      if (std::ranges::any_of(steps_, [&](const ControlStep& step) { return step.id == over->automatic; })) continue;
      ControlStep step;
      step.id = automatic->id;
      step.value = over->manual;
      step.result.name = automatic->name;
      step.result.asked = value_text(*automatic, over->manual);
      step.result.is_implied = true;
      steps_.push_back(std::move(step));
    }
  }

  void put_in_order(bool automatics_first) {
    for (auto& step : steps_)
      if (step.id) order_.push_back(&step);
    if (automatics_first)
      std::ranges::stable_partition(order_, [](const ControlStep* step) { return is_automatic(*step->id); });
  }

  // Puts values that will change in front of `previous`: a value is set back before the automatic control that
  // overrides it.
  void remember_values(std::vector<ControlSetting>& previous) const {
    for (const ControlStep* step : order_) {
      const Control& control = control_of(*step);
      const bool is_new =
          std::ranges::find(previous, control.name, &ControlSetting::name) == previous.end() && control.value;
      if (is_new && *control.value != step->value)
        previous.insert(previous.begin(), {.name = control.name, .value = *control.value});
    }
  }

  // Tries refused ones again: what overrode them may be off only then.
  void set() {
    for (ControlStep* step : order_) set(*step);
    for (ControlStep* step : order_)
      if (step->error != 0 && !answers_.has_given_up()) set(*step);
  }

  // After all were set, because one control may change another.
  void read_back() {
    for (const ControlStep* step : order_) read_state(fd_, control_of(*step), answers_);
    for (Control* automatic : automatics_) read_state(fd_, *automatic, answers_);
  }

  std::vector<ControlResult> take_results() {
    std::vector<ControlResult> results;
    for (auto& step : steps_) {
      if (step.id && answers_.has_given_up())
        mark_unanswered(step.result);
      else if (step.id)
        judge(step);
      results.push_back(std::move(step.result));
    }
    return results;
  }

 private:
  ControlStep step_for(const ControlSetting& setting) {
    ControlStep step;
    ControlResult& result = step.result;
    const auto* number = std::get_if<std::int64_t>(&setting.value);
    result.name = setting.name;
    result.asked = number ? std::to_string(*number) : std::get<std::string>(setting.value);
    const Control* named = answers_.has_given_up() ? nullptr : find_control(std::as_const(controls_), setting.name);
    Control* control = named ? find_control(controls_, named->id) : nullptr;
    if (control) read_state(fd_, *control, answers_);
    if (answers_.has_given_up()) {
      mark_unanswered(result);
    } else if (!control) {
      std::vector<std::string> names;
      for (const auto& c : controls_) names.push_back(c.name);
      const auto nearest = files::nearest_word(variable_name(setting.name), names);
      result.problem = "this camera has no such control" + (nearest ? " (did you mean " + *nearest + "?)" : "");
    } else if (control->is_read_only) {
      result.got = control->value;
      result.problem = "cannot be set: it is read-only";
    } else if (const auto meant = number_for(*control, setting.value); std::holds_alternative<std::string>(meant)) {
      result.got = control->value;
      result.problem = std::get<std::string>(meant);
    } else {
      step.id = control->id;
      step.value = std::get<std::int64_t>(meant);
      step.is_64_bit = control->is_64_bit;
    }
    return step;
  }

  void set(ControlStep& step) {
    step.error = answers_.has_given_up()
                     ? answers_.error()
                     : answers_.watch([&] { return set_value(fd_, *step.id, step.is_64_bit, step.value); });
  }

  void mark_unanswered(ControlResult& result) const {
    result.problem = "the camera does not answer: " + std::generic_category().message(answers_.error());
    result.is_unanswered = true;
  }

  // Fills in the result from the value that was read back.
  void judge(ControlStep& step) {
    const Control& control = control_of(step);
    ControlResult& result = step.result;
    result.got = control.value;
    const Override* over = override_of(control.id);
    const Control* automatic = over ? find_control(controls_, over->automatic) : nullptr;
    const std::string overridden_by = automatic && automatic->value && *automatic->value != over->manual
                                          ? ": " + automatic->name + " is " +
                                                value_text(*automatic, *automatic->value) + ", set it to " +
                                                value_text(*automatic, over->manual)
                                          : std::string();
    if (step.error != 0)
      result.problem = "the camera refuses it: " + std::generic_category().message(step.error) + overridden_by;
    else if (!control.value)
      return;  // write-only, such as a button
    else if (*control.value != step.value)
      result.problem = "the camera made it " + value_text(control, *control.value) + " (it takes " +
                       range_text(control) + ")" + overridden_by;
    else if (!overridden_by.empty() && control.is_inactive)
      result.problem = "has no effect now" + overridden_by;
  }

  const Control& control_of(const ControlStep& step) const {
    return *std::ranges::find(controls_, *step.id, &Control::id);
  }
  Control& control_of(const ControlStep& step) { return *find_control(controls_, *step.id); }

  const FileDescriptor& fd_;
  AnswerWatch answers_;  // before controls_, whose initialiser uses it
  std::vector<Control> controls_;
  std::vector<ControlStep> steps_;    // the requested ones, then the implied ones
  std::vector<Control*> automatics_;  // that override requested ones; point into controls_
  std::vector<ControlStep*> order_;   // point into steps_, which no longer grows
};

}  // namespace

namespace v4l2 {

std::vector<Control> read_controls(const FileDescriptor& fd) {
  AnswerWatch answers;
  auto controls = controls_of(fd, answers);
  for (auto& control : controls)
    if (!control.is_write_only && !answers.has_given_up()) answers.watch([&] { return read_value(fd, control); });
  return controls;
}

std::vector<ControlResult> apply_controls(const FileDescriptor& fd, std::span<const ControlSetting> settings,
                                          bool with_implied, std::vector<ControlSetting>& previous) {
  if (settings.empty()) return {};
  ControlChange change(fd, settings);
  if (with_implied) change.switch_off_overriding();
  change.put_in_order(with_implied);
  if (with_implied) change.remember_values(previous);
  change.set();
  change.read_back();
  return change.take_results();
}

}  // namespace v4l2
}  // namespace huetrack::capture
