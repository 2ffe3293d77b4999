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
constexpr capture::Duration recorder_patience = 400ms;  // a stop may take about a second, and the disk may be slow
constexpr capture::Duration longest_recorder_patience = 10s;

void log_where(const config::MetricsConfig& metrics) {
  const bool is_v6 = metrics.address.find(':') != std::string::npos;
  spdlog::info("metrics on http://{}{}{}:{}/metrics", is_v6 ? "[" : "", metrics.address, is_v6 ? "]" : "",
               *metrics.port);
}

// Supervises the pipeline, which has its own threads, until its end or a stop. Returns the exception that ended it.
std::exception_ptr run_supervised(pipeline::Session& session, Supervisor& supervisor, std::optional<double> seconds,
                                  const std::atomic<bool>& restart, const std::stop_token& stop) {
  std::stop_source ending;
  const std::stop_callback forward(stop, [&] { ending.request_stop(); });
  std::exception_ptr error;
  std::atomic<bool> has_ended = false;
  std::jthread running([&] {
    try {
      session.run(ending.get_token());
    } catch (const std::exception&) {  // rethrown by the waiting thread
      error = std::current_exception();
    }
    has_ended = true;
  });
  // The end of supervision ends the pipeline, which is joined below, or by the destructor of `running`.
  const std::unique_ptr<std::stop_source, void (*)(std::stop_source*)> guard(&ending,
                                                                             [](auto* s) { s->request_stop(); });
  std::optional<Clock::time_point> end;
  while (!has_ended && !ending.stop_requested()) {
    supervisor.poll();
    if (seconds && !end && supervisor.is_receiving()) end = Clock::now() + capture::duration_of(*seconds);
    if (end && Clock::now() >= *end) break;
    if (restart) break;
    std::this_thread::sleep_for(supervision_period);
  }
  if (restart && !stop.stop_requested()) {
    notify_reloading();
  } else {
    notify_service_manager("STOPPING=1\nSTATUS=Stopping");
  }
  ending.request_stop();
  running.join();
  return error;
}

// Saves the corrected rig next to the rig, for huetrack-calibrate accept, and the room, for the next start. A disk
// error is only logged.
void keep_what_was_learnt(const config::ServiceConfig& config, const pipeline::Session& session,
                          const reports::RigReport& rig_report, const std::filesystem::path& recording) {
  const auto attempt = [](auto&& step) {
    try {
      step();
    } catch (const std::exception& error) {
      spdlog::warn("the corrected rig and the room are not saved: {}", error.what());
    }
  };
  calib::CameraRig mended = config.rig;
  if (config.calibration.watch == config::CalibrationMode::mend && rig_report.mend(mended) > 0) {
    const std::filesystem::path file = config.rig_file.parent_path() / (config.rig_file.stem().string() + ".mended" +
                                                                        config.rig_file.extension().string());
    attempt([&] {
      calib::write_rig(mended, file);
      spdlog::info("{}: the rig with the current poses of the cameras; huetrack-calibrate accept {} makes it the rig",
                   file.string(), config.rig_file.string());
    });
    if (!recording.empty()) attempt([&] { calib::write_rig(mended, recording / "rig.mended.yaml"); });
  }
  if (const auto& file = config.calibration.room_file; !file.empty() && session.calibration() != nullptr)
    if (const auto room = session.calibration()->room(); !room.empty())
      attempt([&] { config::write_room(file, room, calib::rig_identity(config.rig)); });
}

// A restart would overwrite output files, or restart a given duration.
bool may_restart(const LiveCommand& options) {
  return options.tracks.empty() && options.poses.empty() && options.write_rig.empty() && options.record_to.empty() &&
         !options.seconds;
}

// Checks before anything is opened or written.
void refuse_what_cannot_be(const config::ServiceConfig& config, std::span<const pipeline::LiveCamera> cameras,
                           const LiveCommand& options) {
  if (cameras.empty())
    throw std::runtime_error(
        config.file.string() +
        ": cameras: there are none: name the live cameras; huetrackd doctor lists them, and huetrackd "
        "setup writes a configuration with them");
  pipeline::refuse_outputs({.files = {options.tracks, options.poses, options.write_rig}}, pipeline::files_of(config));
  // Without a calibration there is nothing to save.
  if (!options.record_to.empty() || !options.write_rig.empty()) config::require_rig(config);
}

// Logs what every participant of the domain may request.
void tell_what_may_be_asked(const config::ControlConfig& control) {
  if (!control.allow_teach && !control.allow_record) return;
  spdlog::info("control: every participant of this DDS domain may {}", control.allow_teach && control.allow_record
                                                                           ? "teach colours, calibrate and record"
                                                                       : control.allow_teach ? "teach colours"
                                                                                             : "record");
}

// The output files. A full disk does not end the service; it is reported at the end.
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

// Actions of the page on live cameras. Its thread sets requests; the supervisor executes them.
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

  // The outputs, in order.
  std::optional<pipeline::Bus> bus;
  if (config.dds.enabled && !options.no_dds && options.track)
    session.add(bus.emplace(config.dds.publisher, session.time()));
  if (bus) tell_what_may_be_asked(config.control);
  metrics::PipelineMeter meter(config.rig.cameras.size(), is_tracking ? config.targets.size() : 0,
                               bus ? &*bus : nullptr);
  session.add(meter);
  reports::Reports reports(session, {.write_rig = options.write_rig, .is_logging_times = true});
  TrackedFiles files(session, config, options);
  // Before the page, which uses it; started after everything that can fail, so that no empty recording remains.
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
  supervisor.poll_last();
  keep_what_was_learnt(config, session, reports.rig, recording.folder());
  session.close_sources();  // before bus and page, which may be slow: restores the cameras' controls
  if (error) std::rethrow_exception(error);
  session.save_camera_map();
  files.refuse_failed();  // after everything is saved
  return {.figures = session.figures(),
          .status = supervisor.last_status(),
          .recorded = recording.figures(),
          .published = bus ? bus->publisher().counters().published : 0};
}

namespace {

// Replays instead of the live cameras, as the page requested; keeps notifying the watchdog.
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
  command.speed = 1;
  command.reload = &requests.reload;
  command.close = [&closing] { closing.request_stop(); };
  command.progress = false;
  try {
    replay(command, closing.get_token());
  } catch (const std::exception& error) {  // return to the cameras
    spdlog::error("the replay ended: {}", error.what());
  }
  if (!stop.stop_requested()) notify_reloading();
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
      spdlog::info("restarting with {}", config.file.string());
    } catch (const std::exception& error) {  // changed since the request
      spdlog::error("restarting with the old configuration: {}", error.what());
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
                             ": no camera has delivered a frame, so the recording is empty: run huetrackd doctor");
}

}  // namespace huetrack::daemon
