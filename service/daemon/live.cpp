#include "daemon/live.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <future>
#include <map>
#include <mutex>
#include <set>
#include <thread>

#include "calib/model/rig_yaml.h"
#include "camera_tracking/methods/make_camera_tracker.h"
#include "capture/capture_clock.h"
#include "config/formatted.h"
#include "daemon/metrics.h"
#include "daemon/service_manager.h"
#include "daemon/status_reporter.h"
#include "daemon/view_server.h"
#include "pipeline/recorded_changes.h"
#include "publish/estimate_publisher.h"
#include "tracks/pose_file.h"
#include "tracks/track_csv.h"

namespace huetrack::daemon {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto supervision_period = 50ms;
constexpr auto status_period = 1s;
constexpr auto opening_patience = 3s;             // with a camera that does not answer; it is waited for later
constexpr capture::Duration least_patience = 3s;  // several heartbeats of a camera, and of the tracking thread
constexpr capture::Duration told_clock_step = 500ms;
constexpr capture::Duration recorder_patience = 400ms;  // whoever stops us waits a second, and the disk may be slow
constexpr capture::Duration longest_recorder_patience = 10s;

std::string tenths(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f", value);
  return text.data();
}

// What the camera's frames will be like for a colour table, as far as it has agreed to anything yet.
struct ExpectedPixels {
  capture::PixelFormat format;
  capture::ColorRange range;
};
std::optional<ExpectedPixels> expected_pixels(const LiveCamera& camera) {
  const auto stream = camera.health().stream;
  if (!stream) return std::nullopt;
  switch (stream->format) {
    case capture::CaptureFormat::yuyv:
      return ExpectedPixels{capture::PixelFormat::yuyv, stream->range};
    case capture::CaptureFormat::nv12:
      return ExpectedPixels{capture::PixelFormat::nv12, stream->range};
    case capture::CaptureFormat::mjpeg:
      return ExpectedPixels{capture::PixelFormat::i422,
                            capture::ColorRange::full};  // or i420, which has the same table
    case capture::CaptureFormat::grey:
      break;
  }
  return ExpectedPixels{capture::PixelFormat::grey, stream->range};
}

// From what the cameras agreed to, else what they were asked for; known once and for all, as a track depends on it.
capture::Duration automatic_tolerance(const config::ServiceConfig& config, std::span<const LiveCamera> cameras) {
  std::vector<capture::Duration> periods;
  for (const auto& camera : cameras) {
    const auto stream = camera.health().stream;
    const auto& name = config.rig.cameras[std::size_t(camera.camera)].name;
    const auto asked = std::ranges::find(config.cameras, name, &config::LiveCameraConfig::name);
    const double fps = stream && stream->fps > 0       ? stream->fps
                       : asked == config.cameras.end() ? 0
                                                       : asked->fps.value_or(0);
    if (fps > 0) periods.push_back(capture::duration_of(1 / fps));
  }
  return capture::suggested_tolerance(periods);
}

class LiveService {
 public:
  LiveService(const config::ServiceConfig& config, std::vector<LiveCamera> cameras, const LiveOptions& options,
              LiveRequests& requests)
      : config_(config), options_(options), requests_(requests), targets_(options.track ? config.targets.size() : 0) {
    config_.set_tolerance_s =
        config.set_tolerance_s.value_or(capture::seconds(automatic_tolerance(config, std::span(cameras))));
    quorum_ = std::size_t(config.quorum.value_or(int(cameras.size())));
    if (!options.tracks.empty()) csv_.emplace(options.tracks);
    if (config.dds.enabled && !options.no_dds && options.track) {
      publisher_.emplace(config.dds.publisher);
      spdlog::info("publishing on {}", publisher_->description());
    }
    if (publisher_)
      view_.emplace(config_, ViewServerOptions{.actions = {.reload =
                                                               [this] {
                                                                 requests_.reload = true;
                                                                 return std::string();
                                                               },
                                                           .resume = nullptr}});
    reporter_.emplace(config_, "run", capture::Duration{0});
    pipeline::PipelineOptions pipeline;
    pipeline.frame_sets.camera_count = int(config.rig.cameras.size());
    pipeline.frame_sets.cameras_in_use = int(cameras.size());
    pipeline.frame_sets.tolerance = capture::duration_of(*config_.set_tolerance_s);
    pipeline.when_full = pipeline::WhenFull::drop_oldest;
    pipeline.threads = config.threads;
    pipeline.view_particles = std::size_t(std::max(1, config.preview.particles));
    std::vector<object_tracking::ObjectTracker> trackers;
    for (std::size_t t = 0; t < targets_.size(); ++t) trackers.push_back(tracker_for(config, t, cameras));
    std::vector<std::unique_ptr<capture::FrameSource>> sources;
    for (auto& camera : cameras) sources.push_back(std::move(camera.source));
    cameras_ = std::move(cameras);
    if (config.metrics.port) {
      metrics_.emplace(config.metrics.address, *config.metrics.port);
      const bool is_v6 = config.metrics.address.find(':') != std::string::npos;
      spdlog::info("metrics on http://{}{}{}:{}/metrics", is_v6 ? "[" : "", config.metrics.address, is_v6 ? "]" : "",
                   *config.metrics.port);
    }
    make_recorder();  // after all that may yet end the program: no empty recording stays behind
    pipeline::PipelineOutputs outputs;
    outputs.frames = [this](const capture::Frame& frame, capture::Timestamp received_at) {
      capture_to_dequeue_[std::size_t(frame.camera)].add(received_at - frame.captured_at);
      if (recorder_) recorder_->offer(frame);
    };
    outputs.left_out = [this](const capture::FrameSet& set) { happens(set.at); };
    outputs.camera_left_out = [this](const capture::Frame& frame) {
      const std::scoped_lock lock(happened_mutex_);
      if (changes_) camera_left_out_.push_back(frame.captured_at);
    };
    outputs.estimates = [this](const capture::FrameSet& set, std::span<const object_tracking::ObjectEstimate> estimates,
                               capture::Timestamp received_at) { put_out(set, estimates, received_at); };
    const auto& tracked = config.camera_tracking.camera;
    const bool tracks_camera = options.track && !tracked.empty();
    if (!options.poses.empty() && !tracks_camera)
      throw std::runtime_error("--poses needs a camera to track: give camera_tracking in " + config.file.string());
    if (!options.poses.empty()) poses_.emplace(options.poses);
    if (tracks_camera)
      outputs.camera_poses = [this](const camera_tracking::CameraEstimate& estimate, capture::Timestamp received_at) {
        if (publisher_) publisher_->publish(estimate, estimate.at, received_at);
        if (poses_) poses_->write(estimate);
      };
    if (view_) {
      outputs.view_wanted = [this] { return view_->wants(); };
      outputs.view = [this](pictures::PictureJob job) { view_->offer(std::move(job)); };
      outputs.camera_map_wanted = [this] { return view_->wants_map(); };
      outputs.camera_map = [this](camera_tracking::CameraMap map) { view_->offer(std::move(map)); };
    }
    pipeline_.emplace(config_.rig, std::move(sources), std::move(trackers), pipeline, std::move(outputs));
    if (tracks_camera) {
      const int index = config_.rig.index_of(tracked).value();
      pipeline_->track_camera(index,
                              camera_methods::make_camera_tracker(config_.rig.cameras[std::size_t(index)],
                                                                  config::tracker_options(config_.camera_tracking)));
    }
  }

