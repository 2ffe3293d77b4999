#include "daemon/replay.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "calib/files/terminal_line.h"
#include "color/color_name.h"
#include "config/service_config.h"
#include "daemon/opened_recording.h"
#include "daemon/reloader.h"
#include "daemon/service_manager.h"
#include "daemon/status_reporter.h"
#include "page/page_service.h"
#include "page/recorded_moments.h"
#include "pipeline/bus.h"
#include "pipeline/file_outputs.h"
#include "pipeline/picture_folder.h"
#include "pipeline/session.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"
#include "reports/radius_advice.h"
#include "reports/reports.h"
#include "reports/search_advice.h"

namespace huetrack::daemon {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

// ---- Inputs

config::ServiceConfig configuration_of(const ReplayCommand& command) {
  config::ServiceConfig config = load_or_name_swap(command);
  config::require_rig(config);
  set_log_level(config.log_level);
  for (const auto& warning : config::warnings_of(config)) spdlog::warn("{}: {}", config.file.string(), warning);
  if (command.hold && command.no_dds)
    throw std::runtime_error("--hold needs DDS, because the page continues the replay: leave out --no-dds");
  if (command.hold && !config.dds.enabled)
    throw std::runtime_error(config.file.string() +
                             ": --hold needs dds: {enabled: true}, because the page continues the replay over DDS");
  if (command.hold && !config.control.allow_teach)
    throw std::runtime_error(config.file.string() +
                             ": --hold needs control: {allow_teach: true}, because the page continues the replay");
  return config;
}

void refuse_outputs_over_inputs(const ReplayCommand& command, const config::ServiceConfig& config,
                                const recordings::Recording& recording) {
  std::vector<std::filesystem::path> read = pipeline::files_of(config);
  std::ranges::copy(pipeline::files_of(recording), std::back_inserter(read));
  if (!command.truth.empty()) read.push_back(command.truth);
  pipeline::refuse_outputs({.files = {command.tracks, command.poses, command.write_rig}, .pictures = command.pictures},
                           read);
}

// Replayed with its own configuration, a recording repeats its changes.
pipeline::RecordedChanges changes_to_repeat(const config::ServiceConfig& config,
                                            const recordings::Recording& recording) {
  if (std::error_code none; !std::filesystem::exists(recording.file, none)) return {};  // videos
  const auto folder = recording.file.parent_path();
  if (std::error_code none; !std::filesystem::equivalent(config.file, folder / "huetrackd.yaml", none)) return {};
  pipeline::RecordedChanges changes = pipeline::read_changes(folder);
  if (!changes.left_out.empty() || !changes.reloads.empty())
    spdlog::info("repeating the live run: skipping {} dropped sets, repeating {} reloads", changes.left_out.size(),
                 changes.reloads.size());
  return changes;
}

std::optional<tracks::Truth> truth_of(const config::ServiceConfig& config, const ReplayCommand& command,
                                      const recordings::ReplaySource& source) {
  if (command.truth.empty()) return std::nullopt;
  tracks::Truth truth = tracks::Truth::read(command.truth);
  for (const auto& sentence : truth.match(config.dds.publisher.targets, config.dds.publisher.counts))
    spdlog::warn("{}: {}", command.truth.string(), sentence);
  const auto length = length_of(source);
  if (!length) return truth;  // how long it is, no file says
  const capture::Timestamp first = source.first_at().value_or(capture::Timestamp{});
  const auto& volume = config.object_tracking.volume;
  for (const auto& sentence : truth.contradictions(first, first + *length, {volume.min, volume.max}))
    spdlog::warn("{}: {}", command.truth.string(), sentence);
  return truth;
}

// ---- Outputs besides the pipeline's

// The status sample, as an output, because a replay may be short.
class ReplayStatus final : public pipeline::Output {
 public:
  ReplayStatus(const config::ServiceConfig& config, pipeline::Bus& bus, const pipeline::PublishedTime& time,
               const PlayedSource* played, const reports::Reports& reports)
      : bus_(bus), time_(time), played_(played), reports_(reports), reporter_(config, "replay", {}) {}

