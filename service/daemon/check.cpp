#include "daemon/check.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <iterator>
#include <limits>
#include <set>
#include <vector>

#include "calib/files/config_error.h"
#include "calib/files/text_file.h"
#include "color/color_name.h"
#include "config/service_config.h"
#include "hosts/camera_host.h"
#include "pipeline/session.h"
#include "publish/estimate_publisher.h"
#include "reports/search_advice.h"
#include "tracks/objects_comparison.h"
#include "tracks/track_csv.h"
#include "tracks/truth_comparison.h"

namespace huetrack::daemon {
namespace {

// In a terminal, after a swatch of it.
void print_hue(const object_tracking::TargetOptions& target) {
  const color::Rgb middle = color::middle_of(target.color);
  const auto byte = [](double share) { return int(std::lround(255 * share)); };
  std::printf("# %s: ", target.name.c_str());
  if (isatty(STDOUT_FILENO) != 0)
    std::printf("\033[48;2;%d;%d;%dm    \033[0m ", byte(middle.r), byte(middle.g), byte(middle.b));
  const std::string opencv = reports::other_unit_text(target);
  std::printf("%s%s%s\n", color::hue_text(target.color).c_str(), opencv.empty() ? "" : "; ", opencv.c_str());
}

// Comments on the targets, after the YAML: missing values, and names of hues.
void print_targets(const config::ServiceConfig& config) {
  for (const auto& target : config.targets) {
    if (config::is_taught(target)) {
      print_hue(target);
    } else {
      std::printf("# %s: it has no colour yet: %s\n", target.name.c_str(),
                  config::teach_advice(config, target).c_str());
    }
    if (target.is_radius_assumed)
      std::printf("# %s: no radius is set: %g m is assumed\n", target.name.c_str(), target.radius_m);
  }
}

// Comments on rig and volume.
void print_room(const config::ServiceConfig& config) {
  const std::string age =
      config.rig.made.text(std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now()));
  std::printf("# the rig: %s; %s\n", age.empty() ? "of unknown age" : age.c_str(),
              config.rig.uncertainty ? "with its uncertainty, which is in every position's covariance"
                                     : "without uncertainty: its cameras are taken as exact");
  if (config.targets.empty()) return;
  const auto coverage = config::volume_coverage(config.rig, config.object_tracking.volume);
  std::printf("# of the volume are seen: by two or more cameras %.0f %%, by one or more %.0f %%", 100 * coverage.by_two,
              100 * coverage.by_one);
  for (std::size_t c = 0; c < config.rig.cameras.size(); ++c) {
    std::printf(", by %s %.0f %%", config.rig.cameras[c].name.c_str(), 100 * coverage.per_camera[c]);
  }
  std::printf("\n");
}

// Checks of replay and run at their start: trackers and map. throws, naming the file
void require_session(const config::ServiceConfig& config) {
  try {
    const pipeline::Session session(
        config, {.sources = {}, .cameras = [] { return std::vector<pipeline::SessionCamera>(); }}, {});
  } catch (const files::ConfigError&) {
    throw;
  } catch (const std::exception& error) {
    throw files::ConfigError(config.file, 0, error.what());
  }
}

void warn_of(const std::filesystem::path& file, const std::vector<std::string>& warnings) {
  for (const auto& warning : warnings) spdlog::warn("{}: {}", file.string(), warning);
}

// For a camera host.
void check_host(const std::filesystem::path& file) {
  const config::CaptureConfig config = config::load_capture_config(file);
  const std::string host = config.host.empty() ? hosts::name_of_this_machine() : config.host;
  std::vector<std::string> cameras;
  for (const auto& camera : config.cameras) cameras.push_back(camera.name);
  hosts::require_host_names(host, cameras);
  warn_of(config.file, publish::EstimatePublisher::check(config.dds.publisher));
  std::printf("# %s, resolved: the cameras of the host %s, for huetrackd capture\n%s",
              files::printable(config.file.string(), files::longest_message).c_str(), host.c_str(),
              config::to_yaml(config).c_str());
}

}  // namespace

void check(const std::filesystem::path& file) {
  if (config::is_capture_config(file)) return check_host(file);
  const config::ServiceConfig config = config::load_service_config(file);
  auto warnings = config::warnings_of(config);
  if (config.dds.enabled)
    std::ranges::copy(publish::EstimatePublisher::check(config.dds.publisher), std::back_inserter(warnings));
  if (config.is_calibrated()) require_session(config);
  warn_of(config.file, warnings);
  std::printf("# %s, resolved; identity %s\n%s", files::printable(config.file.string(), files::longest_message).c_str(),
              config::config_identity(config).c_str(), config::to_yaml_with_origins(config).c_str());
  print_targets(config);
  if (!config.rig.cameras.empty() && config.is_calibrated()) print_room(config);
  // Repeated at the end, because nothing can be tracked with it.
  for (const std::string& mistake : {config::unit_mistake(config), config::coverage_mistake(config)}) {
    if (mistake.empty()) continue;
    std::fflush(stdout);
    throw files::ConfigError(config.file, 0, mistake);
  }
}