  LiveSummary run(const std::stop_token& stop) {
    std::stop_source ending;
    const std::stop_callback forward(stop, [&] { ending.request_stop(); });
    std::exception_ptr error;
    std::atomic<bool> has_ended = false;
    std::jthread running([&] {
      try {
        pipeline_->run(ending.get_token());
      } catch (const std::exception&) {  // thrown again below, in the thread that waits
        error = std::current_exception();
      }
      has_ended = true;
    });
    std::optional<Clock::time_point> end;
    while (!has_ended && !ending.stop_requested()) {
      supervise(false);
      if (options_.seconds && !end && is_receiving()) end = Clock::now() + capture::duration_of(*options_.seconds);
      if (end && Clock::now() >= *end) break;
      std::this_thread::sleep_for(supervision_period);
    }
    notify_service_manager("STOPPING=1\nSTATUS=Stopping");
    ending.request_stop();
    running.join();
    if (recorder_) recorder_->finish(stop.stop_requested() ? recorder_patience : longest_recorder_patience);
    supervise(true);
    if (csv_) csv_->flush();
    if (poses_) poses_->flush();
    if (error) std::rethrow_exception(error);
    if (const auto* tracker = pipeline_->camera_tracker();
        tracker != nullptr && !config_.camera_tracking.save_map.empty())
      pipeline::save_map(*tracker, pipeline_->tracked_camera(), config_.camera_tracking.save_map);
    if (!tracks_problem_.empty()) throw std::runtime_error(tracks_problem_);  // after all that is to be kept
    return {.figures = pipeline_->figures(),
            .status = last_status_,
            .recorded = recorder_ ? recorder_->figures() : pipeline::RecorderFigures{},
            .published = publisher_ ? publisher_->counters().published : 0};
  }