  void on_status(const pipeline::PipelineFigures& figures) override {
    publish::ServiceStatus status;
    {
      const std::scoped_lock lock(mutex_);
      status = reporter_.report(figures, Clock::now(), std::chrono::system_clock::now(), {},
                                reports_.mistakes.do_views_contradict());
    }
    status.clock_offset_s = capture::seconds(time_.offset());
    std::ranges::copy(bus_.publisher().warnings(), std::back_inserter(status.warnings));
    std::ranges::copy(reports_.warnings(), std::back_inserter(status.warnings));
    if (played_ != nullptr && played_->state().is_paused) status.mode = "held";
    bus_.publisher().publish_status(status);
    bus_.publisher().publish_times(status.at, reports_.times.timing());
  }
  void on_config(const config::ServiceConfig& config) noexcept override {
    const std::scoped_lock lock(mutex_);
    reporter_.take_over(config);
  }

 private:
  pipeline::Bus& bus_;
  const pipeline::PublishedTime& time_;
  const PlayedSource* const played_;
  const reports::Reports& reports_;
  std::mutex mutex_;
  StatusReporter reporter_;  // guarded by mutex_: the page's thread reloads
};

// The progress bar.
class ReplayProgress final : public pipeline::Output {
 public:
  ReplayProgress(bool wanted, const pipeline::Session& session, const OpenedRecording& playback, bool loops)
      : bar_(wanted),
        session_(session),
        expected_(loops ? std::nullopt : playback.source().expected_frames()),
        first_at_(playback.first_at),
        targets_(session.config().target_names()) {}
  void begin(Clock::time_point at) { began_ = at; }

  void on_set(const pipeline::TrackedSet& set) override {
    if (!bar_.due()) return;
    std::uint64_t frames = 0;
    for (const auto& camera : session_.figures().cameras) frames += camera.frames + camera.corrupted;
    std::vector<std::string> states;
    for (const auto& estimate : set.estimates)
      states.push_back(fmt::format("{} {}", object_tracking::object_name(targets_[estimate.target], estimate.object),
                                   object_tracking::name(estimate.state)));
    const double played_s = capture::seconds(set.frames.at - first_at_);
    bar_.draw(fmt::format("{} frames  {:.1f}x real time{}{}", files::progress_bar(frames, expected_),
                          played_s / capture::seconds(Clock::now() - began_), states.empty() ? "" : "  ",
                          fmt::join(states, ", ")));
  }
  void flush() override { bar_.clear(); }

 private:
  files::TerminalLine bar_;
  const pipeline::Session& session_;
  const std::optional<std::int64_t> expected_;
  const capture::Timestamp first_at_;
  std::vector<std::string> targets_;
  Clock::time_point began_{};
};

// Explains why SIGHUP has no effect.
class ReloadRefusal final : public pipeline::Output {
 public:
  explicit ReloadRefusal(std::atomic<bool>& asked) : asked_(asked) {}
  void on_set(const pipeline::TrackedSet& /*set*/) override {
    if (asked_.exchange(false)) spdlog::warn("SIGHUP: without DDS, a replay does not read its configuration again");
  }

