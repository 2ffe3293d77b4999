#include "daemon/live.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <exception>
#include <memory>
#include <span>
#include <stdexcept>
#include <thread>

#include "calib/model/rig_yaml.h"
#include "daemon/replay.h"
#include "daemon/service_manager.h"
#include "page/page_service.h"
#include "pipeline/remote_colors.h"

namespace huetrack::daemon {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto supervision_period = 50ms;
constexpr capture::Duration recorder_patience = 400ms;  // whoever stops us waits a second, and the disk may be slow
constexpr capture::Duration longest_recorder_patience = 10s;

void log_where(const config::MetricsConfig& metrics) {
  const bool is_v6 = metrics.address.find(':') != std::string::npos;
  spdlog::info("metrics on http://{}{}{}:{}/metrics", is_v6 ? "[" : "", metrics.address, is_v6 ? "]" : "",
               *metrics.port);
}

// The road has threads of its own; this one looks after it, until it ends or is to end. Gives back what ended it.
std::exception_ptr run_supervised(pipeline::Session& session, Supervisor& supervisor, std::optional<double> seconds,
                                  const std::atomic<bool>& restart, const std::stop_token& stop) {
  std::stop_source ending;
  const std::stop_callback forward(stop, [&] { ending.request_stop(); });
  std::exception_ptr error;
  std::atomic<bool> has_ended = false;
  std::jthread running([&] {
    try {
      session.run(ending.get_token());
    } catch (const std::exception&) {  // thrown again by the thread that waits
      error = std::current_exception();
    }
    has_ended = true;
  });
  // Whatever ends the watch ends the road: it is waited for below, or where an exception destroys `running`.
  const std::unique_ptr<std::stop_source, void (*)(std::stop_source*)> guard(&ending,
                                                                             [](auto* s) { s->request_stop(); });
  std::optional<Clock::time_point> end;
  while (!has_ended && !ending.stop_requested()) {
    supervisor.look_after();
    if (seconds && !end && supervisor.is_receiving()) end = Clock::now() + capture::duration_of(*seconds);
    if (end && Clock::now() >= *end) break;
    if (restart) break;
    std::this_thread::sleep_for(supervision_period);
  }
  if (restart && !stop.stop_requested()) {
    tell_reloading();
  } else {
    notify_service_manager("STOPPING=1\nSTATUS=Stopping");
  }
  ending.request_stop();
  running.join();
  return error;
}

// Beside the rig, which stays as it is: where the cameras stand now, for huetrack-calibrate accept; and the room, for
// the next start. A disk that is full or read-only is told; it ends nothing.
void keep_what_was_learnt(const config::ServiceConfig& config, const pipeline::Session& session,
                          const reports::RigReport& rig_report, const std::filesystem::path& recording) {
  const auto attempt = [](auto&& step) {
    try {
      step();
    } catch (const std::exception& error) {
      spdlog::warn("what was learnt of the calibration is not kept: {}", error.what());
    }
  };
  calib::CameraRig mended = config.rig;
  if (config.calibration.watch == config::CalibrationMode::mend && rig_report.mend(mended) > 0) {
    const std::filesystem::path file = config.rig_file.parent_path() / (config.rig_file.stem().string() + ".mended" +
                                                                        config.rig_file.extension().string());
    attempt([&] {
      calib::write_rig(mended, file);
      spdlog::info("{}: the rig with the cameras where they stand now; huetrack-calibrate accept {} takes it over",
                   file.string(), config.rig_file.string());
    });
    if (!recording.empty()) attempt([&] { calib::write_rig(mended, recording / "rig.mended.yaml"); });
  }
  if (const auto& file = config.calibration.room_file; !file.empty() && session.calibration() != nullptr)
    if (const auto room = session.calibration()->room(); !room.empty())
      attempt([&] { config::write_room(file, room, calib::rig_identity(config.rig)); });
}

// Files would be begun anew, and what they hold be lost; a time that is given would begin again.
bool may_restart(const LiveCommand& options) {
  return options.tracks.empty() && options.poses.empty() && options.write_rig.empty() && options.record_to.empty() &&
         !options.seconds;
}

// Before anything is opened or written.
void refuse_what_cannot_be(const config::ServiceConfig& config, std::span<const pipeline::LiveCamera> cameras,
                           const LiveCommand& options) {
  if (cameras.empty())
    throw std::runtime_error(config.file.string() +
                             ": cameras: none is given: name the live cameras; "
                             "ls -l /dev/v4l/by-path/ lists those that there are");
  pipeline::refuse_outputs({.files = {options.tracks, options.poses, options.write_rig}}, pipeline::files_of(config));
  // Whose lenses are nobody's, nothing of them is to be kept.
  if (!options.record_to.empty() || !options.write_rig.empty()) config::require_rig(config);
}

// The bus is open to everybody on its network, unless the configuration closes it: what that means is said.
void tell_what_may_be_asked(const config::ControlConfig& control) {
  if (!control.allow_teach && !control.allow_record) return;
  spdlog::info("control: whoever is on that bus may {}", control.allow_teach && control.allow_record
                                                             ? "teach colours, calibrate and record"
                                                         : control.allow_teach ? "teach colours"
                                                                               : "record");
}

// The files that were asked for. A disk that is full does not end the service: what there is to say comes at its end.
struct TrackedFiles {
  TrackedFiles(pipeline::Session& session, const config::ServiceConfig& config, const LiveCommand& options) {
    constexpr auto when = pipeline::WhenFileFails::go_on;
    if (!options.tracks.empty()) add(session, tracks.emplace(options.tracks, config, when));
    if (!options.poses.empty()) add(session, poses.emplace(options.poses, config, when));
  }
  void refuse_failed() const {
    for (const auto* file : all)
      if (const std::string problem = file->problem(); !problem.empty()) throw std::runtime_error(problem);
  }