 private:
  struct Target {
    std::atomic<object_tracking::TrackState> state = object_tracking::TrackState::searching;
    std::atomic<double> effective_sample_size = 0;
    std::atomic<int> particles = 0;
  };

  // The tracking thread.
  void put_out(const capture::FrameSet& set, std::span<const object_tracking::ObjectEstimate> estimates,
               capture::Timestamp received_at) {
    const capture::Timestamp now = capture::unix_now();
    publish::EstimatePublisher::Writing writing{now, now};
    for (std::size_t t = 0; t < estimates.size(); ++t) {
      if (publisher_) publisher_->publish(t, estimates[t], estimates[t].at, received_at, &writing);
      if (csv_) write_track(t, estimates[t]);
      targets_[t].effective_sample_size = estimates[t].effective_sample_size;
      targets_[t].particles = estimates[t].particle_count;
      const object_tracking::TrackState before = targets_[t].state.exchange(estimates[t].state);
      if (estimates[t].state == object_tracking::TrackState::lost && before != object_tracking::TrackState::lost)
        has_lost_ = true;
    }
    if (estimates.empty()) return;
    dequeue_to_write_.add(writing.begun - received_at);
    dequeue_to_publish_.add(writing.sent - received_at);
    capture_to_publish_.add(writing.sent - set.at);
  }

  // A full disk ends the file, not the tracking.
  void write_track(std::size_t target, const object_tracking::ObjectEstimate& estimate) {
    try {
      csv_->write(config_names_[target], estimate);
    } catch (const std::system_error& error) {
      const std::scoped_lock lock(happened_mutex_);
      tracks_problem_ = std::string(error.what()) + ": the tracks are written no further";
      csv_.reset();
    }
  }

  // A tracker that has its colour tables: the tracking thread would need some 50 ms for each.
  static object_tracking::ObjectTracker tracker_for(const config::ServiceConfig& config, std::size_t target,
                                                    std::span<const LiveCamera> cameras) {
    object_tracking::ObjectTracker tracker(config.rig, config.targets[target], config.object_tracking);
    for (const auto& camera : cameras)
      if (const auto pixels = expected_pixels(camera)) tracker.expect(camera.camera, pixels->format, pixels->range);
    return tracker;
  }

  // ---- All below: the supervising thread.

  bool is_receiving() const {
    return std::ranges::any_of(pipeline_->figures().cameras, [](const auto& camera) { return camera.frames > 0; });
  }