 private:
  std::atomic<bool>& asked_;
};

page::PageServiceOptions page_options(pipeline::Session& session, const ReplayCommand& command, PlayedSource* played,
                                      const std::atomic<bool>& has_begun) {
  page::PageServiceOptions options{.keeps_frames = true, .time = &session.time(), .reload_requested = command.reload};
  options.actions.reload = [&session, &has_begun]() -> std::string {
    if (!has_begun) return "the replay has not started yet";
    return reload(session);
  };
  options.control.reload = options.actions.reload;
  options.control.playback = played;
  options.control.close = command.close;
  if (played != nullptr) options.actions.resume = [played] { played->go_on(); };
  options.actions.moments = [config = session.config(), words = command.recording](const std::stop_token& stop) {
    return page::recorded_moments(config, words, stop);
  };
  return options;
}

// ---- The run

void wait_for_subscribers(const publish::EstimatePublisher& publisher, const ReplayCommand& command,
                          const std::stop_token& stop) {
  const auto until = Clock::now() + capture::duration_of(command.wait_for_subscriber_s);
  while (publisher.subscribers() < command.subscribers && !stop.stop_requested()) {
    if (Clock::now() >= until) {
      spdlog::warn("{} of {} subscribers within {} s: starting without the rest", publisher.subscribers(),
                   command.subscribers, command.wait_for_subscriber_s);
      return;
    }
    std::this_thread::sleep_for(10ms);
  }
}

// Start of the first frame, as published.
void begin_time(pipeline::Session& session, const OpenedRecording& playback, const ReplayCommand& command) {
  const bool is_paced = command.speed > 0;
  // Pauses shift the published times.
  pipeline::PublishedTime::Lag lag;
  if (const PlayedSource* const played = playback.played)
    lag = [played](capture::Timestamp captured) { return played->lag_at(captured); };
  if (command.stamps.value_or(is_paced ? ReplayStamps::now : ReplayStamps::recording) == ReplayStamps::now) {
    session.time().begin(capture::Timestamp(std::chrono::system_clock::now()) - playback.first_at, std::move(lag));
  } else if (playback.recording.started_at) {
    session.time().begin(playback.recording.started_at->time_since_epoch());
  }
}

// ---- Summary

// Cameras whose frames end before those of others.
std::vector<std::string> early_ends(const std::vector<recordings::ReplayCamera>& cameras,
                                    const std::vector<pipeline::CameraFigures>& figures) {
  const auto last = std::ranges::max(figures, {}, &pipeline::CameraFigures::last_captured).last_captured;
  std::vector<std::string> sentences;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (!figures[c].last_captured || cameras[c].frame_period <= 0ns) continue;
    const double short_s = capture::seconds(*last - *figures[c].last_captured);
    const long frames = std::lround(short_s / capture::seconds(cameras[c].frame_period));
    if (frames < 2) continue;                 // a difference of one frame is usual
    auto others = capture::Timestamp::max();  // their beginning
    for (std::size_t other = 0; other < cameras.size(); ++other)
      if (other != c && cameras[other].first_at) others = std::min(others, *cameras[other].first_at);
    if (*figures[c].last_captured < others) {
      sentences.push_back(fmt::format(
          "{} ended at {:.3f} s, before another camera began, at {:.3f} s: their times are of different clocks, as of "
          "one since 1970 and one since its start, or wrong (fps, offset_s, timestamps)",
          cameras[c].name, capture::seconds(figures[c].last_captured->time_since_epoch()),
          capture::seconds(others.time_since_epoch())));
      continue;
    }
    sentences.push_back(
        fmt::format("{} ended early: {} frames ({:.3f} s) short of the others", cameras[c].name, frames, short_s));
  }
  return sentences;
}

// Folder name with its parent, because many are named just "recording".
std::string shown_name(const recordings::Recording& recording) {
  if (std::error_code none; !std::filesystem::exists(recording.file, none)) return recording.file.string();  // videos
  const auto folder = std::filesystem::absolute(recording.file).lexically_normal().parent_path();
  return (folder.parent_path().filename() / folder.filename()).string();
}

// A visible target is usually found in two sets; a longer search has a reason.
constexpr double usual_search_s = 0.5;

// Advice for a target that was tracked, but may be something else.
std::string doubt_advice(const TargetSummary& summary, const object_tracking::TargetOptions& target) {
  const reports::TrackedSets& sets = summary.tracked;
  if (sets.tracked() == 0) return {};
  const std::string seldom = reports::seldom_advice(double(sets.tracked()) / double(sets.all()), target);
  return seldom.empty() ? reports::unsure_advice(double(sets.unsure()) / double(sets.tracked()), target) : seldom;
}

