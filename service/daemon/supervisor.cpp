#include "daemon/supervisor.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <numbers>

#include "capture/timing/capture_clock.h"
#include "daemon/reloader.h"
#include "daemon/service_manager.h"
#include "pipeline/without_numbers.h"

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;

constexpr auto status_period = 1s;
constexpr capture::Duration least_patience = 3s;  // several heartbeats of each thread
constexpr capture::Duration min_clock_step = 500ms;

}  // namespace

Supervisor::Supervisor(Supervised supervised)
    : the_(std::move(supervised)),
      tracked_camera_(the_.session.camera_tracker() != nullptr ? the_.session.config().camera_tracking.camera : ""),
      quorum_(std::size_t(the_.session.config().quorum.value_or(int(the_.cameras.size())))),
      reporter_(the_.session.config(), "run", capture::Duration{0}),
      watchdog_(watchdog_period()) {}

bool Supervisor::is_receiving() const {
  return std::ranges::any_of(the_.session.figures().cameras, [](const auto& camera) { return camera.frames > 0; });
}

void Supervisor::check(bool is_last) {
  if (the_.requests.reload.exchange(false) && !is_last) reload_configuration();
  the_.recording.supervise();
  if (the_.requests.save.exchange(false)) the_.recording.save_pre_roll("signal");
  const bool has_events = log_events();
  const Healths cameras = healths();
  const auto now = Clock::now();
  const pipeline::PipelineFigures figures = the_.session.figures();
  std::vector<object_tracking::TrackState> states;
  std::vector<metrics::TargetFigures> targets = the_.meter.targets();
  for (std::size_t t = 0; t < targets.size(); ++t) {
    targets[t].most = the_.session.config().targets[t].count;
    states.push_back(targets[t].state);
  }
  if (is_last || has_events || states != logged_states_ || now >= next_status_) {
    next_status_ = now + status_period;
    logged_states_ = states;
    publish_status(figures, cameras, targets, now, is_last);
  }
  if (!is_last) notify_manager(figures, cameras, now);
}

void Supervisor::reload_configuration() {
  if (watchdog_) notify_service_manager("WATCHDOG=1");  // new colour tables may take seconds on a slow machine
  if (is_ready_) notify_reloading();
  const std::vector<config::LiveCameraConfig> before = the_.session.config().cameras;
  if (reload(the_.session).empty()) apply_controls(before);
  if (is_ready_) notify_service_manager("READY=1");
  next_status_ = {};
}

// Applies changed controls. Repeats what the page has already set, without effect.
void Supervisor::apply_controls(const std::vector<config::LiveCameraConfig>& before) {
  const auto differ = [](const capture::ControlSetting& a, const capture::ControlSetting& b) {
    return a.name != b.name || a.value != b.value;
  };
  for (const auto& camera : the_.cameras) {
    const std::string& name = the_.session.rig().cameras[std::size_t(camera.camera)].name;
    const auto& all = the_.session.config().cameras;
    const auto now = std::ranges::find(all, name, &config::LiveCameraConfig::name);
    const auto was = std::ranges::find(before, name, &config::LiveCameraConfig::name);
    if (!camera.controls || now == all.end() || was == before.end()) continue;
    if (std::ranges::equal(now->controls, was->controls, std::not_fn(differ))) continue;
    camera.controls->keep(now->controls);
    try {
      for (const auto& result : camera.controls->set(now->controls))
        if (!result.problem.empty()) spdlog::warn("camera {}: {}", name, to_string(result));
    } catch (const capture::CaptureError& error) {  // absent: applied on its return
      spdlog::info("camera {}: its controls are set when it returns: {}", name, error.what());
    }
  }
}

bool Supervisor::log_events() {
  bool has_events = false;
  for (const auto& camera : the_.cameras) {
    const auto& name = the_.session.rig().cameras[std::size_t(camera.camera)].name;
    for (const auto& event : camera.take_events()) {
      spdlog::log(event.is_problem ? spdlog::level::warn : spdlog::level::info, "camera {}: {}", name, event.message);
      has_events = true;
    }
  }
  return has_events;
}

Supervisor::Healths Supervisor::healths() const {
  Healths healths;
  healths.by_rig.resize(the_.session.rig().cameras.size());
  for (const auto& camera : the_.cameras) {
    healths.in_use.push_back(camera.health());
    healths.by_rig[std::size_t(camera.camera)] = healths.in_use.back();
  }
  return healths;
}

void Supervisor::publish_status(const pipeline::PipelineFigures& figures, const Healths& cameras,
                                std::span<const metrics::TargetFigures> targets, Clock::time_point now, bool is_last) {
  status_ = reporter_.report(figures, now, std::chrono::system_clock::now(), cameras.by_rig,
                             the_.reports.mistakes.do_views_contradict());
  add_warnings(status_);
  log_new(status_.warnings, figures.tracked_camera);
  std::ranges::copy(the_.reports.warnings(),
                    std::back_inserter(status_.warnings));  // already logged by the reports
  if (the_.bus != nullptr) {
    the_.bus->publisher().publish_status(status_);
    the_.bus->publisher().publish_times(status_.at, the_.reports.times.timing());
  }
  if (the_.metrics_server != nullptr) show_metrics();
  if (!is_last)
    notify_service_manager("STATUS=" + status_line(status_, targets, the_.meter.latencies().dequeue_to_write,
                                                   tracked_camera_, figures.tracked_camera.state));
}