  void supervise(bool is_last) {
    if (requests_.reload.exchange(false) && !is_last) reload();
    if (recorder_) {
      recorder_->end_when_due();
      if (has_lost_.exchange(false) && config_.record.on_lost) save_pre_roll("lost");
    }
    if (requests_.save.exchange(false)) save_pre_roll("signal");
    write_changes();
    bool is_news = is_last;
    std::vector<capture::CameraHealth> healths;
    std::vector<std::optional<capture::CameraHealth>> by_rig(config_.rig.cameras.size());
    for (const auto& camera : cameras_) {
      const auto& name = config_.rig.cameras[std::size_t(camera.camera)].name;
      for (const auto& event : camera.take_events()) {
        spdlog::log(event.is_problem ? spdlog::level::warn : spdlog::level::info, "camera {}: {}", name, event.message);
        is_news = true;
      }
      healths.push_back(camera.health());
      by_rig[std::size_t(camera.camera)] = healths.back();
    }
    const auto now = Clock::now();
    const pipeline::PipelineFigures figures = pipeline_->figures();
    std::vector<object_tracking::TrackState> states;
    for (const auto& target : targets_) states.push_back(target.state);
    is_news |= states != told_states_;
    if (is_news || now >= next_status_) {
      next_status_ = now + status_period;
      told_states_ = states;
      tell_status(figures, by_rig, states, now, is_last);
    }
    if (is_last) return;
    const auto delivering =
        std::ranges::count(healths, capture::CaptureState::delivering, &capture::CameraHealth::state);
    if (!is_ready_ && std::size_t(delivering) >= quorum_) {
      is_ready_ = true;
      notify_service_manager("READY=1");
      spdlog::info("ready: {} of {} cameras deliver", delivering, cameras_.size());
    }
    if (watchdog_ && now >= next_watchdog_) {
      next_watchdog_ = now + *watchdog_ / 4;
      const capture::Duration patience = std::max<capture::Duration>(least_patience, *watchdog_ / 2);
      if (is_progressing(healths, figures, now, patience)) notify_service_manager("WATCHDOG=1");
    }
  }

  void tell_status(const pipeline::PipelineFigures& figures,
                   std::span<const std::optional<capture::CameraHealth>> cameras,
                   std::span<const object_tracking::TrackState> states, Clock::time_point now, bool is_last) {
    publish::ServiceStatus status = reporter_->report(figures, now, std::chrono::system_clock::now(), cameras);
    if (publisher_) std::ranges::copy(publisher_->warnings(), std::back_inserter(status.warnings));
    std::ranges::copy(recording_warnings(), std::back_inserter(status.warnings));
    {
      const std::scoped_lock lock(happened_mutex_);
      if (!tracks_problem_.empty()) status.warnings.push_back(tracks_problem_);
    }
    if (const capture::Duration step = capture::wall_clock_step(); std::chrono::abs(step) >= told_clock_step) {
      status.warnings.push_back("the wall clock was set by " + tenths(capture::seconds(step)) +
                                " s since the start, and published times are off by that: restart the service");
    }
    std::set<std::string> warnings(status.warnings.begin(), status.warnings.end());
    no_pose_log_.tell(config_.camera_tracking.camera, figures.tracked_camera);
    warnings.erase(pipeline::no_pose_warning(config_.camera_tracking.camera, figures.tracked_camera));
    for (const auto& warning : warnings)  // once, not again for every further frame that it counts
      if (!told_warnings_.contains(config::without_numbers(warning))) spdlog::warn("{}", warning);
    std::set<std::string> told;
    for (const auto& warning : warnings) told.insert(config::without_numbers(warning));
    told_warnings_ = std::move(told);
    if (publisher_) publisher_->publish_status(status);
    if (metrics_) show_metrics(status);
    if (!is_last)
      notify_service_manager("STATUS=" + status_line(status, states,
                                                     pipeline_->camera_tracker() != nullptr
                                                         ? config_.camera_tracking.camera
                                                         : std::string(),
                                                     figures.tracked_camera.state));
    last_status_ = std::move(status);
  }

  void show_metrics(const publish::ServiceStatus& status) {
    std::vector<TargetFigures> targets;
    for (const auto& target : targets_)
      targets.push_back({target.state, target.effective_sample_size, target.particles});
    LatencyFigures latencies;
    for (const auto& camera : capture_to_dequeue_) latencies.capture_to_dequeue.push_back(camera.snapshot());
    latencies.dequeue_to_write = dequeue_to_write_.snapshot();
    latencies.dequeue_to_publish = dequeue_to_publish_.snapshot();
    latencies.capture_to_publish = capture_to_publish_.snapshot();
    RecordingCounts recording;
    if (recorder_) {
      const pipeline::RecorderFigures figures = recorder_->figures();
      recording = {.is_recording = recorder_->is_recording() && !figures.failure, .dropped = figures.dropped};
    }
    metrics_->show(
        to_prometheus(status, targets, latencies, recording, publisher_ ? publisher_->counters().published : 0));
  }