// An unset radius is a mistake, unless the outlines have shown it.
void note_unset_radius(TargetSummary& target, const object_tracking::TargetOptions& options,
                       std::vector<std::string>& mistakes) {
  if (!options.is_radius_assumed || !target.first_tracking_set) return;
  std::string text = reports::unset_radius_text(target.shown_radius_m, target.is_radius_known, options);
  if (target.is_radius_known)
    target.unset_radius = std::move(text);
  else
    mistakes.push_back(std::move(text));
}

// Where the rig does not explain the views: cameras whose files turn their pictures by a tag. Empty: none.
std::string turned_text(const recordings::ReplaySource& source) {
  std::vector<std::string> turned;
  for (const auto& camera : source.cameras())
    if (camera.is_turned) turned.push_back(camera.name);
  if (turned.empty()) return {};
  return fmt::format(
      "the pictures of {} are turned as a tag of {} says, which may explain that: the rig must be calibrated with "
      "pictures that are turned alike; otherwise remove the tags",
      fmt::join(turned, " and "), turned.size() == 1 ? "the file" : "their files");
}

// Where the rig does not explain the views: two films of as many frames, at rates that differ. Empty: none.
std::string rates_text(const recordings::ReplaySource& source) {
  constexpr double same_rate = 1.02;  // 29.97 and 30
  const auto frames_of = [](const auto& camera) { return camera.frames + camera.missing + camera.corrupted; };
  for (const auto& slow : source.cameras())
    for (const auto& fast : source.cameras()) {
      const double slow_s = capture::seconds(slow.frame_period), fast_s = capture::seconds(fast.frame_period);
      if (!(fast_s > 0 && slow_s > same_rate * fast_s) || std::abs(frames_of(fast) - frames_of(slow)) > 1) continue;
      return fmt::format(
          "{} and {} have as many frames, {}, but at {:.4g} and {:.4g} frames a second: if they filmed for the same "
          "time, one was saved at a wrong rate: give it the right one, fps: {:.4g} or {:.4g} with trust_times: true",
          fast.name, slow.name, frames_of(fast), 1 / fast_s, 1 / slow_s, 1 / slow_s, 1 / fast_s);
    }
  return {};
}

// Times that may be counted, not measured; empty: none.
std::string even_times_text(const recordings::ReplaySource& source) {
  std::vector<std::string> rates;
  for (const auto& camera : source.cameras())
    if (camera.even_hz > 0) rates.push_back(fmt::format("{} {:.4g}", camera.name, camera.even_hz));
  if (rates.empty() || source.cameras().size() < 2) return {};
  return fmt::format(
      "even times, as programs count them, frames a second: {}: if a camera dropped a frame that its file does not "
      "count, all its later times are a frame too early, and latencies are of a part of the film",
      fmt::join(rates, ", "));
}

// Cameras that see no target because their pictures have no colour. Empty: none; the tracked camera needs none.
std::string grey_text(const recordings::ReplaySource& source, const config::ServiceConfig& config) {
  if (config.targets.empty()) return {};
  std::vector<std::string> grey;
  std::size_t looking = 0;
  for (const auto& camera : source.cameras()) {
    if (config.camera_tracking.camera == camera.name) continue;
    ++looking;
    if (camera.is_grey) grey.push_back(camera.name);
  }
  if (grey.empty()) return {};
  return fmt::format("the pictures of {} are grey, so no colour can be found in them: record in colour",
                     grey.size() == looking && looking > 1 ? "all cameras" : fmt::to_string(fmt::join(grey, " and ")));
}