namespace {

using Tracks = std::map<std::string, std::vector<object_tracking::ObjectEstimate>>;

bool is_track(const std::filesystem::path& file) {
  try {
    return !tracks::read_track_csv(file).empty();
  } catch (const files::ConfigError&) {
    return false;
  }
}

Tracks tracks_or_name_swap(const CompareCommand& command) {
  try {
    return tracks::read_track_csv(command.tracks);
  } catch (const files::ConfigError&) {
    if (!std::filesystem::exists(command.tracks) || !is_track(command.truth)) throw;
    throw std::runtime_error(command.truth.string() + " is a track, and " + command.tracks.string() +
                             " is none: write huetrackd compare TRACK TRUTH");
  }
}

// Takes the tracks of targets with several objects out of `tracks`, and prints their figures. Not if the truth has
// balls of their own names.
void compare_objects(Tracks& tracks, const tracks::Truth& truth) {
  std::set<std::string> targets, several;
  for (const auto& [name, _] : tracks) {
    const std::string target = truth::target_of(name);
    targets.insert(target);
    if (target != name && !truth.targets().contains(name)) several.insert(target);
  }
  for (const std::string& target : several) {
    std::vector<std::string> balls = truth.objects_of(target, targets.size() == 1);
    if (balls.empty()) continue;
    std::map<std::uint64_t, std::vector<object_tracking::ObjectEstimate>> sets;
    std::uint32_t number = 0;
    std::erase_if(tracks, [&](const auto& track) {
      if (truth::target_of(track.first) != target) return false;
      for (const object_tracking::ObjectEstimate& estimate : track.second)
        sets[estimate.set_number].emplace_back(estimate).object = number;
      ++number;
      return true;
    });
    const Eigen::Vector3d far = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
    tracks::ObjectsComparison comparison(truth, std::move(balls), {-far, far});
    for (const auto& [_, estimates] : sets) comparison.add(estimates.front().at, estimates);
    const tracks::ObjectsFigures figures = comparison.figures();
    std::printf("%s: %zu frame sets; %s\n", target.c_str(), sets.size(), tracks::to_text(figures).c_str());
    if (figures.found < figures.ball_sets)
      std::printf("%s: balls outside the volume count here: huetrackd replay --truth leaves them out\n",
                  target.c_str());
  }
}

// Aligns all tracks by one transform, if asked, and prints it.
void align(Tracks& tracks, const tracks::Truth& truth, const CompareCommand& command) {
  if (command.align == truth::Freedom::none && !command.align_time) return;
  std::vector<truth::EstimatedSample> samples;
  for (const auto& [_, track] : tracks) {
    truth::EstimatedSample& sample = samples.emplace_back();
    for (const object_tracking::ObjectEstimate& estimate : track)
      if (estimate.state == object_tracking::TrackState::tracking)
        sample.add({estimate.at, estimate.position, estimate.covariance});
  }
  std::vector<truth::TargetTrack> targets;
  for (const auto& [target, _] : tracks) targets.push_back({target, samples[targets.size()].kept()});
  const auto alignment = truth::align(truth, targets, command.align, command.align_time);
  if (!alignment)
    throw std::runtime_error("fewer than 30 positions in state tracking have a truth: nothing can be aligned");
  std::printf("aligned: %s\n", alignment->text(command.clock_offset_s).c_str());
  for (auto& [_, track] : tracks)
    for (object_tracking::ObjectEstimate& estimate : track) {
      const truth::Estimated aligned = alignment->aligned({estimate.at, estimate.position, estimate.covariance});
      estimate.at = aligned.at;
      estimate.position = aligned.position;
      estimate.covariance = aligned.covariance;
    }
}

// throws std::runtime_error: no estimate of a target is at a time of its truth.
void require_common_times(const Tracks& tracks, const tracks::Truth& truth, const std::vector<std::string>& targets,
                          const CompareCommand& command) {
  capture::Timestamp first = capture::Timestamp::max(), last = capture::Timestamp::min();
  for (const auto& [target, track] : tracks)
    for (const object_tracking::ObjectEstimate& estimate : track) {
      if (truth.position(target, estimate.at)) return;
      first = std::min(first, estimate.at), last = std::max(last, estimate.at);
    }
  throw std::runtime_error(truth.apart_text(targets, first, last, command.clock_offset_s != 0));
}

}  // namespace

void compare(const CompareCommand& command) {
  Tracks tracks = tracks_or_name_swap(command);
  tracks::Truth truth = tracks::Truth::read(command.truth);
  for (auto& [_, track] : tracks)
    for (object_tracking::ObjectEstimate& estimate : track) estimate.at -= capture::duration_of(command.clock_offset_s);
  compare_objects(tracks, truth);
  if (tracks.empty()) {
    if (command.align != truth::Freedom::none || command.align_time)
      spdlog::warn("several objects were compared without alignment: --align and --align-time are for single ones");
    return;
  }
  std::vector<std::string> targets;
  for (const auto& [target, _] : tracks) targets.push_back(target);
  for (const auto& sentence : truth.match(targets)) spdlog::warn("{}: {}", command.truth.string(), sentence);
  if (std::ranges::none_of(targets, [&](const std::string& name) { return truth.targets().contains(name); }))
    throw std::runtime_error(command.truth.string() + ": has none of the targets of " + command.tracks.string());
  require_common_times(tracks, truth, targets, command);
  align(tracks, truth, command);
  for (const auto& [target, track] : tracks) {
    if (!truth.targets().contains(target)) continue;
    tracks::TruthComparison comparison(truth, target);
    Eigen::AlignedBox3d room;
    for (const object_tracking::ObjectEstimate& estimate : track) {
      comparison.add(estimate);
      if (estimate.position.allFinite()) room.extend(estimate.position);
    }
    if (!room.isEmpty())
      for (const auto& sentence : truth.contradictions(track.front().at, track.back().at, room))
        spdlog::warn("{}: {}", command.truth.string(), sentence);
    std::printf("%s: %zu samples; %s\n", target.c_str(), track.size(), tracks::to_text(comparison.figures()).c_str());
    if (const auto explanation = comparison.explanation())
      std::printf("%s: %s\n", target.c_str(),
                  truth::to_text(*explanation, {command.align, command.align_time, command.clock_offset_s}).c_str());
  }
}

}  // namespace huetrack::daemon
