#include "daemon/replay.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>
#include <tuple>
#include <utility>

#include "calib/yaml/yaml_reader.h"
#include "camera_tracking/methods/make_camera_tracker.h"
#include "capture/recording.h"
#include "capture/replay_source.h"
#include "config/formatted.h"
#include "config/service_config.h"
#include "daemon/progress_bar.h"
#include "daemon/service_manager.h"
#include "daemon/status_reporter.h"
#include "daemon/view_server.h"
#include "pictures/camera_pictures.h"
#include "pictures/pictures.h"
#include "pipeline/recorded_changes.h"
#include "publish/estimate_publisher.h"
#include "tracks/pose_file.h"
#include "tracks/track_csv.h"

namespace huetrack::daemon {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

capture::Duration automatic_tolerance(const std::vector<capture::ReplayCamera>& cameras) {
  std::vector<capture::Duration> periods;
  for (const auto& camera : cameras) periods.push_back(camera.frame_period);
  return capture::suggested_tolerance(periods);
}

void wait_for_subscriber(const publish::EstimatePublisher& publisher, double longest_s, const std::stop_token& stop) {
  const auto until = Clock::now() + capture::duration_of(longest_s);
  while (publisher.subscribers() == 0 && !stop.stop_requested()) {
    if (Clock::now() >= until) {
      spdlog::warn("no subscriber within {} s: starting without one", longest_s);
      return;
    }
    std::this_thread::sleep_for(10ms);
  }
}

// Lets the first frame of every camera through, and then none until it is released: so a colour can be taught on it.
class HeldSource final : public capture::FrameSource {
 public:
  HeldSource(std::unique_ptr<capture::FrameSource> source, std::size_t cameras)
      : source_(std::move(source)), seen_(cameras, false) {}

  std::optional<capture::Frame> next(std::stop_token stop) override {
    if (!ahead_) ahead_ = source_->next(stop);
    if (!ahead_) return std::nullopt;
    if (seen_.at(std::size_t(ahead_->camera)) && !released_) {
      const auto since = Clock::now();
      while (!released_ && !stop.stop_requested()) std::this_thread::sleep_for(5ms);
      held_ns_ = (Clock::now() - since).count();
    }
    seen_[std::size_t(ahead_->camera)] = true;
    return std::exchange(ahead_, std::nullopt);
  }
  bool ended(int camera) const override { return !ahead_ && source_->ended(camera); }

  void release() { released_ = true; }                                   // any thread
  bool is_released() const { return released_; }                         // likewise
  const std::atomic<std::int64_t>& held_ns() const { return held_ns_; }  // how long

 private:
  std::unique_ptr<capture::FrameSource> source_;
  std::vector<bool> seen_;
  std::optional<capture::Frame> ahead_;
  std::atomic<bool> released_ = false;
  std::atomic<std::int64_t> held_ns_ = 0;
};

class Tally {  // of one target's estimates
 public:
  Tally(std::string name, const tracks::Truth* truth) {
    summary_.name = std::move(name);
    if (truth != nullptr && truth->targets().contains(summary_.name)) comparison_.emplace(*truth, summary_.name);
  }
  void add(const object_tracking::ObjectEstimate& estimate) {
    if (!first_at_) first_at_ = estimate.at;
    ++sets_;
    ++summary_.sets[estimate.state];
    state_ = estimate.state;
    if (estimate.state == object_tracking::TrackState::tracking && !summary_.first_tracking_set) {
      summary_.first_tracking_set = sets_;
      summary_.first_tracking_s = capture::seconds(estimate.at - *first_at_);
    }
    if (comparison_) comparison_->add(estimate);
  }
  TargetSummary summary() const {
    TargetSummary summary = summary_;
    if (comparison_) summary.truth = comparison_->figures();
    return summary;
  }
  std::string progress() const { return summary_.name + " " + std::string(object_tracking::name(state_)); }