// config: in force at the end. figures: after the run
ReplaySummary summary_of(const config::ServiceConfig& config, const ReplayCommand& command,
                         const pipeline::PipelineFigures& figures, const OpenedRecording& playback, const Tally& tally,
                         Clock::time_point began, bool is_stopped, bool do_views_contradict) {
  ReplaySummary summary;
  summary.figures = figures;
  summary.stopped = is_stopped;
  summary.wall_s = capture::seconds(tally.last_out() - began);
  const recordings::ReplaySource& source = playback.source();
  capture::Duration period = 0ns;
  for (const auto& camera : source.cameras()) {
    summary.missing_frames += camera.missing;
    summary.corrupted_frames += camera.corrupted;
    period = std::max(period, camera.frame_period);
  }
  if (!is_stopped) summary.ended_early = early_ends(source.cameras(), summary.figures.cameras);
  if (tally.last_at()) summary.recorded_s = capture::seconds(*tally.last_at() - playback.first_at + period);
  summary.targets = tally.targets();
  const std::vector<std::string> cameras = config.rig.camera_names();
  for (std::size_t t = 0; t < summary.targets.size(); ++t) {
    TargetSummary& target = summary.targets[t];
    if (do_views_contradict) target.outlines.radius_m.reset();
    if (config::is_taught(config.targets[t])) target.color = color::hue_text(config.targets[t].color);
    const objects::SearchFindings& of_run = figures.searches_of_run[t];
    const bool is_mostly_lost = target.lost_share() > reports::most_lost_share;
    const bool is_outside = !do_views_contradict && reports::is_seen_outside(of_run, config.targets[t]);
    if ((is_mostly_lost || is_outside) && config::is_taught(config.targets[t]) && target.first_tracking_set) {
      target.advice =
          reports::lost_advice(target.lost_share(), of_run, config.targets[t], cameras, do_views_contradict);
      target.is_seen_in_vain =
          is_mostly_lost && !do_views_contradict && reports::is_seen_in_vain(of_run, config.targets[t]);
      continue;
    }
    if (target.first_tracking_set) {
      if (target.first_tracking_s > usual_search_s)
        target.advice = reports::late_advice(figures.searches[t], config.targets[t], do_views_contradict);
      if (target.advice.empty()) target.advice = doubt_advice(target, config.targets[t]);
      continue;
    }
    target.advice =
        config::is_taught(config.targets[t])
            ? reports::search_advice(figures.searches[t], config.targets[t], cameras, do_views_contradict)
            : "it has no colour yet: " +
                  config::teach_advice(config, config.targets[t], fmt::format("{}", fmt::join(command.recording, " ")));
  }
  summary.camera = tally.camera();
  return summary;
}

// The mistakes, and without the advice that they make void. at_end: the configuration in force then.
void add_mistakes(const config::ServiceConfig& config, const config::ServiceConfig& at_end,
                  const recordings::ReplaySource& source, bool are_times_contradicted, const reports::Reports& reports,
                  ReplaySummary& summary) {
  summary.mistakes = source.mistakes();  // first: the files themselves say it
  std::ranges::copy(reports.mistakes.summary(are_times_contradicted), std::back_inserter(summary.mistakes));
  for (const std::string& reason : {turned_text(source), rates_text(source)})
    if (reports.mistakes.has_explained_rig() && !reason.empty()) summary.mistakes.push_back(reason);
  const std::string unit_mistake = config::unit_mistake(config);
  if (!unit_mistake.empty()) summary.mistakes.push_back(unit_mistake);
  const auto is_found = [](const TargetSummary& target) { return target.first_tracking_set.has_value(); };
  const bool is_all_found = std::ranges::all_of(summary.targets, is_found);
  // With inverted poses not all targets would be found, or the views would be inconsistent.
  const std::string poses = is_all_found && !reports.mistakes.do_views_contradict() ? "" : config::pose_mistake(config);
  if (!poses.empty()) summary.mistakes.push_back(poses);
  const std::string grey = grey_text(source, at_end);
  if (!grey.empty()) summary.mistakes.push_back(grey);
  // Advice about the search would mislead next to a mistake that explains the problem.
  for (TargetSummary& target : summary.targets) {
    const bool is_tracked = target.first_tracking_set.has_value();
    if (!unit_mistake.empty() || !poses.empty() || !grey.empty() || (is_tracked && !summary.mistakes.empty()) ||
        reports.mistakes.has_explained_rig())
      target.advice.clear();
  }
  for (std::size_t t = 0; t < summary.targets.size(); ++t)
    note_unset_radius(summary.targets[t], at_end.targets[t], summary.mistakes);
}

}  // namespace

