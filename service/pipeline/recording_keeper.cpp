#include "pipeline/recording_keeper.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>

#include "calib/model/rig_yaml.h"

namespace huetrack::pipeline {

RecordingKeeper::RecordingKeeper(const config::ServiceConfig& config, RecordingKeeperOptions options)
    : record_(config.record),
      options_(std::move(options)),
      cameras_(config.rig.camera_names()),
      states_(config.targets.size(), object_tracking::TrackState::searching) {
  for (const auto& camera : config.cameras)
    if (camera.send == config::Sent::matches) without_pictures_ = camera.name;
  // With a folder, a recording may be requested at any time.
  if (is_always() || has_pre_roll() || !record_.folder.empty()) make_recorder(config);
}

void RecordingKeeper::begin() {
  if (!is_always()) return;
  if (!options_.record_to.empty()) {
    start(options_.record_to);
    return;
  }
  try {
    start(new_folder(""));
  } catch (const std::exception& error) {  // whatever the disk's error is, tracking goes on
    problem_ = std::string("nothing is being recorded: ") + error.what();
  }
}

void RecordingKeeper::make_recorder(const config::ServiceConfig& config) {
  RecorderOptions recorder;
  recorder.recording.cameras = cameras_;
  if (config.is_calibrated()) recorder.recording.rig_yaml = calib::to_yaml(config.rig);
  recorder.recording.config_yaml = config::to_portable_yaml(config);
  recorder.recording.files = config::files_beside(config);
  for (const std::string& name : cameras_)
    recorder.recording.are_matches.push_back(config::sends_matches(config, name));
  recorder.recording.raw_storage = record_.raw_storage;
  recorder.queue_frames = std::size_t(record_.queue_frames);
  if (has_pre_roll()) {
    // The recorder divides it by all cameras of the rig, some of which may not be in use.
    const double share = double(cameras_.size()) / double(options_.cameras_in_use);
    recorder.pre_roll =
        recordings::PreRollOptions{.length = capture::duration_of(record_.pre_roll_s),
                                   .most_bytes = std::size_t(share * double(record_.pre_roll_mb) * 1e6)};
  }
  recorder_.emplace(std::move(recorder));
}

void RecordingKeeper::start(const std::filesystem::path& folder) {
  recorder_->start(folder);
  folder_ = folder;
  if (options_.is_tracking) changes_.emplace(folder);
  spdlog::info("recording to {}", folder.string());
}

std::filesystem::path RecordingKeeper::new_folder(const std::string& why) const {
  const std::string name = fmt::format("{:%Y%m%dT%H%M%SZ}{}", fmt::gmtime(std::chrono::system_clock::now()), why);
  auto folder = record_.folder / name;
  for (int i = 2; std::filesystem::exists(folder); ++i) folder = record_.folder / fmt::format("{}-{}", name, i);
  return folder;
}

void RecordingKeeper::on_frame(const capture::Frame& frame, capture::Timestamp /*received_at*/) {
  if (recorder_) recorder_->offer(frame);
}

void RecordingKeeper::on_left_out(const LeftOut& left_out) {
  if (!changes_) return;
  const std::scoped_lock lock(mutex_);
  if (left_out.is_of_camera) {
    camera_left_out_.push_back(left_out.at);
  } else {
    changes_to_write_.push_back({left_out.at, {}});
  }
}

void RecordingKeeper::on_set(const TrackedSet& set) {
  for (const auto& estimate : set.estimates) {
    if (estimate.object != 0) {
      if (estimate.is_end) has_lost_ = true;
      continue;
    }
    const auto before = std::exchange(states_[estimate.target], estimate.state);
    if (estimate.state == object_tracking::TrackState::lost && before != estimate.state) has_lost_ = true;
  }
  if (!changes_ || set.reloaded.empty()) return;
  const std::scoped_lock lock(mutex_);
  for (const auto& config : set.reloaded) changes_to_write_.push_back({set.frames.at, config});
}

void RecordingKeeper::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(supervised_);
  if (recorder_) recorder_->take_over(config::to_portable_yaml(config));
}

void RecordingKeeper::supervise() {
  const std::scoped_lock lock(supervised_);
  if (!recorder_) return;
  if (!is_finished_) recorder_->end_when_due();
  if (has_lost_.exchange(false) && record_.on_lost && (has_pre_roll() || is_always())) save("lost");
  write_changes();
}

// Not on the pipeline's threads, which only note the changes.
void RecordingKeeper::write_changes() {
  if (!changes_) return;
  std::vector<Change> changes;
  std::vector<capture::Timestamp> camera_left_out;
  {
    const std::scoped_lock lock(mutex_);
    changes.swap(changes_to_write_);
    camera_left_out.swap(camera_left_out_);
  }
  for (const capture::Timestamp at : camera_left_out) changes_->camera_left_out(at);
  for (const auto& [at, config] : changes) config.empty() ? changes_->left_out(at) : changes_->reloaded(at, config);
}

void RecordingKeeper::save_pre_roll(const std::string& why) {
  const std::scoped_lock lock(supervised_);
  if (!has_pre_roll() && !is_always()) {
    spdlog::warn("there is no pre-roll to save: set record.folder and record.pre_roll_s");
    return;
  }
  if (recorder_) save(why);
}

