#include "daemon/opened_recording.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <thread>
#include <utility>

#include "calib/files/config_error.h"
#include "calib/yaml/yaml_reader.h"
#include "daemon/replay.h"
#include "pipeline/recorded_cameras.h"

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;

// Of the cameras: the shortest known one, else that of 30 frames/s.
capture::Duration shortest_period(const recordings::ReplaySource& source) {
  std::optional<capture::Duration> shortest;
  for (const auto& camera : source.cameras())
    if (camera.frame_period > 0ns) shortest = std::min(shortest.value_or(camera.frame_period), camera.frame_period);
  return shortest.value_or(33ms);
}

// Files with times on the recording's clock, which jumps would make ambiguous.
std::string reason_against_jumps(const ReplayCommand& command) {
  if (command.tracks.empty() && command.poses.empty() && command.truth.empty()) return {};
  return "this replay writes or compares times on the recording's clock (--tracks, --poses, --truth): it cannot jump";
}

bool is_configuration(const std::string& file) {
  try {
    return yaml::YamlReader::file(file).has("rig");
  } catch (const files::ConfigError&) {
    return false;
  }
}

}  // namespace

config::ServiceConfig load_or_name_swap(const ReplayCommand& command) {
  try {
    return config::load_service_config(command.config);
  } catch (const files::ConfigError&) {
    if (is_configuration(command.config) || command.recording.size() != 1 ||
        !is_configuration(command.recording.front()))
      throw;
    throw std::runtime_error(
        fmt::format("{} is a configuration, and {} is none: write huetrackd replay CONFIG RECORDING",
                    command.recording.front(), command.config.string()));
  }
}

std::optional<capture::Duration> length_of(const recordings::ReplaySource& source) {
  const auto first = source.first_at();
  if (!first) return std::nullopt;
  capture::Timestamp last = *first;
  for (const auto& camera : source.cameras()) {
    if (!camera.expected_frames) return std::nullopt;
    if (camera.first_at)
      last = std::max(last,
                      *camera.first_at + std::max<std::int64_t>(0, *camera.expected_frames - 1) * camera.frame_period);
  }
  return last - *first;
}

recordings::Recording without_frames_before(recordings::Recording recording, capture::Timestamp from) {
  for (recordings::RecordedCamera& camera : recording.cameras) {
    const capture::Timestamp at = from - camera.offset;
    std::int64_t first = 0;
    if (!camera.received.empty()) {
      const auto row =
          std::ranges::lower_bound(camera.timestamps, at, {}, &std::pair<std::int64_t, capture::Timestamp>::second);
      if (row != camera.timestamps.end()) first = row->first;
    } else if (camera.fps > 0) {
      first = std::int64_t(std::floor(capture::seconds(at.time_since_epoch()) * camera.fps));
    }
    const std::int64_t skipped = (first - camera.first_frame) / camera.every;  // selected frames
    if (skipped > 0) camera.first_frame += skipped * camera.every;
  }
  return recording;
}

capture::Timestamp first_whole_set(const recordings::ReplaySource& source, capture::Duration set_span) {
  const capture::Timestamp first = source.first_at().value_or(capture::Timestamp{});
  capture::Timestamp last = first;
  for (const auto& camera : source.cameras())
    if (camera.first_at && *camera.first_at - first <= 1s) last = std::max(last, *camera.first_at);
  return last + set_span;
}

OpenedRecording open_recording(const config::ServiceConfig& config, const ReplayCommand& command) {
  OpenedRecording opened{.recording = recordings::read_recording(command.recording)};
  const std::vector<std::string> names = config.rig.camera_names();
  const recordings::ReplayOptions options{
      .decoder_threads = std::max(1, int(std::thread::hardware_concurrency())),
      .timing = config::frame_timing(config.rig),
      .takes_matches = true,
      .on_contradicted_times = [found = opened.contradicted_times](const std::string& text) {
        const std::scoped_lock lock(found->mutex);
        if (found->texts.insert(text).second) spdlog::warn("{}", text);  // once of loops
      }};
  auto source = std::make_unique<recordings::ReplaySource>(opened.recording, names, options);
  const auto current = std::make_shared<recordings::ReplaySource*>(source.get());
  opened.pass = current;
  opened.sources = pipeline::recorded_cameras(opened.recording, *source);
  opened.first_at = source->first_at().value_or(capture::Timestamp{});
  const auto length = length_of(*source);
  LoopingSourceOptions looping{
      .cameras = names.size(), .loops = command.loops, .step = shortest_period(*source), .open = {}};
  looping.open = [recording = opened.recording, names, options, current](capture::Timestamp from) {
    std::unique_ptr<recordings::ReplaySource> again;
    try {
      again = std::make_unique<recordings::ReplaySource>(without_frames_before(recording, from), names, options);
    } catch (const files::ConfigError&) {  // a camera ends before
      again = std::make_unique<recordings::ReplaySource>(recording, names, options);
    }
    again->take_warnings();  // as at the first opening
    *current = again.get();
    return again;
  };
  const capture::Timestamp first_at = opened.first_at;
  auto looped = std::make_unique<LoopingSource>(std::move(source), first_at, std::move(looping));
  const bool is_controlled = config.dds.enabled && !command.no_dds && config.control.allow_teach;
  if (!is_controlled && command.speed <= 0) {
    opened.sources.sources.push_back(std::move(looped));
    return opened;
  }
  auto played = std::make_unique<PlayedSource>(
      std::move(looped),
      PlayedSourceOptions{.cameras = names.size(),
                          .speed = command.speed,
                          .length_s = length ? std::optional(capture::seconds(*length)) : std::nullopt,
                          .loops = command.loops,
                          .why_no_seek = reason_against_jumps(command),
                          .set_span = config.set_tolerance_s ? capture::duration_of(*config.set_tolerance_s)
                                                             : shortest_period(**current)});
  opened.played = played.get();
  opened.sources.sources.push_back(std::move(played));
  return opened;
}

}  // namespace huetrack::daemon