 private:
  TargetSummary summary_;
  std::optional<tracks::TruthComparison> comparison_;
  std::optional<capture::Timestamp> first_at_;
  std::uint64_t sets_ = 0;
  object_tracking::TrackState state_ = object_tracking::TrackState::searching;
};

// Of the cameras whose frames end before those of others do.
std::vector<std::string> early_ends(const std::vector<capture::ReplayCamera>& cameras,
                                    const std::vector<pipeline::CameraFigures>& figures) {
  const auto last = std::ranges::max(figures, {}, &pipeline::CameraFigures::last_captured).last_captured;
  std::vector<std::string> sentences;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (!figures[c].last_captured || cameras[c].frame_period <= 0ns) continue;
    const double short_s = capture::seconds(*last - *figures[c].last_captured);
    const long frames = std::lround(short_s / capture::seconds(cameras[c].frame_period));
    if (frames < 2) continue;  // one more or less is how cameras happen to be stopped
    sentences.push_back(config::formatted("%s ended early: %ld frames (%.3f s) short of the others",
                                          cameras[c].name.c_str(), frames, short_s));
  }
  return sentences;
}

// throws ConfigError: a configuration that cannot be read, or has other targets.
std::vector<pipeline::Pipeline::Replacement> replacements_of(const pipeline::RecordedChanges& changes,
                                                             const config::ServiceConfig& first) {
  std::vector<pipeline::Pipeline::Replacement> replacements;
  config::ServiceConfig before = first;
  for (const auto& reload : changes.reloads) {
    config::ServiceConfig after = config::load_service_config(reload.config);
    if (!std::ranges::equal(after.targets, before.targets, {}, &object_tracking::TargetOptions::name,
                            &object_tracking::TargetOptions::name))
      throw yaml::ConfigError(reload.config, 0, "has other targets than the recording's huetrackd.yaml");
    pipeline::Pipeline::Replacement replacement{.trackers = {}, .from = reload.at};
    for (const auto t : config::targets_that_differ(before, after))
      replacement.trackers.emplace_back(
          t, object_tracking::ObjectTracker(after.rig, after.targets[t], after.object_tracking));
    replacements.push_back(std::move(replacement));
    before = std::move(after);
  }
  return replacements;
}

// Its folder's name, with the folder around it: many are named just "recording".
std::string shown_name(const capture::Recording& recording) {
  const auto folder = std::filesystem::absolute(recording.file).lexically_normal().parent_path();
  return (folder.parent_path().filename() / folder.filename()).string();
}

}  // namespace