  // ---- Recording

  void make_recorder() {
    const config::RecordConfig& record = config_.record;
    const bool has_pre_roll = record.pre_roll_s > 0 && !record.always && options_.record_to.empty();
    if (!record.always && !has_pre_roll && options_.record_to.empty()) return;
    pipeline::RecorderOptions options;
    for (const auto& camera : config_.rig.cameras) options.recording.cameras.push_back(camera.name);
    options.recording.rig_yaml = calib::to_yaml(config_.rig);
    options.recording.config_yaml = config::to_portable_yaml(config_);
    options.recording.files = config::files_beside(config_);
    options.recording.raw_storage = record.raw_storage;
    options.queue_frames = std::size_t(record.queue_frames);
    if (has_pre_roll) {
      // The recorder shares it out over all cameras of the rig, of which some may not be used.
      const double share = double(config_.rig.cameras.size()) / double(cameras_.size());
      options.pre_roll = capture::PreRollOptions{.length = capture::duration_of(record.pre_roll_s),
                                                 .most_bytes = std::size_t(share * double(record.pre_roll_mb) * 1e6)};
    }
    recorder_.emplace(std::move(options));
    if (has_pre_roll) return;
    if (!options_.record_to.empty()) return start_recording(options_.record_to);
    try {
      start_recording(new_folder(""));
    } catch (const std::exception& error) {  // of the disk, whatever it is: that ends no tracking, nor keeps it from it
      recording_problem_ = std::string("nothing is recorded: ") + error.what();
    }
  }

  void start_recording(const std::filesystem::path& folder) {
    recorder_->start(folder);
    recording_to_ = folder;
    if (options_.track) changes_.emplace(folder);
    spdlog::info("recording to {}", folder.string());
  }

  // What a replay must repeat, into the recording; away from the tracking road.
  void write_changes() {
    if (!changes_) return;
    std::vector<std::pair<capture::Timestamp, std::string>> happened;
    std::vector<capture::Timestamp> camera_left_out;
    {
      const std::scoped_lock lock(happened_mutex_);
      happened.swap(happened_);
      camera_left_out.swap(camera_left_out_);
    }
    for (const capture::Timestamp at : camera_left_out) changes_->camera_left_out(at);
    for (const auto& [at, config] : happened) config.empty() ? changes_->left_out(at) : changes_->reloaded(at, config);
  }
  void happens(capture::Timestamp at, std::string config = {}) {
    const std::scoped_lock lock(happened_mutex_);
    if (changes_) happened_.emplace_back(at, std::move(config));
  }

  std::filesystem::path new_folder(const std::string& why) const {
    const auto now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    std::tm utc{};
    ::gmtime_r(&now, &utc);
    std::array<char, 32> time{};
    std::strftime(time.data(), time.size(), "%Y%m%dT%H%M%SZ", &utc);
    const std::string name = time.data() + why;
    auto folder = config_.record.folder / name;
    for (int i = 2; std::filesystem::exists(folder); ++i)
      folder = config_.record.folder / (name + "-" + std::to_string(i));
    return folder;
  }

  void save_pre_roll(const std::string& why) {
    if (!recorder_) {
      spdlog::warn("there is no pre-roll to save: give record.folder and record.pre_roll_s");
      return;
    }
    try {
      const auto folder = new_folder("-" + why);
      if (recorder_->save_pre_roll(folder, capture::duration_of(config_.record.after_s))) {
        recording_to_ = folder;
        recording_problem_.clear();
        spdlog::info("saving the pre-roll to {}", folder.string());
      } else if (why == "signal") {
        spdlog::info("it is all in the recording that is being made: {}", recording_to_.string());
      }
    } catch (const std::exception& error) {  // a full or read-only disk ends no tracking; told with the status, once
      recording_problem_ = std::string("the pre-roll was not saved: ") + error.what();
    }
  }