void Supervisor::add_warnings(publish::ServiceStatus& status) const {
  if (the_.bus != nullptr)
    std::ranges::copy(std::as_const(*the_.bus).publisher().warnings(), std::back_inserter(status.warnings));
  std::ranges::copy(the_.recording.warnings(), std::back_inserter(status.warnings));
  for (const auto* file : the_.files)
    if (const std::string problem = file->problem(); !problem.empty()) status.warnings.push_back(problem);
  if (const capture::Duration step = capture::wall_clock_step(); std::chrono::abs(step) >= min_clock_step)
    status.warnings.push_back(fmt::format(
        "the wall clock was changed by {:.1f} s since the start, and published times are wrong by that: restart "
        "the service",
        capture::seconds(step)));
}

// Each once, ignoring changes of its figures.
void Supervisor::log_new(const std::vector<std::string>& all, const pipeline::TrackedCameraFigures& camera) {
  no_pose_log_.log(tracked_camera_, camera);
  std::set<std::string> warnings(all.begin(), all.end());
  warnings.erase(pipeline::no_pose_warning(tracked_camera_, camera));
  std::set<std::string> logged;
  for (const auto& warning : warnings) {
    if (!logged_warnings_.contains(pipeline::without_numbers(warning))) spdlog::warn("{}", warning);
    logged.insert(pipeline::without_numbers(warning));
  }
  logged_warnings_ = std::move(logged);
}

void Supervisor::show_metrics() const {
  const metrics::RecordingCounts recording{.is_recording = the_.recording.is_recording(),
                                           .dropped = the_.recording.figures().dropped};
  std::vector<metrics::CalibrationFigures> calibration;
  for (const pipeline::CameraCalibration& camera : the_.reports.rig.cameras()) {
    metrics::CalibrationFigures& figures = calibration.emplace_back();
    figures.is_in_place = !reports::is_trouble(camera.room.state);
    figures.blur_px = camera.room.blur_px;
    if (camera.room.state == room_watch::RoomState::changed) figures.changed_share = camera.room.change.share;
    if (camera.moved) {
      figures.turned_deg = camera.moved->rotation.norm() * 180 / std::numbers::pi;
      figures.moved_m = camera.moved->shift.norm();
      figures.effect_m = camera.effect_m;
    }
  }
  the_.metrics_server->show(metrics::to_prometheus(status_, the_.meter.targets(), the_.meter.latencies(), recording,
                                                   the_.bus != nullptr ? the_.bus->publisher().counters().published : 0,
                                                   calibration));
}

void Supervisor::notify_manager(const pipeline::PipelineFigures& figures, const Healths& cameras,
                                Clock::time_point now) {
  const auto delivering =
      std::ranges::count(cameras.in_use, capture::CaptureState::delivering, &capture::CameraHealth::state);
  if (!is_ready_ && std::size_t(delivering) >= quorum_) {
    is_ready_ = true;
    notify_service_manager("READY=1");
    spdlog::info("ready: {} of {} cameras deliver", delivering, the_.cameras.size());
  }
  if (watchdog_ && now >= next_watchdog_) {
    next_watchdog_ = now + *watchdog_ / 4;
    const capture::Duration patience = std::max<capture::Duration>(least_patience, *watchdog_ / 2);
    if (is_progressing(cameras.in_use, figures, now, patience)) notify_service_manager("WATCHDOG=1");
  }
}

bool is_progressing(std::span<const capture::CameraHealth> cameras, const pipeline::PipelineFigures& figures,
                    std::chrono::steady_clock::time_point now, capture::Duration patience) {
  const auto is_recent = [&](std::chrono::steady_clock::time_point at) { return now - at <= patience; };
  return is_recent(figures.tracking_round) &&
         std::ranges::all_of(cameras, [&](const auto& camera) { return is_recent(camera.last_progress); });
}

namespace {

std::string word_of(const publish::CameraStatus& camera) {
  using Health = publish::CameraStatus::Health;
  if (camera.health == Health::delivering) return fmt::format("{:.1f} Hz", camera.rate_hz);
  return camera.health == Health::ended ? "ended" : std::string(name(capture::CaptureState(camera.health)));
}

}  // namespace

std::string status_line(const publish::ServiceStatus& status, std::span<const metrics::TargetFigures> targets,
                        const metrics::LatencyHistogram::Snapshot& latencies, const std::string& tracked_camera,
                        camera_tracking::PoseState camera_state) {
  std::size_t delivering = 0;
  std::vector<std::string> cameras, tracked;
  for (const auto& camera : status.cameras) {
    if (!camera.is_used) continue;
    cameras.push_back(camera.name + " " + word_of(camera));
    if (camera.health == publish::CameraStatus::Health::delivering) ++delivering;
  }
  for (std::size_t t = 0; t < targets.size(); ++t)
    tracked.push_back(
        targets[t].most > 1
            ? fmt::format("{}: {} of at most {} tracking", status.targets[t], targets[t].tracked, targets[t].most)
            : fmt::format("{} {}", status.targets[t], object_tracking::name(targets[t].state)));
  if (!tracked_camera.empty())
    tracked.push_back(fmt::format("{}'s pose {}", tracked_camera, camera_tracking::name(camera_state)));
  const std::string latency =
      latencies.count() == 0
          ? ""
          : fmt::format(", written {:.1f} ms after their last byte (one in a hundred: {:.1f})",
                        1e3 * latencies.quantile_s(0.5), 1e3 * latencies.quantile_s(0.99));  // capacity: percentiles
  return fmt::format("{} of {} cameras deliver: {}; {:.1f} sets/s{}{}{}", delivering, cameras.size(),
                     fmt::join(cameras, ", "), status.set_rate_hz, latency, tracked.empty() ? "" : "; ",
                     fmt::join(tracked, ", "));
}

}  // namespace huetrack::daemon
