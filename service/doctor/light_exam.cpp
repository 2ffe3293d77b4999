#include "doctor/light_exam.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "reports/light_words.h"

namespace huetrack::doctor {
namespace {

using namespace std::chrono_literals;

constexpr auto settling = 300ms;        // cameras start dark, or adjust their exposure first
constexpr double share_of_trial = 0.5;  // of the trial suffices, because frames may be late

// After set_controls(), or as found.
std::optional<std::int64_t> value_of(const CameraExam& exam, std::string_view name) {
  const auto set = std::ranges::find(exam.configured, name, &capture::ControlResult::name);
  if (set != exam.configured.end()) return set->got;
  const capture::Control* control = capture::find_control(exam.controls, name);
  return control != nullptr ? control->value : std::nullopt;
}

capture::PixelFormat pixels_of(capture::CaptureFormat raw) {
  return raw == capture::CaptureFormat::yuyv   ? capture::PixelFormat::yuyv
         : raw == capture::CaptureFormat::nv12 ? capture::PixelFormat::nv12
                                               : capture::PixelFormat::grey;
}

// uvcvideo's power_line_frequency.
enum PowerLine : std::int64_t { disabled = 0, hz_50 = 1, hz_60 = 2 };

// Exposures of whole flicker periods show no flicker.
bool is_whole(double exposure_ms, double light_hz) {
  const double periods = exposure_ms * light_hz / 1000;
  return periods > 0.5 && std::abs(periods - std::round(periods)) < 0.02 * periods;
}

void judge_exposure_time(const CameraExam& exam, std::vector<Finding>& findings) {
  const auto is_automatic = value_of(exam, "auto_exposure");
  const auto time = value_of(exam, "exposure_time_absolute");  // 0.1 ms
  if (!is_automatic || *is_automatic != 1 || !time || *time <= 0) return;
  const double ms = double(*time) / 10;
  const auto mains = value_of(exam, "power_line_frequency");
  const bool fits_50 = is_whole(ms, 100), fits_60 = is_whole(ms, 120);
  if (mains == hz_50 ? fits_50 : mains == hz_60 ? fits_60 : fits_50 || fits_60) return;
  findings.push_back({Grade::note, fmt::format("exposures of {:.4g} ms show the flicker of lamps", ms),
                      "exposure_time_absolute: 100, 200 or 300 (10, 20, 30 ms) with 50 Hz mains, 83, 167 or 250 with "
                      "60 Hz; any value in daylight"});
}

}  // namespace

LightExam::LightExam(double trial_s) : watch_(share_of_trial * trial_s) {}

void LightExam::look(const capture::Dequeued& frame, const capture::StreamFormat& format) {
  if (!first_) first_ = frame.at;
  if (frame.has_error || frame.at - *first_ < settling) return;
  const capture::Timestamp at{frame.at};
  if (!watch_.is_wanted(at)) return;
  if (format.format == capture::CaptureFormat::mjpeg) {
    if (const auto decoded = jpeg_.read(jpeg_.keep(frame.bytes)); decoded.image) watch_.look(*decoded.image, at);
    return;
  }
  capture::Image image{.format = pixels_of(format.format),
                       .range = format.range,
                       .width = format.width,
                       .height = format.height,
                       .planes = {},
                       .owner = nullptr};
  const auto stride = static_cast<std::ptrdiff_t>(format.stride);
  const std::ptrdiff_t luma = stride * format.height;
  const bool has_chroma_plane = format.format == capture::CaptureFormat::nv12;
  if (std::ptrdiff_t(frame.bytes.size()) < (has_chroma_plane ? luma + luma / 2 : luma)) return;
  image.planes[0] = {frame.bytes.data(), stride};
  if (has_chroma_plane) image.planes[1] = {frame.bytes.data() + luma, stride};
  watch_.look(image, at);
}

std::optional<capture::LightFindings> LightExam::findings() const {
  if (watch_.windows() == 0) return std::nullopt;
  return watch_.findings();
}

std::vector<Finding> judge_light(const CameraExam& exam) {
  std::vector<Finding> findings;
  if (value_of(exam, "exposure_dynamic_framerate").value_or(0) != 0)
    findings.push_back({exam.name.empty() ? Grade::note : Grade::warning,
                        "exposure_dynamic_framerate is on: the frame rate falls in the dark",
                        "controls: {exposure_dynamic_framerate: 0}"});
  if (value_of(exam, "power_line_frequency") == disabled)
    findings.push_back({Grade::note, "power_line_frequency is off: automatic exposure ignores flicker",
                        "controls: {power_line_frequency: 50 Hz}, or 60 Hz as your mains"});
  judge_exposure_time(exam, findings);
  if (!exam.trial || !exam.trial->light) return findings;
  const capture::LightFindings& light = *exam.trial->light;
  for (const auto& remark : reports::light_remarks(light))
    findings.push_back({Grade::warning, "pictures: " + remark.what, remark.advice});
  if (light.exposure_change && value_of(exam, "auto_exposure") == 1)
    findings.push_back({Grade::warning, "auto_exposure is manual, but the brightness changes",
                        "if the light is constant, the camera ignores the setting: set gain, too"});
  if (light == capture::LightFindings{})
    findings.push_back(
        {Grade::ok, fmt::format("pictures: no flicker, constant brightness and colours"), std::string()});
  return findings;
}

}  // namespace huetrack::doctor