  std::optional<pipeline::TrackFile> tracks;
  std::optional<pipeline::PoseFile> poses;
  std::vector<const pipeline::FileOutput*> all;

 private:
  void add(pipeline::Session& session, pipeline::FileOutput& file) {
    session.add(file);
    all.push_back(&file);
  }
};

// What the page may ask of live cameras. Its thread sets requests; who supervises takes them.
page::PageServiceOptions page_options(const config::ServiceConfig& config,
                                      std::span<const pipeline::LiveCamera> cameras, const LiveCommand& options,
                                      LiveRequests& requests, pipeline::RecordingKeeper& recording,
                                      page::CalibrationSession* calibration) {
  const auto ask_for = [](std::atomic<bool>& what) {
    return [&what] {
      what = true;
      return std::string();
    };
  };
  page::PageServiceOptions page;
  page.actions.reload = ask_for(requests.reload);
  page.control.recording = &recording;
  page.control.reload = ask_for(requests.reload);
  for (const auto& camera : cameras)
    if (camera.controls) page.control.cameras[config.rig.cameras[std::size_t(camera.camera)].name] = camera.controls;
  if (may_restart(options)) {
    page.control.calibration = calibration;
    page.control.restart = ask_for(requests.restart);
    page.control.open_recording = [&requests](const std::filesystem::path& folder) {
      requests.open_recording(folder);
      requests.restart = true;
    };
  }
  return page;
}

std::unique_ptr<metrics::MetricsServer> served(const config::MetricsConfig& metrics) {
  if (!metrics.port) return nullptr;
  auto server = std::make_unique<metrics::MetricsServer>(metrics.address, *metrics.port);
  log_where(metrics);
  return server;
}

}  // namespace

LiveSummary run_live(const config::ServiceConfig& config, std::vector<pipeline::LiveCamera> cameras,
                     const LiveCommand& options, LiveRequests& requests, const std::stop_token& stop,
                     page::CalibrationSession* calibration) {
  refuse_what_cannot_be(config, cameras, options);
  const bool is_tracking = options.track && config.is_calibrated();
  pipeline::Session session(config, pipeline::sources_of(config, cameras),
                            {.when_full = pipeline::WhenFull::drop_oldest, .is_tracking = is_tracking});

  // Where the results go, in this order.
  std::optional<pipeline::Bus> bus;
  if (config.dds.enabled && !options.no_dds && options.track)
    session.add(bus.emplace(config.dds.publisher, session.time()));
  if (bus) tell_what_may_be_asked(config.control);
  metrics::PipelineMeter meter(config.rig.cameras.size(), is_tracking ? config.targets.size() : 0,
                               bus ? &*bus : nullptr);
  session.add(meter);
  reports::Reports reports(session, {.write_rig = options.write_rig, .is_logging_times = true});
  TrackedFiles files(session, config, options);
  // Before the page, which asks it; it records after all that may yet end the program: no empty recording stays behind.
  pipeline::RecordingKeeper recording(
      session.config(), {.record_to = options.record_to, .cameras_in_use = cameras.size(), .is_tracking = is_tracking});
  std::optional<pipeline::RemoteColors> colors;
  if (is_tracking) session.add(colors.emplace(session.config(), cameras));
  std::optional<page::PageService> page_service;
  if (bus)
    session.add(page_service.emplace(session.config(),
                                     page_options(config, cameras, options, requests, recording, calibration)));
  const auto metrics_server = served(config.metrics);
  recording.begin();
  session.add(recording);
  Supervisor supervisor({.session = session,
                         .cameras = cameras,
                         .requests = requests,
                         .meter = meter,
                         .reports = reports,
                         .recording = recording,
                         .files = files.all,
                         .bus = bus ? &*bus : nullptr,
                         .metrics_server = metrics_server.get()});
  session.add(supervisor);

  const std::exception_ptr error = run_supervised(session, supervisor, options.seconds, requests.restart, stop);
  recording.finish(stop.stop_requested() ? recorder_patience : longest_recorder_patience);
  supervisor.look_a_last_time();
  keep_what_was_learnt(config, session, reports.rig, recording.folder());
  session.close_sources();  // before bus and page, which may take their time: the cameras get their controls back
  if (error) std::rethrow_exception(error);
  session.save_camera_map();
  files.refuse_failed();  // after all that is to be kept
  return {.figures = session.figures(),
          .status = supervisor.last_status(),
          .recorded = recording.figures(),
          .published = bus ? bus->publisher().counters().published : 0};
}

