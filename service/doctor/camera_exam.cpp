#include "doctor/camera_exam.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>

#include "doctor/light_exam.h"

namespace huetrack::doctor {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto first_frame_patience = 3s;  // some cameras start slowly

// Controls that disturb tracking if they change. Others (pan, zoom, LEDs) are not tested.
constexpr std::array<std::string_view, 8> controls_that_matter{
    "exposure_time_absolute", "exposure",  "gain", "analogue_gain", "white_balance_temperature", "focus_absolute",
    "power_line_frequency",   "brightness"};

struct Examined {
  CameraExam exam;
  std::unique_ptr<capture::V4l2Device> device;  // nullptr: could not be opened
  bool is_streaming = false;
};

// One step from its value.
std::optional<capture::ControlSetting> moved(const capture::Control& control) {
  if (control.is_read_only || control.is_button || !control.value) return std::nullopt;
  if (!control.menu.empty()) {
    const auto other =
        std::ranges::find_if(control.menu, [&](const auto& item) { return item.value != control.value; });
    if (other == control.menu.end()) return std::nullopt;
    return capture::ControlSetting{control.name, other->value};
  }
  const std::int64_t step = std::max<std::int64_t>(control.step, 1);
  if (*control.value + step <= control.max) return capture::ControlSetting{control.name, *control.value + step};
  if (*control.value - step >= control.min) return capture::ControlSetting{control.name, *control.value - step};
  return std::nullopt;
}

Examined begin(const ExamRequest& request) {
  Examined examined;
  CameraExam& exam = examined.exam;
  exam.node = request.node;
  exam.name = request.name;
  exam.has_fields = request.has_fields;
  exam.problem = request.node.problem;
  if (!exam.problem.empty()) return examined;
  try {
    examined.device = std::make_unique<capture::V4l2Device>(request.node.identity.node);
    exam.formats = examined.device->formats();
    exam.controls = examined.device->controls();
    if (!request.streams) return examined;
    auto stream = request.stream;
    if (!stream) stream = suitable_stream(exam.formats);
    if (!stream) {
      exam.problem = "it offers no usable format (yuyv, nv12, mjpeg, grey)";
      return examined;
    }
    exam.asked_fps = stream->fps;
    StreamTrial trial;
    trial.agreed = examined.device->start(*stream);
    exam.trial = trial;
    examined.is_streaming = true;
    exam.configured =
        examined.device->set_controls(request.controls);  // not earlier, because another program may use it
  } catch (const capture::CaptureError& error) {
    exam.problem = error.what();
  }
  return examined;
}

void watch(Examined& examined, Clock::time_point end, const std::stop_token& stop) {
  StreamTrial& trial = *examined.exam.trial;
  std::optional<std::chrono::nanoseconds> first, last;
  std::optional<std::uint32_t> sequence;
  LightExam light(std::chrono::duration<double>(end - Clock::now()).count());
  double ages_s = 0;
  const auto give_up = Clock::now() + first_frame_patience;
  while (!stop.stop_requested()) {
    const auto now = Clock::now();
    if (now >= end && (first || now >= give_up)) break;
    const auto result = examined.device->dequeue(100ms);
    if (result.outcome == capture::DequeueOutcome::timeout) continue;
    if (result.outcome != capture::DequeueOutcome::frame) {
      trial.failure = result.message;
      return;
    }
    const capture::Dequeued& frame = result.frame;
    ++trial.frames;
    trial.bytes += frame.bytes.size();
    if (frame.has_error) ++trial.corrupted;
    light.look(frame, trial.agreed);
    trial.stamp = frame.stamp;
    if (sequence && frame.sequence > *sequence + 1) trial.dropped += frame.sequence - *sequence - 1;
    sequence = frame.sequence;
    if (last)
      trial.longest_gap_s = std::max(trial.longest_gap_s, std::chrono::duration<double>(frame.at - *last).count());
    if (!first) first = frame.at;
    last = frame.at;
    ages_s += std::chrono::duration<double>(Clock::now().time_since_epoch() - frame.at).count();
  }
  if (trial.frames == 0) {
    trial.failure = "no frame came";
    return;
  }
  trial.light = light.findings();
  trial.seconds = std::chrono::duration<double>(*last - *first).count();
  trial.mean_age_s = ages_s / double(trial.frames);
}

// After the trial: checks whether controls kept their values and whether others can be changed; restores all.
void finish(Examined& examined) {
  if (!examined.is_streaming) return;
  capture::V4l2Device& device = *examined.device;
  CameraExam& exam = examined.exam;
  const auto controls = exam.configured.empty() ? std::vector<capture::Control>{} : device.controls();
  for (const auto& set : exam.configured) {
    if (!set.problem.empty()) continue;
    capture::ControlResult now = set;
    if (const capture::Control* control = capture::find_control(controls, set.name)) now.got = control->value;
    if (now.got != set.got) now.problem = "it changed while the camera streamed";
    exam.stayed.push_back(std::move(now));
  }
  if (exam.node.identity.usb) exam.trial->usb = capture::usb_reservation(*exam.node.identity.usb);
  device.stop();
  std::vector<capture::ControlSetting> moves;
  for (const auto& control : exam.controls) {
    const bool matters = std::ranges::find(controls_that_matter, control.name) != controls_that_matter.end();
    if (!matters ||
        std::ranges::find(exam.configured, control.name, &capture::ControlResult::name) != exam.configured.end())
      continue;
    if (auto move = moved(control)) moves.push_back(std::move(*move));
  }
  if (!moves.empty()) exam.tried = device.set_controls(moves);
  device.set_controls_plainly(device.previous_controls());
}

}  // namespace

std::optional<capture::StreamRequest> suitable_stream(std::span<const capture::OfferedFormat> formats) {
  constexpr int wanted_width = 640, wanted_height = 480;
  std::optional<capture::StreamRequest> best;
  const auto badness = [](int width, int height) {  // smaller is better; too large is worse than any too small
    const long pixels = long{width} * height, wanted = long{wanted_width} * wanted_height;
    return pixels <= wanted ? wanted - pixels : pixels;
  };
  for (const auto wanted : {capture::CaptureFormat::yuyv, capture::CaptureFormat::nv12, capture::CaptureFormat::mjpeg,
                            capture::CaptureFormat::grey}) {
    for (const auto& offered : formats) {
      if (offered.format != wanted) continue;
      for (const auto& size : offered.sizes) {
        const bool is_range = size.min_width < size.width;
        const int width = is_range ? std::clamp(wanted_width, size.min_width, size.width) : size.width;
        const int height = is_range ? std::clamp(wanted_height, size.min_height, size.height) : size.height;
        if (best && badness(width, height) >= badness(best->width, best->height)) continue;
        const auto nearest = std::ranges::min_element(size.fps, {}, [](double fps) { return std::abs(fps - 30); });
        best = capture::StreamRequest{
            .format = wanted, .width = width, .height = height, .fps = nearest == size.fps.end() ? 0 : *nearest};
      }
    }
  }
  return best;
}

std::vector<CameraExam> examine_cameras(const std::vector<ExamRequest>& requests, std::chrono::duration<double> length,
                                        const std::stop_token& stop) {
  std::vector<Examined> all;
  for (const auto& request : requests) all.push_back(begin(request));
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(length);
  {
    std::vector<std::jthread> watching;
    for (auto& examined : all)
      if (examined.is_streaming) watching.emplace_back([&] { watch(examined, end, stop); });
  }
  std::vector<CameraExam> exams;
  for (auto& examined : all) {
    finish(examined);
    exams.push_back(std::move(examined.exam));
  }
  return exams;
}

}  // namespace huetrack::doctor
