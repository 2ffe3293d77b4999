#include "reports/light_words.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "object_tracking/trackers/color_follower.h"

namespace huetrack::reports {
namespace {

using object_trackers::ColorAxis;
using object_trackers::ColorHealth;
using object_trackers::NearEnd;

std::string flicker_advice(bool is_50_hz, bool has_controls) {
  const std::string mains = is_50_hz ? "50 Hz" : "60 Hz";
  if (!has_controls)
    return "its mains frequency to " + mains + ", or the exposure to " +
           (is_50_hz ? "10, 20 or 30" : "8.3, 16.7 or 25") + " ms, in the camera's own program";
  return "controls: {power_line_frequency: " + mains + "}, or exposure_time_absolute: " +
         (is_50_hz ? "100, 200 or 300 (10, 20, 30 ms)" : "83, 167 or 250 (8.3, 16.7, 25 ms)");
}

// left: distance from the object's median to the end of its range.
std::string margin_text(double left, const std::string& amount) {
  return amount + (left > 0 ? " before the end of its range" : " beyond its range");
}

std::string movement(const NearEnd& end, const ColorHealth& health) {
  const auto& median = health.seen->median;
  switch (end.axis) {
    case ColorAxis::hue:
      return fmt::format("the colour differs by {:.0f} degrees from the configured one, {}", std::abs(median[0]),
                         margin_text(end.left, fmt::format("{:.0f} degrees", std::abs(end.left))));
    case ColorAxis::saturation:
      return fmt::format("the colour is {} than the configured one (saturation {:.2f}), {}",
                         end.is_upper ? "stronger" : "paler", median[1],
                         margin_text(end.left, fmt::format("{:.2f}", std::abs(end.left))));
    case ColorAxis::intensity:
      break;
  }
  return fmt::format("the colour is {} than the configured one (intensity {:.2f}), {}",
                     end.is_upper ? "brighter" : "darker", median[2],
                     margin_text(end.left, fmt::format("{:.2f}", std::abs(end.left))));
}

}  // namespace

std::vector<Remark> light_remarks(const capture::LightFindings& findings, bool has_controls) {
  std::vector<Remark> remarks;
  if (findings.flicker) {
    const bool is_50_hz = findings.flicker->light_hz < 110;
    remarks.push_back({fmt::format("the light flickers at {:.0f} Hz, in bands of {:.1f} % of the brightness",
                                   findings.flicker->light_hz, 100 * findings.flicker->modulation),
                       flicker_advice(is_50_hz, has_controls),
                       fmt::format("flicker at {:.0f} Hz", findings.flicker->light_hz)});
  }
  if (findings.exposure_change)
    remarks.push_back({fmt::format("the whole picture becomes {:.0f} % brighter or darker within seconds: automatic "
                                   "exposure is on, or the light changes",
                                   100 * *findings.exposure_change),
                       has_controls ? "controls: {auto_exposure: 1, exposure_time_absolute: 100, gain: ...} (1: "
                                      "manual), and exposure_dynamic_framerate: 0"
                                    : "exposure and gain to manual in the camera's own program",
                       "automatic exposure or changing light"});
  if (findings.balance_change)
    remarks.push_back({fmt::format("all colours of the picture shift, by {:.0f} % of red or blue within seconds: "
                                   "automatic white balance is on, or the light changes",
                                   100 * *findings.balance_change),
                       has_controls ? "controls: {white_balance_automatic: 0, white_balance_temperature: 4600}"
                                    : "white balance to manual in the camera's own program",
                       "automatic white balance or changing light"});
  return remarks;
}

std::string color_warning(const object_tracking::TargetOptions& target, const std::string& camera,
                          const ColorHealth& health, bool is_recorded) {
  if (!health.near_end || !health.seen) return {};
  const bool is_light = health.near_end->axis == ColorAxis::intensity;
  const auto axis = std::size_t(health.near_end->axis);
  const bool is_at_limit = std::abs(health.followed[axis]) > 0.95 * object_trackers::furthest_followed[axis];
  const char* const fix = is_recorded ? "" : is_light ? "fix exposure and gain, " : "fix white balance and exposure, ";
  return fmt::format("{} in {}: {}: {}", target.name, camera, movement(*health.near_end, health),
                     target.adapts_color && is_at_limit
                         ? "color: adapt has reached its limit: teach the colour in this light"
                     : target.adapts_color ? "color: adapt follows it"
                                           : fmt::format("{}teach it, or set color: {{adapt: true}}", fix));
}

bool is_lost(const ColorHealth& health, object_tracking::TrackState state) {
  return health.near_end && (health.near_end->left < 0 || state == object_tracking::TrackState::lost);
}

std::string followed_text(const std::string& camera, const ColorHealth& health) {
  const auto& by = health.followed;
  std::vector<std::string> parts;
  if (std::abs(by[0]) >= 0.5) parts.push_back(fmt::format("{:+.0f} degrees of hue", by[0]));
  if (std::abs(by[1]) >= 0.005) parts.push_back(fmt::format("{:+.2f} of saturation", by[1]));
  if (std::abs(by[2]) >= 0.005) parts.push_back(fmt::format("{:+.2f} of intensity", by[2]));
  if (parts.empty()) return {};
  return fmt::format("its colour in {} was followed, at the end by {}", camera, fmt::join(parts, ", "));
}

}  // namespace huetrack::reports
