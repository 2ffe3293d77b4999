#include "pipeline/session.h"

#include <algorithm>
#include <array>
#include <exception>
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "calib/files/config_error.h"
#include "camera_tracking/map_file.h"
#include "camera_tracking/methods/make_camera_tracker.h"

namespace huetrack::pipeline {
namespace {

// Top-level keys that a reload may change.
constexpr std::array<std::string_view, 5> reloadable{"targets", "object_tracking", "log_level", "ignore", "control"};

bool has_same_targets(const config::ServiceConfig& a, const config::ServiceConfig& b) {
  return std::ranges::equal(a.targets, b.targets, {}, &object_tracking::TargetOptions::name,
                            &object_tracking::TargetOptions::name);
}

// The topics of a target depend on `count`.
bool has_same_counts(const config::ServiceConfig& a, const config::ServiceConfig& b) {
  return std::ranges::equal(a.targets, b.targets, {}, &object_tracking::TargetOptions::count,
                            &object_tracking::TargetOptions::count);
}

void take_controls(config::ServiceConfig& config, const config::ServiceConfig& from) {
  for (config::LiveCameraConfig& camera : config.cameras) {
    const auto same = std::ranges::find(from.cameras, camera.name, &config::LiveCameraConfig::name);
    if (same != from.cameras.end()) camera.controls = same->controls;
  }
}

// `config` with the reloadable keys of `fresh`.
config::ServiceConfig merged(config::ServiceConfig config, const config::ServiceConfig& fresh) {
  config.targets = fresh.targets;
  config.object_tracking = fresh.object_tracking;
  config.log_level = fresh.log_level;
  config.ignored = fresh.ignored;
  config.control = fresh.control;
  take_controls(config, fresh);
  return config;
}

// The tolerance is fixed for the run because the track depends on it.
config::ServiceConfig with_tolerance(config::ServiceConfig config, const std::vector<SessionCamera>& cameras) {
  std::vector<capture::Duration> periods;
  for (const auto& camera : cameras) periods.push_back(camera.period);
  if (!config.set_tolerance_s) config.set_tolerance_s = capture::seconds(capture::suggested_tolerance(periods));
  return config;
}

}  // namespace

Session::Session(config::ServiceConfig config, SessionSources sources, SessionOptions options)
    : cameras_(std::move(sources.cameras)),
      is_tracking_(options.is_tracking),
      tolerance_is_given_(config.set_tolerance_s.has_value()),
      save_map_(config.camera_tracking.save_map),
      config_(with_tolerance(std::move(config), cameras_())),
      rig_(config_.rig),
      pipeline_(rig_, std::move(sources.sources), trackers(), pipeline_options(options, sources.is_ascending)) {
  repeat(options.repeats.reloads);
  watch_calibration();
  if (!is_tracking_ || config_.camera_tracking.camera.empty()) return;
  if (!save_map_.empty()) camera_tracking::refuse_other_than_map(save_map_);  // now, not after the run
  const int camera = rig_.index_of(config_.camera_tracking.camera).value();
  pipeline_.track_camera(camera, camera_methods::make_camera_tracker(rig_.cameras[std::size_t(camera)],
                                                                     config::tracker_options(config_.camera_tracking)));
}

void Session::watch_calibration() {
  if (!is_tracking_ || config_.targets.empty()) return;
  std::vector<bool> still;
  for (const auto& camera : rig_.cameras) still.push_back(camera.name != config_.camera_tracking.camera);
  pipeline_.watch_calibration(
      CalibrationWatch(rig_, config_.object_tracking.volume, config_.calibration, std::move(still)));
  pipeline_.watch_mistakes(MistakeWatch(rig_, config_.targets));
}

object_trackers::ObjectTracker Session::tracker_of(const config::ServiceConfig& config, std::size_t target) const {
  object_trackers::ObjectTracker tracker(rig_, config.targets[target], config.object_tracking);
  // Here, because each colour table would delay the tracking thread by about 5 ms.
  for (const auto& camera : cameras_())
    if (camera.pixels) tracker.expect(camera.camera, camera.pixels->format, camera.pixels->range);
  return tracker;
}

std::vector<object_trackers::ObjectTracker> Session::trackers() const {
  std::vector<object_trackers::ObjectTracker> all;
  for (std::size_t t = 0; is_tracking_ && t < config_.targets.size(); ++t) all.push_back(tracker_of(config_, t));
  return all;
}

PipelineOptions Session::pipeline_options(const SessionOptions& options, bool is_ascending) const {
  PipelineOptions pipeline;
  pipeline.frame_sets.camera_count = int(rig_.cameras.size());
  pipeline.frame_sets.cameras_in_use = int(cameras_().size());
  pipeline.frame_sets.tolerance = capture::duration_of(*config_.set_tolerance_s);
  pipeline.frame_sets.ascending_input = is_ascending;
  pipeline.when_full = options.when_full;
  pipeline.threads = options.threads.value_or(config_.threads);
  pipeline.left_out = options.repeats.left_out;
  pipeline.camera_left_out = options.repeats.camera_left_out;
  pipeline.pictures_every = options.pictures_every;
  return pipeline;
}

void Session::add(Output& output) {
  outputs_.push_back(&output);
  pipeline_.add(output);
}

void Session::run(std::stop_token stop) {
  std::exception_ptr error;
  const auto attempt = [&error](auto&& step) {
    try {
      step();
    } catch (...) {  // the first is rethrown below
      if (!error) error = std::current_exception();
    }
  };
  attempt([&] { pipeline_.run(std::move(stop)); });
  for (Output* output : outputs_) attempt([&] { output->flush(); });
  if (error) std::rethrow_exception(error);
}

void Session::save_camera_map() const {
  if (const auto* tracker = camera_tracker(); tracker != nullptr && !save_map_.empty())
    save_map(*tracker, pipeline_.tracked_camera(), save_map_);
}

Pipeline::Replacement Session::replacement(const std::vector<std::size_t>& targets,
                                           const config::ServiceConfig& after) const {
  Pipeline::Replacement replacement;
  if (!is_tracking_) return replacement;  // no trackers to replace
  for (const auto t : targets) replacement.trackers.push_back({t, after.targets[t], tracker_of(after, t)});
  return replacement;
}

void Session::repeat(const std::vector<RecordedReload>& reloads) {
  config::ServiceConfig before = config_;
  for (const auto& reload : reloads) {
    const config::ServiceConfig fresh = config::load_service_config(reload.config);
    if (!has_same_targets(fresh, before))
      throw files::ConfigError(reload.config, 0,
                               "has other targets than the recording's huetrackd.yaml: it cannot be replayed");
    config::ServiceConfig after = merged(before, fresh);
    Pipeline::Replacement next = replacement(config::targets_that_differ(before, after), after);
    next.from = reload.at;
    pipeline_.replace_trackers(std::move(next));
    before = repeated_.emplace_back(std::move(after));
  }
}

Session::TakenOver Session::take_over(const config::ServiceConfig& fresh) {
  if (!has_same_targets(fresh, config_))
    throw std::runtime_error("targets were added, removed, renamed or reordered: restart to apply");
  if (!has_same_counts(fresh, config_)) throw std::runtime_error("a target's count was changed: restart to apply");
  TakenOver result;
  config::ServiceConfig compared = fresh;
  take_controls(compared, config_);
  if (!compared.set_tolerance_s && !tolerance_is_given_) compared.set_tolerance_s = config_.set_tolerance_s;
  for (const auto& key : config::differing_keys(config_, compared))
    if (std::ranges::find(reloadable, key) == reloadable.end()) result.waiting.push_back(key);

  config::ServiceConfig after = merged(config_, fresh);
  std::vector<std::size_t> differing = config::targets_that_differ(config_, after);
  for (const auto& before : repeated_)
    std::ranges::copy(config::targets_that_differ(before, after), std::back_inserter(differing));
  std::ranges::sort(differing);
  differing.erase(std::unique(differing.begin(), differing.end()), differing.end());
  Pipeline::Replacement next = replacement(differing, after);
  for (const auto& next_tracker : next.trackers) result.searched_anew.push_back(next_tracker.options.name);
  if (!next.trackers.empty()) next.config = config::to_portable_yaml(after);
  config_ = std::move(after);  // nothing throws from here on
  for (Output* output : outputs_) output->on_config(config_);
  if (!next.trackers.empty()) pipeline_.replace_trackers(std::move(next));
  return result;
}

}  // namespace huetrack::pipeline