  std::vector<std::string> recording_warnings() const {
    std::vector<std::string> warnings;
    if (!recorder_) return warnings;
    if (!recording_problem_.empty()) warnings.push_back(recording_problem_);
    std::error_code ignored;
    if (recorder_->is_recording() && !std::filesystem::exists(recording_to_, ignored))
      warnings.push_back(recording_to_.string() +
                         " is gone: nothing of the recording is kept; restart to record again");
    const pipeline::RecorderFigures figures = recorder_->figures();
    if (figures.failure) warnings.push_back(*figures.failure);
    if (figures.pre_roll_that_fits)
      warnings.push_back("only the last " + tenths(capture::seconds(*figures.pre_roll_that_fits)) +
                         " s of the pre-roll's " + tenths(config_.record.pre_roll_s) +
                         " s fit into record.pre_roll_mb");
    if (changes_ && !changes_->failure().empty()) warnings.push_back(changes_->failure());
    std::string cameras;
    for (std::size_t c = 0; c < figures.dropped.size(); ++c)
      if (figures.dropped[c] > 0)
        cameras +=
            (cameras.empty() ? "" : ", ") + config_.rig.cameras[c].name + " " + std::to_string(figures.dropped[c]);
    if (!cameras.empty())
      warnings.push_back("the disk is too slow for the recording, frames are missing in it: " + cameras);
    return warnings;
  }

  // What may change while running are the trackers: their targets' colours and radii, and how they track.
  void reload() {
    if (watchdog_) notify_service_manager("WATCHDOG=1");  // the new colour tables may take a slow machine seconds
    const auto since_boot = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch());
    if (is_ready_) notify_service_manager("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(since_boot.count()));
    try {
      take_over(config::load_service_config(config_.file));
    } catch (const std::exception& error) {  // the file is not fit to run on, for whatever reason
      spdlog::error("reload refused, running on with the old configuration: {}", error.what());
    }
    if (is_ready_) notify_service_manager("READY=1");
    next_status_ = {};
  }

  void take_over(config::ServiceConfig fresh) {
    if (!std::ranges::equal(fresh.targets, config_.targets, {}, &object_tracking::TargetOptions::name,
                            &object_tracking::TargetOptions::name))
      throw std::runtime_error("targets were added, removed, renamed or reordered: that needs a restart");
    if (!tolerance_is_given_) fresh.set_tolerance_s = fresh.set_tolerance_s.value_or(*config_.set_tolerance_s);
    std::string kept;
    for (const auto& key : config::differing_keys(config_, fresh)) {
      if (key == "targets" || key == "object_tracking" || key == "log_level" || key == "ignore" || key == "control")
        continue;
      kept += (kept.empty() ? "" : ", ") + key;
    }
    if (!kept.empty()) spdlog::warn("reload: {} changed, too: that takes effect at the next start", kept);

    config::ServiceConfig merged = config_;
    merged.targets = fresh.targets;
    merged.object_tracking = fresh.object_tracking;
    merged.log_level = fresh.log_level;
    merged.ignored = fresh.ignored;
    merged.control = fresh.control;
    pipeline::Pipeline::Replacement replacement;
    std::string names;
    for (const auto t : config::targets_that_differ(config_, merged)) {
      replacement.trackers.emplace_back(t, tracker_for(merged, t, cameras_));
      names += (names.empty() ? "" : ", ") + merged.targets[t].name;
    }
    if (recorder_) recorder_->take_over(config::to_portable_yaml(merged));
    if (!names.empty()) {
      replacement.done = [this, yaml = config::to_portable_yaml(merged)](capture::Timestamp at) { happens(at, yaml); };
      pipeline_->replace_trackers(std::move(replacement));
    }
    config_ = std::move(merged);
    if (view_) view_->take_over(config_);
    reporter_->take_over(config_);
    set_log_level(config_.log_level);
    if (names.empty()) {
      spdlog::info("reloaded {}: nothing to change", config_.file.string());
    } else {
      spdlog::info("reloaded {}: searching anew for {}", config_.file.string(), names);
    }
  }

