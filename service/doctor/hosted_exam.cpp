#include "doctor/hosted_exam.h"

#include <algorithm>
#include <thread>

#include "pipeline/live_cameras.h"

namespace huetrack::doctor {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::duration<double> least_duration = 5500ms;  // clocks are judged after 5 s (remote_camera.cpp)
constexpr auto look_period = 50ms;

// Takes the frames of one camera until the stop.
double fps_of(capture::FrameSource& source, const std::stop_token& stop) {
  Clock::time_point first, last;
  int frames = 0;
  while (source.next(stop)) {
    last = Clock::now();
    if (frames++ == 0) first = last;
  }
  return frames < 2 ? 0 : (frames - 1) / std::chrono::duration<double>(last - first).count();
}

}  // namespace

std::vector<HostedExam> examine_hosted(const config::ServiceConfig& config, std::chrono::duration<double> duration,
                                       const std::stop_token& stop) {
  config::ServiceConfig hosted = config::with_frames(config);  // each with its own source
  std::erase_if(hosted.cameras, [](const auto& camera) { return camera.host.empty(); });
  if (hosted.cameras.empty()) return {};
  const auto cameras = pipeline::open_cameras(hosted, stop);
  std::vector<HostedExam> exams;
  for (const auto& camera : hosted.cameras) exams.push_back({.name = camera.name, .host = camera.host, .health = {}});

  std::stop_source ended;
  {
    std::vector<std::jthread> readers;
    for (std::size_t c = 0; c < cameras.size(); ++c)
      readers.emplace_back([&, c] { exams[c].fps = fps_of(*cameras[c].source, ended.get_token()); });
    const auto until = Clock::now() + std::max(duration, least_duration);
    while (!stop.stop_requested() && Clock::now() < until) std::this_thread::sleep_for(look_period);
    for (std::size_t c = 0; c < cameras.size(); ++c) exams[c].health = cameras[c].health();
    ended.request_stop();
  }
  return exams;
}

}  // namespace huetrack::doctor
