#include "doctor/network_exam.h"

#include <fmt/format.h>

#include <optional>
#include <thread>

namespace huetrack::doctor {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

NetworkTrial try_network_camera(const capture::NetworkSourceOptions& options, std::chrono::duration<double> seconds,
                                const std::stop_token& stop) {
  capture::NetworkSource source(options);
  std::stop_source enough;
  const std::stop_callback forward(stop, [&] { enough.request_stop(); });
  // The source retries; here the first failure is the result.
  const std::jthread watch([&](const std::stop_token& done) {
    std::optional<Clock::time_point> first;
    while (!done.stop_requested()) {
      std::this_thread::sleep_for(20ms);
      const capture::CameraHealth health = source.health();
      if (health.frames > 0 && !first) first = Clock::now();
      if (health.state == capture::CaptureState::absent || (first && Clock::now() - *first >= seconds)) break;
    }
    enough.request_stop();
  });
  NetworkTrial trial;
  std::optional<Clock::time_point> first, last;
  while (const auto frame = source.next(enough.get_token())) {
    if (frame->status != capture::FrameStatus::ok) continue;
    last = Clock::now();
    if (!first) first = last;
    ++trial.pictures;
  }
  if (first) trial.seconds = std::chrono::duration<double>(*last - *first).count();
  const capture::CameraHealth health = source.health();
  if (health.state == capture::CaptureState::absent) {
    constexpr std::string_view tries_again = "; trying again";
    trial.failure = health.message;
    if (trial.failure.ends_with(tries_again)) trial.failure.resize(trial.failure.size() - tries_again.size());
  } else if (!first) {
    trial.failure = "no picture came";
  }
  return trial;
}

Finding judge_network_camera(const NetworkTrial& trial) {
  if (trial.failure.empty())
    return {Grade::ok, fmt::format("it delivers: {} pictures, {:.1f} per second", trial.pictures, trial.fps()), ""};
  return {Grade::problem, trial.failure,
          "check whether the camera is on, and whether ffplay shows that address; the service starts without it and "
          "uses it when it appears"};
}

}  // namespace huetrack::doctor