ReplaySummary replay(const ReplayCommand& command, std::stop_token stop) {
  const config::ServiceConfig config = config::load_service_config(command.config);
  set_log_level(config.log_level);
  for (const auto& warning : config::warnings_of(config)) spdlog::warn("{}: {}", config.file.string(), warning);

  const bool tracks_camera = !config.camera_tracking.camera.empty();
  if (!command.poses.empty() && !tracks_camera)
    throw std::runtime_error("--poses needs a camera to track: give camera_tracking in " + config.file.string());

  // Everything that may be wrong with the user's files is found before anything is written.
  const capture::Recording recording = capture::read_recording(command.recording);
  std::vector<std::string> camera_names;
  for (const auto& camera : config.rig.cameras) camera_names.push_back(camera.name);
  auto owned_source = std::make_unique<capture::ReplaySource>(
      recording, camera_names,
      capture::ReplayOptions{.decoder_threads = std::max(1, int(std::thread::hardware_concurrency()))});
  capture::ReplaySource& source = *owned_source;
  std::optional<tracks::Truth> truth;
  if (!command.truth.empty()) {
    truth = tracks::Truth::read(command.truth);
    for (const auto& sentence : truth->match(config.dds.publisher.targets)) {
      spdlog::warn("{}: {}", command.truth.string(), sentence);
    }
  }
  std::vector<std::tuple<capture::PixelFormat, capture::ColorRange>>
      formats;  // known before the first frame, and for good
  for (const auto& camera : source.cameras()) formats.emplace_back(camera.format, camera.range);
  const auto tracker_of = [&formats](const config::ServiceConfig& c, const object_tracking::TargetOptions& target) {
    object_tracking::ObjectTracker tracker(c.rig, target, c.object_tracking);
    for (std::size_t i = 0; i < formats.size(); ++i)
      std::apply([&](auto... f) { tracker.expect(int(i), f...); }, formats[i]);
    return tracker;
  };
  std::vector<object_tracking::ObjectTracker> trackers;
  std::vector<Tally> tallies;
  for (const auto& target : config.targets) {
    trackers.push_back(tracker_of(config, target));
    tallies.emplace_back(target.name, truth ? &*truth : nullptr);
  }

  int tracked_camera = -1;
  std::unique_ptr<camera_tracking::CameraTracker> camera_tracker;
  if (tracks_camera) {
    tracked_camera = config.rig.index_of(config.camera_tracking.camera).value();
    camera_tracker = camera_methods::make_camera_tracker(config.rig.cameras[std::size_t(tracked_camera)],
                                                         config::tracker_options(config.camera_tracking));
  }

  std::optional<tracks::PoseFileWriter> poses;
  if (!command.poses.empty()) poses.emplace(command.poses);
  std::optional<tracks::TrackCsvWriter> csv;
  if (!command.tracks.empty()) csv.emplace(command.tracks);
  std::optional<pictures::PictureWriter> pictures;
  if (!command.pictures.empty() && !config.targets.empty()) pictures.emplace(config, command.pictures);
  std::optional<pictures::CameraPictureWriter> camera_pictures;
  if (!command.pictures.empty() && tracks_camera) camera_pictures.emplace(config, command.pictures);
  std::optional<publish::EstimatePublisher> publisher;
  if (config.dds.enabled && !command.no_dds) {
    publisher.emplace(config.dds.publisher);
    spdlog::info("publishing on {}", publisher->description());
    if (command.wait_for_subscriber_s > 0) wait_for_subscriber(*publisher, command.wait_for_subscriber_s, stop);
  }

  const capture::Timestamp first_at = source.first_at().value_or(capture::Timestamp{});
  const auto started = Clock::now();
  ReplaySummary summary;
  if (command.stamps.value_or(command.speed == ReplaySpeed::real ? ReplayStamps::now : ReplayStamps::recording) ==
      ReplayStamps::now) {
    summary.clock_offset = capture::Timestamp(std::chrono::system_clock::now()) - first_at;
  } else if (recording.started_at) {
    summary.clock_offset = recording.started_at->time_since_epoch();
  }

  StatusReporter reporter(config, "replay", summary.clock_offset);
  ProgressBar progress(command.progress);
  std::vector<std::vector<object_tracking::ObjectEstimate>> tracks(
      config.targets.size());  // only for the picture of the track
  std::optional<capture::Timestamp> last_at;
  Clock::time_point tracked_until = started;
  std::atomic<pipeline::Pipeline*> running = nullptr;
  if (command.hold && !publisher) throw std::runtime_error("--hold needs DDS: a page says when to go on");
  HeldSource* held = nullptr;
  std::unique_ptr<capture::FrameSource> first_source = std::move(owned_source);
  if (command.hold) {
    auto holding = std::make_unique<HeldSource>(std::move(first_source), config.rig.cameras.size());
    held = holding.get();
    first_source = std::move(holding);
  }
  // While nothing was let through, time stood still for the recording too.
  const auto clock_offset = [&, now = command.stamps.value_or(command.speed == ReplaySpeed::real
                                                                  ? ReplayStamps::now
                                                                  : ReplayStamps::recording) == ReplayStamps::now] {
    return summary.clock_offset + capture::Duration(held != nullptr && now ? held->held_ns().load() : 0);
  };

  pipeline::PipelineOutputs outputs;
  outputs.estimates = [&](const capture::FrameSet& set, std::span<const object_tracking::ObjectEstimate> estimates,
                          capture::Timestamp received_at) {
    last_at = set.at;
    for (std::size_t t = 0; t < estimates.size(); ++t) {
      if (publisher) publisher->publish(t, estimates[t], estimates[t].at + clock_offset(), received_at);
      if (csv) csv->write(config.targets[t].name, estimates[t]);
      tallies[t].add(estimates[t]);
      if (pictures) {
        tracks[t].push_back(estimates[t]);
        tracks[t].back().per_view.clear();
      }
    }
    tracked_until = Clock::now();
    if (!publisher && command.reload != nullptr && command.reload->exchange(false))
      spdlog::warn("SIGHUP: without DDS, a replay does not read its configuration again");
    if (!progress.due()) return;
    std::uint64_t frames = 0;
    for (const auto& camera : running.load()->figures().cameras) frames += camera.frames + camera.corrupted;
    std::string states;
    for (const auto& tally : tallies) states += (states.empty() ? "" : ", ") + tally.progress();
    progress.draw(frames, source.expected_frames(),
                  capture::seconds(set.at - first_at) / capture::seconds(Clock::now() - started), states);
  };
  if (publisher) {
    outputs.status = [&](const pipeline::PipelineFigures& figures) {
      publish::ServiceStatus status = reporter.report(figures, Clock::now(), std::chrono::system_clock::now());
      std::ranges::copy(publisher->warnings(), std::back_inserter(status.warnings));
      if (held != nullptr && !held->is_released()) status.mode = "held";
      publisher->publish_status(status);
    };
  }
  std::vector<camera_tracking::CameraEstimate> way;  // only for the picture of the map
  pipeline::NoPoseLog no_pose_log;                   // the camera thread's, as the next
  Clock::time_point camera_tracked_until = started;
  if (tracks_camera) {
    summary.camera.emplace().name = config.camera_tracking.camera;
    outputs.camera_poses = [&](const camera_tracking::CameraEstimate& estimate, capture::Timestamp received_at) {
      if (publisher) publisher->publish(estimate, estimate.at + summary.clock_offset, received_at);
      if (poses) poses->write(estimate);
      ++summary.camera->frames[estimate.state];
      if (estimate.has_pose() && !summary.camera->first_pose_frame)
        summary.camera->first_pose_frame = estimate.frame_number;
      no_pose_log.tell(summary.camera->name, running.load()->tracked_camera());
      if (camera_pictures) way.push_back(estimate);
      camera_tracked_until = Clock::now();
    };
    if (camera_pictures)
      outputs.camera_pictures = [&](const pictures::CameraPictureJob& job) { camera_pictures->write(job); };
  }
  std::optional<ViewServer> view;
  if (publisher) {
    ViewServerOptions viewing{.keeps_frames = true, .reload_asked = command.reload};
    viewing.actions.reload = [&]() -> std::string {
      config::ServiceConfig fresh = config::load_service_config(config.file);
      pipeline::Pipeline::Replacement replacement;
      for (std::size_t t = 0; t < config.targets.size(); ++t) {
        const auto it = std::ranges::find(fresh.targets, config.targets[t].name, &object_tracking::TargetOptions::name);
        if (it == fresh.targets.end()) return "target " + config.targets[t].name + " is gone from the configuration";
        replacement.trackers.emplace_back(t, tracker_of(fresh, *it));
      }
      if (fresh.targets.size() != config.targets.size()) return "targets were added: that needs a restart";
      if (running == nullptr) return "the replay has not begun yet";
      running.load()->replace_trackers(std::move(replacement));
      view->take_over(fresh);
      return "";
    };
    if (held != nullptr) viewing.actions.resume = [held] { held->release(); };
    view.emplace(config, std::move(viewing));
    view->set_clock_offset(summary.clock_offset);
    outputs.view_wanted = [&view] { return view->wants(); };
    outputs.view = [&](pictures::PictureJob job) {
      view->set_clock_offset(clock_offset());
      view->offer(std::move(job));
    };
    outputs.camera_map_wanted = [&view] { return view->wants_map(); };
    outputs.camera_map = [&view](camera_tracking::CameraMap map) { view->offer(std::move(map)); };
  }
  if (pictures) outputs.pictures = [&](const pictures::PictureJob& job) { pictures->write(job); };

  pipeline::PipelineOptions options;
  options.frame_sets.camera_count = int(config.rig.cameras.size());
  // Merged by capture time, but our own recordings repeat the order of arrival, and with it the live sets.
  options.frame_sets.ascending_input = std::ranges::all_of(
      recording.cameras, [](const auto& camera) { return camera.received.empty() && camera.corrupted.empty(); });
  options.frame_sets.tolerance =
      config.set_tolerance_s ? capture::duration_of(*config.set_tolerance_s) : automatic_tolerance(source.cameras());
  options.threads = command.threads.value_or(config.threads);
  options.pictures_every = command.pictures_every;
  options.view_particles = std::size_t(std::max(1, config.preview.particles));
  if (command.speed == ReplaySpeed::real)
    options.pace = pipeline::Pace{started, first_at, held != nullptr ? &held->held_ns() : nullptr};

  // With the configuration that lies in the recording, what happened while it was made happens again.
  const auto folder = recording.file.parent_path();
  pipeline::RecordedChanges changes;
  if (std::error_code none; std::filesystem::equivalent(config.file, folder / "huetrackd.yaml", none))
    changes = pipeline::read_changes(folder);
  if (!changes.left_out.empty() || !changes.reloads.empty())
    spdlog::info("as when it was recorded, {} sets are left out and {} reloads repeated", changes.left_out.size(),
                 changes.reloads.size());
  options.left_out = changes.left_out;
  options.camera_left_out = changes.camera_left_out;

  std::vector<std::unique_ptr<capture::FrameSource>> sources;
  sources.push_back(std::move(first_source));
  pipeline::Pipeline pipeline(config.rig, std::move(sources), std::move(trackers), options, std::move(outputs));
  for (auto& replacement : replacements_of(changes, config)) pipeline.replace_trackers(std::move(replacement));
  running = &pipeline;
  struct EndFirst {  // it calls back into the pipeline
    std::optional<ViewServer>& view;
    ~EndFirst() { view.reset(); }
  } const end_first{view};
  if (camera_tracker) pipeline.track_camera(tracked_camera, std::move(camera_tracker));
  pipeline.run(stop);
  if (poses) poses->flush();
  if (tracks_camera && !config.camera_tracking.save_map.empty())
    pipeline::save_map(*pipeline.camera_tracker(), pipeline.tracked_camera(), config.camera_tracking.save_map);
  if (csv) csv->flush();
  progress.clear();

  summary.clock_offset = clock_offset();
  summary.wall_s = capture::seconds(std::max(tracked_until, camera_tracked_until) - started);
  summary.stopped = stop.stop_requested();
  summary.figures = pipeline.figures();
  for (const auto& warning : source.take_warnings()) spdlog::warn("{}", warning);
  capture::Duration period = 0ns;
  for (const auto& camera : source.cameras()) {
    summary.missing_frames += camera.missing;
    summary.corrupted_frames += camera.corrupted;
    period = std::max(period, camera.frame_period);
  }
  if (!summary.stopped) summary.ended_early = early_ends(source.cameras(), summary.figures.cameras);
  if (last_at) summary.recorded_s = capture::seconds(*last_at - first_at + period);
  for (const auto& tally : tallies) summary.targets.push_back(tally.summary());
  for (std::size_t t = 0; t < config.targets.size(); ++t) {
    TargetSummary& target = summary.targets[t];
    if (!target.first_tracking_set) target.advice = summary.figures.searches[t].advice(config.targets[t], camera_names);
  }
  if (publisher) {
    summary.published = publisher->counters().published;
    summary.publish_failures = publisher->counters().failures;
    summary.bus = publisher->description();
  }
  if (pictures) {
    pictures->write("track_3d.png", pictures::draw_track_3d(config, "Track in 3-D: " + shown_name(recording), tracks,
                                                            truth ? &*truth : nullptr));
    summary.pictures = pictures->written() + 1;
  }
  if (camera_pictures) {
    camera_pictures->finish("The way of " + config.camera_tracking.camera + ": " + shown_name(recording), way,
                            pipeline.camera_tracker()->map());
    summary.pictures += camera_pictures->written();
  }
  return summary;
}