  config::ServiceConfig config_;  // as it is in force; the pipeline refers to its rig
  const LiveOptions options_;
  LiveRequests& requests_;
  const bool tolerance_is_given_ = config_.set_tolerance_s.has_value();
  const std::vector<std::string> config_names_ = config_.dds.publisher.targets;
  std::size_t quorum_ = 0;
  std::vector<Target> targets_;
  std::optional<tracks::TrackCsvWriter> csv_;            // the tracking thread's
  std::optional<tracks::PoseFileWriter> poses_;          // the camera thread's
  std::optional<publish::EstimatePublisher> publisher_;  // positions: the tracking thread; status: the supervising one
  std::optional<ViewServer> view_;
  std::optional<StatusReporter> reporter_;
  std::optional<pipeline::Recorder> recorder_;
  std::mutex happened_mutex_;
  std::vector<std::pair<capture::Timestamp, std::string>> happened_;  // guarded by happened_mutex_; config: a reload
  std::vector<capture::Timestamp> camera_left_out_;                   // guarded by happened_mutex_
  std::optional<pipeline::ChangesWriter> changes_;                    // made before any other thread is
  std::string tracks_problem_;                                        // guarded by happened_mutex_
  std::string recording_problem_;                                     // the supervising thread's, as the next
  std::filesystem::path recording_to_;
  std::atomic<bool> has_lost_ = false;
  std::vector<LatencyHistogram> capture_to_dequeue_{config_.rig.cameras.size()};
  LatencyHistogram dequeue_to_write_, dequeue_to_publish_, capture_to_publish_;
  std::optional<MetricsServer> metrics_;
  std::vector<LiveCamera> cameras_;             // their sources are the pipeline's
  std::optional<pipeline::Pipeline> pipeline_;  // after what its outputs use, and cameras_ is used only while it lives

  publish::ServiceStatus last_status_;
  std::vector<object_tracking::TrackState> told_states_;
  std::set<std::string> told_warnings_;
  pipeline::NoPoseLog no_pose_log_;
  Clock::time_point next_status_{}, next_watchdog_{};
  const std::optional<std::chrono::microseconds> watchdog_ = watchdog_period();
  bool is_ready_ = false;
};

}  // namespace

std::optional<std::string> one_under_two_names(std::span<const config::LiveCameraConfig> cameras) {
  std::map<std::filesystem::path, const config::LiveCameraConfig*> nodes;
  for (const auto& camera : cameras) {
    std::error_code error;
    const auto node = std::filesystem::canonical(camera.device, error);
    if (error) continue;
    const auto [first, is_new] = nodes.emplace(node, &camera);
    if (is_new) continue;
    const config::LiveCameraConfig& other = *first->second;
    return other.name + " and " + camera.name + " are one camera: " + other.device.string() + " and " +
           camera.device.string() + " are both " + node.string();
  }
  return std::nullopt;
}

