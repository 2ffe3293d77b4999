#include "daemon/status_reporter.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/model/rig_yaml.h"
#include "reports/search_advice.h"

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;

constexpr auto stalled_after = 1s;
// 1 to 2 s, because some cameras show a fixed picture while they warm up.
constexpr std::uint64_t frames_of_one_picture = 60;
constexpr auto shortest_rate_window = 500ms;

// The same states, by number; Health::ended is added.
publish::CameraStatus::Health health_of(capture::CaptureState state) {
  using Health = publish::CameraStatus::Health;
  static_assert(int(capture::CaptureState::delivering) == int(Health::delivering) &&
                int(capture::CaptureState::absent) == int(Health::absent));
  return Health(state);
}

double rate(std::uint64_t now, std::uint64_t then, capture::Duration window) {
  return window.count() > 0 ? static_cast<double>(now - then) / capture::seconds(window) : 0;
}

// The two counts of the last second or so; empty: less than one set in twenty, as another program's start costs.
std::string dropped_text(std::uint64_t dropped, std::uint64_t tracked) {
  if (20 * dropped < dropped + tracked || dropped == 0) return {};
  return fmt::format(
      "{:.0f} % of the frame sets are dropped, because tracking is too slow for this machine: lower the cameras' frame "
      "rate or size, track fewer targets, or stop other programs",
      100 * double(dropped) / double(dropped + tracked));
}

// One for all cameras of the host.
void add_clock(const capture::HostClock& clock, const std::string& camera, publish::ServiceStatus& status) {
  const auto known =
      std::ranges::find(status.clocks, clock.host, [](const publish::HostClockStatus& c) { return c.clock.host; });
  if (known != status.clocks.end()) return known->cameras.push_back(camera);
  status.clocks.push_back({.clock = clock, .cameras = {camera}});
  if (!clock.advice.empty()) status.warnings.push_back(clock.advice);
}

// Repeated frames do not count as delivered. past: about a second ago.
void add_repeats(const pipeline::CameraFigures& camera, const pipeline::CameraFigures& past, publish::CameraStatus& out,
                 std::vector<std::string>& warnings) {
  const capture::Duration lasting = camera.repeated_since ? *camera.last_captured - *camera.repeated_since : 0ns;
  const std::uint64_t frames = camera.frames - past.frames, times = camera.times_repeated - past.times_repeated;
  if (out.health == publish::CameraStatus::Health::delivering && lasting > stalled_after) {
    out.health = publish::CameraStatus::Health::stalled;
    out.message = fmt::format(
        "it has repeated one picture for {:.1f} s: the camera, its driver or its cable hangs: restart it, or plug it "
        "in anew",
        capture::seconds(lasting));
  } else if (!camera.has_changed && camera.frames >= frames_of_one_picture) {
    warnings.push_back(
        fmt::format("camera {}: it has repeated one picture since the start: it hangs, or its lens is covered: restart "
                    "it, or clear its view",
                    out.name));
  } else if (5 * times > frames) {  // each picture several times
    warnings.push_back(
        fmt::format("camera {}: it repeats its pictures: {} of its {} frames were not used: set fps to the rate at "
                    "which it really takes pictures",
                    out.name, camera.repeated, camera.frames));
  }
}

std::vector<std::string> camera_names(const publish::ServiceStatus& status) {
  std::vector<std::string> names;
  for (const auto& camera : status.cameras) names.push_back(camera.name);
  return names;
}

}  // namespace

StatusReporter::StatusReporter(const config::ServiceConfig& config, std::string mode, capture::Duration clock_offset)
    : targets_(config.targets), tracked_camera_(config.camera_tracking.camera) {
  fixed_.program_version = HUETRACK_VERSION;
  fixed_.mode = std::move(mode);
  fixed_.config_file = config.file.string();
  fixed_.config_identity = config::config_identity(config);
  fixed_.rig_identity = calib::rig_identity(config.rig);
  rig_history_ = config.rig.made;
  fixed_.clock_offset_s = capture::seconds(clock_offset);
  fixed_.warnings = config::warnings_of(config);
  for (const auto& target : config.targets) fixed_.targets.push_back(target.name);
  for (const auto& camera : config.rig.cameras) {
    publish::CameraStatus status;
    status.name = camera.name;
    fixed_.cameras.push_back(std::move(status));
  }
}

