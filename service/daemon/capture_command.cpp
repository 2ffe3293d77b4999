#include "daemon/capture_command.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "daemon/service_manager.h"
#include "hosts/camera_host.h"
#include "pipeline/live_cameras.h"
#include "reports/light_words.h"

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto look_period = 100ms;
constexpr auto status_every = 1s;
constexpr capture::Duration camera_patience = 3s;  // several heartbeats of a camera

std::string said_of(const std::string& name, const capture::CameraHealth& health, const hosts::SentFigures& sent) {
  if (health.state != capture::CaptureState::delivering) return fmt::format("{} {}", name, capture::name(health.state));
  return fmt::format("{} {} frames sent{}", name, sent.frames,
                     sent.left_out == 0 ? "" : fmt::format(", {} left out", sent.left_out));
}

std::string said_of_light(const capture::LightFindings& findings) {
  std::vector<std::string> sentences;
  for (const reports::Remark& remark : reports::light_remarks(findings))
    sentences.push_back(remark.what + ": " + remark.advice);
  return fmt::format("{}", fmt::join(sentences, "; "));
}

}  // namespace

void capture_cameras(const std::filesystem::path& file, const std::stop_token& stop) {
  const config::CaptureConfig config = config::load_capture_config(file);
  set_log_level(config.log_level);
  capture_cameras(config, pipeline::open_cameras(config, stop), stop);
}

void capture_cameras(const config::CaptureConfig& config, std::vector<capture::LiveCamera> cameras,
                     const std::stop_token& stop) {
  hosts::CameraHostOptions options{.host = config.host.empty() ? hosts::name_of_this_machine() : config.host,
                                   .cameras = {},
                                   .program_version = HUETRACK_VERSION,
                                   .transport = config.dds.publisher.transport("huetrackd capture"),
                                   .describe_light = said_of_light};
  for (const auto& camera : config.cameras) options.cameras.push_back(camera.name);
  const std::vector<std::string> names = options.cameras;
  const std::string host = options.host;
  hosts::CameraHost cameras_here(std::move(options), std::move(cameras));
  spdlog::info("camera host {} on {}: trackers name its cameras by host: {}", host, cameras_here.description(), host);

  std::jthread running([&] { cameras_here.run(stop); });
  const auto watchdog = watchdog_period();
  std::vector<hosts::SentFigures> before(names.size());
  Clock::time_point next_status{};
  bool is_ready = false;
  while (!stop.stop_requested()) {
    for (const auto& [camera, event] : cameras_here.publish_states())
      spdlog::log(event.is_problem ? spdlog::level::warn : spdlog::level::info, "camera {}: {}", camera, event.message);
    const auto now = Clock::now();
    if (now >= next_status) {
      next_status = now + status_every;
      const auto healths = cameras_here.healths();
      const auto sent = cameras_here.sent();
      std::vector<std::string> words;
      for (std::size_t c = 0; c < names.size(); ++c) {
        words.push_back(said_of(names[c], healths[c], sent[c]));
        const std::uint64_t fewer = sent[c].refused + sent[c].left_out - before[c].refused - before[c].left_out;
        if (fewer > 0)
          spdlog::warn("camera {}: the network took {} frames fewer than the camera gave", names[c], fewer);
      }
      before = sent;
      if (!std::exchange(is_ready, true)) notify_service_manager("READY=1");
      notify_service_manager(fmt::format("STATUS={}", fmt::join(words, ", ")));
      const capture::Duration patience =
          watchdog ? std::max<capture::Duration>(camera_patience, *watchdog / 2) : capture::Duration(camera_patience);
      if (watchdog && std::ranges::all_of(healths, [&](const auto& h) { return now - h.last_progress <= patience; }))
        notify_service_manager("WATCHDOG=1");
    }
    std::this_thread::sleep_for(look_period);
  }
  notify_service_manager("STOPPING=1\nSTATUS=Stopping");
  running.join();
  const auto sent = cameras_here.sent();
  for (std::size_t c = 0; c < names.size(); ++c)
    spdlog::info("camera {}: {} frames sent, {:.1f} MB, {} left out for a slow network", names[c], sent[c].frames,
                 double(sent[c].bytes) / 1e6, sent[c].left_out);
}

}  // namespace huetrack::daemon