namespace {

// Instead of the cameras, as the page asked for it; whoever watches over the service is told that it lives.
void replay_instead(const config::ServiceConfig& config, const std::filesystem::path& recording, LiveRequests& requests,
                    const std::stop_token& stop) {
  std::stop_source closing;
  const std::stop_callback forward(stop, [&] { closing.request_stop(); });
  const auto watchdog = watchdog_period();
  const std::jthread alive([&](const std::stop_token& ended) {
    while (watchdog && !ended.stop_requested()) {
      notify_service_manager("WATCHDOG=1");
      for (auto left = *watchdog / 4; left > 0us && !ended.stop_requested(); left -= supervision_period)
        std::this_thread::sleep_for(supervision_period);
    }
  });
  notify_service_manager("READY=1\nSTATUS=Replaying " + recording.filename().string());
  spdlog::info("replaying {} instead of the cameras", recording.string());
  ReplayCommand command;
  command.config = config.file;
  command.recording = {recording.string()};
  command.speed = ReplaySpeed::real;
  command.reload = &requests.reload;
  command.close = [&closing] { closing.request_stop(); };
  command.progress = false;
  try {
    replay(command, closing.get_token());
  } catch (const std::exception& error) {  // then with the cameras again
    spdlog::error("the replay ended: {}", error.what());
  }
  if (!stop.stop_requested()) tell_reloading();
}

}  // namespace

LiveSummary run_live_while_asked(config::ServiceConfig config, const CameraOpener& open, const LiveCommand& options,
                                 LiveRequests& requests, const std::stop_token& stop) {
  page::CalibrationSession calibration({.program = {}, .log = [](bool is_problem, const std::string& what) {
                                          spdlog::log(is_problem ? spdlog::level::warn : spdlog::level::info, "{}",
                                                      what);
                                        }});
  for (;;) {
    set_log_level(config.log_level);
    requests.restart = false;
    LiveSummary summary = run_live(config, open(config, stop), options, requests, stop, &calibration);
    if (!requests.restart || stop.stop_requested()) return summary;
    if (const auto recording = requests.take_recording(); !recording.empty())
      replay_instead(config, recording, requests, stop);
    if (stop.stop_requested()) return summary;
    try {
      config = config::load_service_config(config.file);
      spdlog::info("beginning anew with {}", config.file.string());
    } catch (const std::exception& error) {  // somebody has changed it since it was asked for
      spdlog::error("beginning anew with the old configuration: {}", error.what());
    }
  }
}

void run(const std::filesystem::path& file, const LiveCommand& options, LiveRequests& requests,
         const std::stop_token& stop) {
  const LiveSummary summary = run_live_while_asked(
      config::load_service_config(file),
      [](const auto& config, const auto& until) { return pipeline::open_cameras(config, until); }, options, requests,
      stop);
  spdlog::info("stopped after {} frame sets, {} samples published", summary.figures.sets_tracked, summary.published);
}

void record(const std::filesystem::path& file, LiveCommand options, LiveRequests& requests,
            const std::stop_token& stop) {
  const config::ServiceConfig config = config::with_frames(config::load_service_config(file));
  config::require_rig(config);
  options.track = false;
  set_log_level(config.log_level);
  const LiveSummary summary = run_live(config, pipeline::open_cameras(config, stop), options, requests, stop);
  std::printf("%s\n", options.record_to.c_str());
  for (const auto& camera : config.cameras) {
    const auto c = std::size_t(config.rig.index_of(camera.name).value());
    const recordings::RecordedCameraFigures& recorded = summary.recorded.cameras[c];
    std::printf("  %-10s %llu frames, %.1f MB; %llu lost by the camera, %llu by the disk, %llu left out\n",
                camera.name.c_str(), static_cast<unsigned long long>(recorded.frames), double(recorded.bytes) / 1e6,
                static_cast<unsigned long long>(summary.figures.cameras[c].dropped),
                static_cast<unsigned long long>(summary.recorded.dropped[c]),
                static_cast<unsigned long long>(recorded.left_out));
  }
  if (summary.recorded.failure) throw std::runtime_error(*summary.recorded.failure);
  if (std::ranges::all_of(summary.recorded.cameras, [](const auto& camera) { return camera.frames == 0; }))
    throw std::runtime_error(options.record_to.string() +
                             ": no camera has delivered a frame: the recording is empty; huetrackd doctor says why");
}

}  // namespace huetrack::daemon