std::string to_text(const ReplaySummary& s, const ReplayCommand& command) {
  std::string text;
  std::uint64_t frames = 0;
  for (const auto& camera : s.figures.cameras) frames += camera.frames + camera.corrupted;
  const auto& sets = s.figures.frame_sets;
  text += config::formatted("%s%llu frame sets of %llu frames: %.3f s of recording in %.3f s, %.1fx real time\n",
                            s.stopped ? "stopped: " : "", static_cast<unsigned long long>(s.figures.sets_tracked),
                            static_cast<unsigned long long>(frames), s.recorded_s, s.wall_s,
                            s.wall_s > 0 ? s.recorded_s / s.wall_s : 0);
  text += config::formatted("  frames  %lld missing, %lld corrupted, %llu late; %llu sets without every camera\n",
                            static_cast<long long>(s.missing_frames), static_cast<long long>(s.corrupted_frames),
                            static_cast<unsigned long long>(sets.late_frames),
                            static_cast<unsigned long long>(sets.incomplete_sets));

  for (const auto& sentence : s.ended_early) text += "          " + sentence + "\n";

  const auto& f = s.figures;
  // The camera's thread runs beside the tracking thread: together this is what one core would need.
  const double own_s = capture::seconds(f.synchronise.wall + f.track.wall + f.camera_track.wall + f.publish.wall);
  text += config::formatted(
      "  time    decode %.3f s (CPU %.3f), synchronise %.3f (%.3f), track %.3f (%.3f), publish and write %.3f (%.3f)",
      capture::seconds(f.decode.wall), capture::seconds(f.decode.cpu), capture::seconds(f.synchronise.wall),
      capture::seconds(f.synchronise.cpu), capture::seconds(f.track.wall), capture::seconds(f.track.cpu),
      capture::seconds(f.publish.wall), capture::seconds(f.publish.cpu));
  if (s.camera)
    text += config::formatted(", camera %.3f (%.3f)", capture::seconds(f.camera_track.wall),
                              capture::seconds(f.camera_track.cpu));
  if (s.pictures > 0)
    text += config::formatted(", draw %.3f (%.3f)", capture::seconds(f.draw.wall), capture::seconds(f.draw.cpu));
  const auto times = [&](double busy_s) {
    const double faster = busy_s > 0 ? s.recorded_s / busy_s : 0;
    return config::formatted(faster < 10 ? "%.1fx" : "%.0fx", faster);
  };
  text += config::formatted("\n          with decoding%s left out: %s real time", s.pictures > 0 ? " and drawing" : "",
                            times(own_s).c_str());
  if (!s.targets.empty())
    text += config::formatted("; without the first set too (%.3f s, colour tables): %s",
                              capture::seconds(f.track_first.wall),
                              times(own_s - capture::seconds(f.track_first.wall)).c_str());
  text += "\n";

  for (const auto& target : s.targets) {
    std::uint64_t all = 0;
    for (const auto& [_, count] : target.sets) all += count;
    text += config::formatted("  %-7s ", target.name.c_str());
    if (target.first_tracking_set) {
      text += config::formatted("tracking from set %llu on (%.3f s);",
                                static_cast<unsigned long long>(*target.first_tracking_set), target.first_tracking_s);
    } else {
      text += "never tracking;";
    }
    for (const auto& [state, count] : target.sets) {
      text += config::formatted(" %s %.1f %%", std::string(object_tracking::name(state)).c_str(),
                                100.0 * double(count) / double(all));
    }
    text += "\n";
    if (!target.advice.empty()) text += "          " + target.advice + "\n";
    if (target.truth) text += "          " + tracks::to_text(*target.truth) + "\n";
  }

  if (s.camera) {
    std::uint64_t all = 0;
    for (const auto& [_, count] : s.camera->frames) all += count;
    text += config::formatted("  %-7s ", s.camera->name.c_str());
    if (s.camera->first_pose_frame) {
      text +=
          config::formatted("pose from frame %llu on;", static_cast<unsigned long long>(*s.camera->first_pose_frame));
    } else {
      const auto& why = f.tracked_camera.why;
      text += why.empty() ? "never a pose;" : "never a pose: " + why + "\n         ";
    }
    for (const auto& [state, count] : s.camera->frames)
      text += config::formatted(" %s %.1f %%", std::string(camera_tracking::name(state)).c_str(),
                                100.0 * double(count) / double(all));
    text += config::formatted("; %.2f ms per frame (CPU %.2f)\n",
                              all > 0 ? 1e3 * capture::seconds(f.camera_track.wall) / double(all) : 0,
                              all > 0 ? 1e3 * capture::seconds(f.camera_track.cpu) / double(all) : 0);
    if (s.camera->first_pose_frame && f.tracked_camera.without_since)
      text += "          lost at the end" + (f.tracked_camera.why.empty() ? "" : ": " + f.tracked_camera.why) + "\n";
  }

  if (!command.poses.empty()) text += "  poses   " + command.poses.string() + "\n";
  if (!command.tracks.empty()) text += "  tracks  " + command.tracks.string() + "\n";
  if (s.pictures > 0) {
    text += "  pictures " + std::to_string(s.pictures) + " in " + command.pictures.string() + "\n";
  }
  if (!s.bus.empty()) {
    const std::int64_t ns = s.clock_offset.count();
    text +=
        config::formatted("  bus     %llu samples, %llu failures; %s\n", static_cast<unsigned long long>(s.published),
                          static_cast<unsigned long long>(s.publish_failures), s.bus.c_str());
    text += config::formatted("          published capture times are the recording's plus %lld.%09lld s\n",
                              static_cast<long long>(ns / 1'000'000'000),
                              static_cast<long long>(std::abs(ns % 1'000'000'000)));
  }
  return text;
}

}  // namespace huetrack::daemon