std::vector<LiveCamera> open_cameras(const config::ServiceConfig& config, const std::stop_token& stop) {
  if (const auto both = one_under_two_names(config.cameras))
    throw capture::CaptureError(std::make_error_code(std::errc::invalid_argument),
                                config.file.string() + ": cameras: " + *both + ": give each its own device");
  std::vector<capture::V4l2SourceOptions> asked;
  std::vector<std::future<std::unique_ptr<capture::V4l2Source>>> opening;
  for (const auto& camera : config.cameras) {
    const int index = config.rig.index_of(camera.name).value();
    const calib::ImageSize size = config.rig.cameras[std::size_t(index)].image_size;
    capture::V4l2SourceOptions options;
    options.camera = index;
    options.name = camera.name;
    options.device = camera.device;
    options.format = camera.format;
    options.width = size.width;
    options.height = size.height;
    options.fps = camera.fps.value_or(0);
    options.controls = camera.controls;
    options.restore_controls = camera.restore_controls;
    options.latency = capture::duration_of(camera.latency_offset_s);
    options.first_patience = opening_patience;
    asked.push_back(options);
    opening.push_back(std::async(std::launch::async, [options = std::move(options), stop] {
      return std::make_unique<capture::V4l2Source>(options, stop);
    }));
  }
  // One that cannot do what is asked, or another model in its port, does not keep the others from running: it is
  // absent. When there is no other, it is the configuration that is wrong.
  std::vector<std::pair<int, std::unique_ptr<capture::V4l2Source>>> sources;
  std::vector<std::size_t> wrong;
  std::exception_ptr first_wrong;
  for (std::size_t c = 0; c < opening.size(); ++c) {
    try {
      sources.emplace_back(asked[c].camera, opening[c].get());
    } catch (const capture::CaptureError& error) {
      if (error.code() != std::errc::invalid_argument) throw;
      if (!first_wrong) first_wrong = std::current_exception();
      sources.emplace_back(asked[c].camera, nullptr);
      wrong.push_back(c);
    }
  }
  if (wrong.size() == asked.size() && first_wrong) std::rethrow_exception(first_wrong);
  for (const std::size_t c : wrong) {
    asked[c].may_be_wrong = true;
    sources[c].second = std::make_unique<capture::V4l2Source>(asked[c], stop);
  }
  std::vector<LiveCamera> cameras;
  for (auto& [index, source] : sources) {
    const capture::V4l2Source* said_by = source.get();
    capture::V4l2Source* told_by = source.get();
    cameras.push_back({.camera = index,
                       .source = std::move(source),
                       .health = [said_by] { return said_by->health(); },
                       .take_events = [told_by] { return told_by->take_events(); }});
  }
  return cameras;
}

LiveSummary run_live(const config::ServiceConfig& config, std::vector<LiveCamera> cameras, const LiveOptions& options,
                     LiveRequests& requests, std::stop_token stop) {
  if (cameras.empty())
    throw std::runtime_error(config.file.string() +
                             ": cameras: none is given: name the live cameras; "
                             "ls -l /dev/v4l/by-path/ lists those that there are");
  return LiveService(config, std::move(cameras), options, requests).run(stop);
}

bool is_progressing(std::span<const capture::CameraHealth> cameras, const pipeline::PipelineFigures& figures,
                    std::chrono::steady_clock::time_point now, capture::Duration patience) {
  const auto is_recent = [&](std::chrono::steady_clock::time_point at) { return now - at <= patience; };
  return is_recent(figures.tracking_round) &&
         std::ranges::all_of(cameras, [&](const auto& camera) { return is_recent(camera.last_progress); });
}

std::string status_line(const publish::ServiceStatus& status, std::span<const object_tracking::TrackState> states,
                        const std::string& tracked_camera, camera_tracking::PoseState camera_state) {
  std::size_t delivering = 0, used = 0;
  std::string cameras, targets;
  for (const auto& camera : status.cameras) {
    if (!camera.is_used) continue;
    ++used;
    cameras += (cameras.empty() ? "" : ", ") + camera.name + " ";
    switch (camera.health) {
      case publish::CameraStatus::Health::delivering:
        ++delivering;
        cameras += tenths(camera.rate_hz) + " Hz";
        break;
      case publish::CameraStatus::Health::waiting:
        cameras += "waiting";
        break;
      case publish::CameraStatus::Health::stalled:
        cameras += "stalled";
        break;
      case publish::CameraStatus::Health::absent:
        cameras += "absent";
        break;
      case publish::CameraStatus::Health::ended:
        cameras += "ended";
        break;
    }
  }
  for (std::size_t t = 0; t < states.size(); ++t)
    targets += (targets.empty() ? "" : ", ") + status.targets[t] + " " + std::string(object_tracking::name(states[t]));
  if (!tracked_camera.empty())
    targets +=
        (targets.empty() ? "" : ", ") + tracked_camera + "'s pose " + std::string(camera_tracking::name(camera_state));
  return std::to_string(delivering) + " of " + std::to_string(used) + " cameras deliver: " + cameras + "; " +
         tenths(status.set_rate_hz) + " sets/s" + (targets.empty() ? "" : "; " + targets);
}

}  // namespace huetrack::daemon