void RecordingKeeper::save(const std::string& why) {
  if (is_finished_) return;
  try {
    const auto folder = new_folder("-" + why);
    if (recorder_->save_pre_roll(folder, capture::duration_of(record_.after_s))) {
      folder_ = folder;
      problem_.clear();
      spdlog::info("saving the pre-roll to {}", folder.string());
    } else if (why == "signal") {
      spdlog::info("it is already in the current recording: {}", folder_.string());
    }
  } catch (
      const std::exception& error) {  // a full or read-only disk does not end tracking; it is a warning of the status
    problem_ = std::string("the pre-roll was not saved: ") + error.what();
  }
}

Recorder& RecordingKeeper::requested_recorder() {
  if (record_.folder.empty())
    throw std::runtime_error("there is no folder for recordings: set record: {folder: ...} and restart");
  if (is_finished_ || !recorder_) throw std::runtime_error("the service is stopping");
  return *recorder_;
}

std::filesystem::path RecordingKeeper::start_on_request() {
  const std::scoped_lock lock(supervised_);
  Recorder& recorder = requested_recorder();
  if (recorder.is_ending_by_itself()) {
    recorder.go_on();
    spdlog::info("continuing to record to {}, as requested", folder_.string());
  } else {
    start_new(recorder, "", true);
  }
  return folder_;
}

std::filesystem::path RecordingKeeper::stop_on_request() {
  const std::scoped_lock lock(supervised_);
  Recorder& recorder = requested_recorder();
  if (is_always()) throw std::runtime_error("the whole run is recorded: remove record: {always: true} and restart");
  if (!recorder.is_recording()) throw std::runtime_error("nothing is being recorded");
  recorder.stop();
  spdlog::info("recorded to {}", folder_.string());
  return folder_;
}

std::filesystem::path RecordingKeeper::start_anew(const std::string& why) {
  const std::scoped_lock lock(supervised_);
  Recorder& recorder = requested_recorder();
  if (!without_pictures_.empty())
    throw std::runtime_error("camera " + without_pictures_ +
                             " sends no pictures to calibrate with: set send: frames for it and restart");
  start_new(recorder, "-" + why, false);
  return folder_;
}

void RecordingKeeper::start_new(Recorder& recorder, const std::string& why, bool with_pre_roll) {
  if (recorder.is_recording()) throw std::runtime_error("already recording to " + folder_.string());
  const auto folder = new_folder(why);
  recorder.start(folder, with_pre_roll);
  folder_ = folder;
  problem_.clear();
  spdlog::info("recording to {}, as requested", folder.string());
}

std::filesystem::path RecordingKeeper::save_on_request(const std::string& why) {
  const std::scoped_lock lock(supervised_);
  Recorder& recorder = requested_recorder();
  if (recorder.is_recording()) throw std::runtime_error("it is already in the current recording: " + folder_.string());
  if (!has_pre_roll())
    throw std::runtime_error("there is no pre-roll to save: set record: {pre_roll_s: ...} and restart");
  save(why);
  if (!problem_.empty()) throw std::runtime_error(problem_);
  return folder_;
}

void RecordingKeeper::finish(capture::Duration patience) {
  const std::scoped_lock lock(supervised_);
  if (!recorder_) return;
  recorder_->finish(patience);
  is_finished_ = true;
  write_changes();
}

std::vector<std::string> RecordingKeeper::warnings() const {
  const std::scoped_lock lock(supervised_);
  std::vector<std::string> warnings;
  if (!recorder_) return warnings;
  if (!problem_.empty()) warnings.push_back(problem_);
  std::error_code ignored;
  if (recorder_->is_recording() && !std::filesystem::exists(folder_, ignored))
    warnings.push_back(folder_.string() + " was deleted during the recording: restart to record again");
  const RecorderFigures figures = recorder_->figures();
  if (figures.failure) warnings.push_back(*figures.failure);
  if (figures.pre_roll_that_fits)
    warnings.push_back(
        fmt::format("only the last {:.1f} s of the pre-roll's {:.1f} s fit into memory: raise record.pre_roll_mb",
                    capture::seconds(*figures.pre_roll_that_fits), record_.pre_roll_s));
  if (changes_ && !changes_->failure().empty()) warnings.push_back(changes_->failure());
  std::vector<std::string> dropped;
  for (std::size_t c = 0; c < figures.dropped.size(); ++c)
    if (figures.dropped[c] > 0) dropped.push_back(fmt::format("{} {}", cameras_[c], figures.dropped[c]));
  if (!dropped.empty())
    warnings.push_back(
        fmt::format("the disk is too slow, frames are missing in the recording: {}", fmt::join(dropped, ", ")));
  return warnings;
}

std::filesystem::path RecordingKeeper::folder() const {
  const std::scoped_lock lock(supervised_);
  return folder_;
}

bool RecordingKeeper::is_recording() const {
  const std::scoped_lock lock(supervised_);
  return recorder_ && recorder_->is_recording() && !recorder_->figures().failure;
}

bool RecordingKeeper::is_unfinished() const {
  const std::scoped_lock lock(supervised_);
  return recorder_ && recorder_->is_unfinished();
}

RecorderFigures RecordingKeeper::figures() const {
  const std::scoped_lock lock(supervised_);
  return recorder_ ? recorder_->figures() : RecorderFigures{};
}

}  // namespace huetrack::pipeline