void StatusReporter::take_over(const config::ServiceConfig& config) {
  StatusReporter fresh(config, fixed_.mode, capture::duration_of(fixed_.clock_offset_s));
  fresh.past_ = std::move(past_);
  fresh.latest_ = std::move(latest_);
  *this = std::move(fresh);
}

publish::ServiceStatus StatusReporter::report(const pipeline::PipelineFigures& figures,
                                              std::chrono::steady_clock::time_point now, capture::Timestamp unix_now,
                                              std::span<const std::optional<capture::CameraHealth>> live,
                                              bool do_views_contradict) {
  if (latest_ && now - latest_->at >= shortest_rate_window) past_ = std::move(latest_);
  const capture::Duration window = past_ ? now - past_->at : 0ns;

  publish::ServiceStatus status = fixed_;
  status.at = unix_now;
  status.rig_history = rig_history_.text(std::chrono::floor<std::chrono::seconds>(unix_now));
  status.sets = figures.sets_tracked;
  status.incomplete_sets = figures.frame_sets.incomplete_sets;
  status.late_frames = figures.frame_sets.late_frames;
  status.dropped_sets = figures.sets_dropped;
  if (past_) {
    const std::uint64_t tracked = figures.sets_tracked - past_->figures.sets_tracked;
    status.set_rate_hz = rate(figures.sets_tracked, past_->figures.sets_tracked, window);
    if (std::string text = dropped_text(figures.sets_dropped - past_->figures.sets_dropped, tracked); !text.empty())
      status.warnings.push_back(std::move(text));
  }
  for (std::size_t c = 0; c < status.cameras.size(); ++c) {
    const pipeline::CameraFigures& camera = figures.cameras[c];
    publish::CameraStatus& out = status.cameras[c];
    out.frames = camera.frames;
    out.dropped = camera.dropped;
    out.corrupted = camera.corrupted;
    out.repeated = camera.repeated;
    if (past_) out.rate_hz = rate(camera.frames, past_->figures.cameras[c].frames, window);
    if (camera.last_received) out.age_s = capture::seconds(now - *camera.last_received);
    if (!live.empty()) {
      const auto& said = live[c];
      out.health = said ? health_of(said->state) : publish::CameraStatus::Health::absent;
      if (!said) {
        out.is_used = false;
        out.message = "not used: add it to cameras in the configuration";
      } else if (said->state != capture::CaptureState::delivering) {
        out.message = said->message.empty() ? "no frame yet" : said->message;
      }
      if (said && said->clock) add_clock(*said->clock, out.name, status);
      if (said && !said->warning.empty()) status.warnings.push_back("camera " + out.name + ": " + said->warning);
    } else if (camera.ended) {
      out.health = publish::CameraStatus::Health::ended;
    } else if (!camera.last_received) {
      out.health = publish::CameraStatus::Health::waiting;
      out.message = "no frame yet";
    } else if (now - *camera.last_received > stalled_after) {
      out.health = publish::CameraStatus::Health::stalled;
      out.message = fmt::format("no frame for {:.1f} s", out.age_s);
    } else {
      out.health = publish::CameraStatus::Health::delivering;
    }
    add_repeats(camera, past_ ? past_->figures.cameras[c] : pipeline::CameraFigures(), out, status.warnings);
  }
  constexpr std::size_t long_search = 60;  // sets
  for (std::size_t t = 0; t < std::min(targets_.size(), figures.searches.size()); ++t) {
    if (figures.searches[t].sets < long_search || !config::is_taught(targets_[t])) continue;
    status.warnings.push_back(
        "target " + targets_[t].name + " is not found: " +
        reports::search_advice(figures.searches[t], targets_[t], camera_names(status), do_views_contradict));
  }
  if (figures.camera_frames_dropped > 0)
    status.warnings.push_back("camera tracking is too slow: " + std::to_string(figures.camera_frames_dropped) +
                              " frames gave no pose; a smaller camera_tracking.particle_count may help");
  if (auto warning = pipeline::no_pose_warning(tracked_camera_, figures.tracked_camera); !warning.empty())
    status.warnings.push_back(std::move(warning));
  if (!latest_ || now - latest_->at >= shortest_rate_window) latest_ = Past{now, figures};
  return status;
}

}  // namespace huetrack::daemon