ReplaySummary replay(const ReplayCommand& command, const std::stop_token& stop) {
  // Validate all files before anything is written.
  const config::ServiceConfig config = configuration_of(command);
  OpenedRecording playback = open_recording(config, command);
  refuse_outputs_over_inputs(command, config, playback.recording);
  for (const auto& warning : playback.source().take_warnings()) spdlog::warn("{}", warning);
  const std::optional<tracks::Truth> truth = truth_of(config, command, playback.source());
  pipeline::Session session(config, std::move(playback.sources),
                            {.threads = command.threads,
                             .pictures_every = command.pictures.empty() ? 0 : command.pictures_every,
                             .repeats = changes_to_repeat(config, playback.recording)});
  if (command.hold) {
    playback.played->hold_beyond(
        first_whole_set(playback.source(), capture::duration_of(*session.config().set_tolerance_s)));
    spdlog::info("held at the first set: open the page with `huetrack view`, and press Go on there");
  }

  // The outputs, in order.
  std::optional<pipeline::Bus> bus;
  if (config.dds.enabled && !command.no_dds) session.add(bus.emplace(config.dds.publisher, session.time()));
  reports::Reports reports(session, {.write_rig = command.write_rig, .is_recorded = true});
  std::optional<ReplayStatus> status;
  if (bus) session.add(status.emplace(session.config(), *bus, session.time(), playback.played, reports));
  std::optional<pipeline::TrackFile> tracks;
  if (!command.tracks.empty()) session.add(tracks.emplace(command.tracks, config, pipeline::WhenFileFails::stop));
  std::optional<pipeline::PoseFile> poses;
  if (!command.poses.empty()) session.add(poses.emplace(command.poses, config, pipeline::WhenFileFails::stop));
  std::optional<pipeline::PictureFolder> pictures;
  if (!command.pictures.empty()) session.add(pictures.emplace(config, command.pictures));
  Tally tally(config, truth ? &*truth : nullptr);
  session.add(tally);
  ReplayProgress progress(command.progress, session, playback, command.loops);
  session.add(progress);
  std::optional<ReloadRefusal> refusal;
  if (!bus && command.reload != nullptr) session.add(refusal.emplace(*command.reload));
  std::atomic<bool> has_begun = false;  // the page's thread already runs, but must not reload yet
  std::optional<page::PageService> page_service;
  if (bus)
    session.add(page_service.emplace(session.config(), page_options(session, command, playback.played, has_begun)));

  if (bus && command.wait_for_subscriber_s > 0) wait_for_subscribers(bus->publisher(), command, stop);
  const auto began = Clock::now();
  begin_time(session, playback, command);
  tally.begin(began);
  progress.begin(began);
  has_begun = true;
  session.run(stop);
  session.save_camera_map();

  for (const auto& warning : playback.source().take_warnings()) spdlog::warn("{}", warning);
  ReplaySummary summary = summary_of(session.config(), command, session.figures(), playback, tally, began,
                                     stop.stop_requested(), reports.mistakes.do_views_contradict());
  if (playback.played != nullptr) summary.held_s = capture::seconds(playback.played->paused());
  summary.wall_s -= summary.held_s;
  add_mistakes(config, session.config(), playback.source(), !playback.contradicted_times->texts.empty(), reports,
               summary);
  summary.clutter = reports.objects.summary();
  summary.light = reports.light.summary();
  summary.times = reports.times.summary();
  if (std::string even = even_times_text(playback.source()); !even.empty()) summary.times.push_back(std::move(even));
  summary.calibration = reports.rig.summary();
  summary.has_camera_trouble = reports.rig.has_had_trouble();
  summary.has_lost_color = reports.light.has_lost_color();
  summary.clock_offset = session.time().offset();
  if (bus) {
    summary.published = bus->publisher().counters().published;
    summary.publish_failures = bus->publisher().counters().failures;
    summary.bus = bus->publisher().description();
  }
  if (pictures) {
    pictures->finish(shown_name(playback.recording), truth ? &*truth : nullptr, session.camera_tracker());
    summary.pictures = pictures->written();
  }
  return summary;
}

}  // namespace huetrack::daemon
