// What the tests publish, and so what every subscriber, of whatever vendor, must see: no two fields hold the same
// value.
#pragma once

#include <unistd.h>

#include <array>
#include <chrono>

#include "camera_tracking/camera_estimate.h"
#include "capture/frames/frame.h"
#include "object_tracking/object_estimate.h"
#include "publish/estimate_publisher.h"
#include "publish/service_status.h"
#include "publish/test_domain.h"

namespace huetrack::publish {

inline constexpr std::array states{object_tracking::TrackState::searching, object_tracking::TrackState::tracking,
                                   object_tracking::TrackState::coasting, object_tracking::TrackState::lost};

inline EstimatePublisherOptions known_options(int domain) {
  EstimatePublisherOptions options;
  options.domain = domain;
  options.targets = {"ball", "wand"};
  options.tracked_camera = "hand";
  options.cameras = {"left", "rechts_\xC3\xBC"};  // a name in UTF-8
  return options;
}

inline capture::Timestamp captured_at(object_tracking::TrackState state) {
  return capture::Timestamp(
      std::chrono::nanoseconds(1'700'000'000'123'456'789 + 100'000'000 * static_cast<int>(state)));
}
inline capture::Timestamp received_at(object_tracking::TrackState state) {
  return captured_at(state) + std::chrono::milliseconds(7);
}

// Even where there is no position the numbers are set: a publisher must not let them out.
inline object_tracking::ObjectEstimate known_estimate(object_tracking::TrackState state) {
  const int n = static_cast<int>(state);
  object_tracking::ObjectEstimate e;
  e.at = captured_at(state);
  e.set_number = 1000 + static_cast<unsigned>(n);
  e.state = state;
  e.position = {0.125 + n, -1.5, 2.1};
  e.velocity = {0.25, -0.3, 9.81};
  e.covariance << 1e-6, 2e-7, 3e-7, 2e-7, 4e-6, 5e-7, 3e-7, 5e-7, 9e-6;
  e.map_position = {0.126, -1.51, 2.11};
  e.views = 2;
  e.confidence = 0.875;
  e.particle_count = 200 + n;
  e.effective_sample_size = 123.5;
  e.per_view.resize(2);
  e.per_view[0] = {true, true, true, {100.25F, 50.5F}, 12.5F, 0.75F, 0.375F};
  e.per_view[1] = {true, false, false, {-3.5F, 7.25F}, 11.5F, 0.0625F, 0.0F};
  return e;
}

// Of the target "wand", which is up to three objects: one that has ended, and one that is new.
inline constexpr int known_count = 3;
inline std::vector<object_tracking::ObjectEstimate> known_objects() {
  std::vector<object_tracking::ObjectEstimate> all{known_estimate(object_tracking::TrackState::lost),
                                                   known_estimate(object_tracking::TrackState::tracking)};
  all[0].object = 2, all[0].is_end = true, all[0].views = 0, all[0].confidence = 0;
  all[1].object = 5, all[1].is_birth = true;
  for (auto& e : all) e.set_number = 3000;
  return all;
}

// States go by number as a target's do.
inline constexpr std::array camera_states{camera_tracking::PoseState::searching, camera_tracking::PoseState::tracking,
                                          camera_tracking::PoseState::coasting, camera_tracking::PoseState::lost};

inline camera_tracking::CameraEstimate known_pose(camera_tracking::PoseState state) {
  const int n = static_cast<int>(state);
  camera_tracking::CameraEstimate e;
  e.at = capture::Timestamp(std::chrono::nanoseconds(1'700'000'010'023'456'789 + 100'000'000 * n));
  e.frame_number = 2000 + static_cast<unsigned>(n);
  e.state = state;
  e.world_from_camera = {Eigen::Quaterniond(0.5, -0.1, 0.7, 0.5), {0.5 + n, 1.25, -2.75}};
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      e.covariance(row, column) = 1e-4 * (1 + row + column) + (row == column ? 0.01 : 0);
  e.features_in_view = 41;
  e.features_matched = 37;
  e.map_points = 123;
  e.confidence = 0.8125;
  e.particle_count = 300 + n;
  e.effective_sample_size = 77.5;
  return e;
}

inline ServiceStatus known_status() {
  ServiceStatus s;
  s.at = capture::Timestamp(std::chrono::nanoseconds(1'700'000'001'000'000'001));
  s.program_version = "1.2.3";
  s.mode = "replay";
  s.config_file = "/etc/huetrack/huetrackd.yaml";
  s.config_identity = "c0ffee";
  s.rig_identity = "decade";
  s.rig_history = "calibrated 3 days ago";
  s.clock_offset_s = 12.5;
  s.set_rate_hz = 29.75;
  s.sets = 101;
  s.incomplete_sets = 102;
  s.late_frames = 103;
  s.dropped_sets = 104;
  s.cameras = {
      {"left", CameraStatus::Health::delivering, "", 201, 202, 203, 0, 30.5, 0.03125},
      {"rechts_\xC3\xBC", CameraStatus::Health::absent, "unplugged: plug it in", 301, 302, 303, 0, 0.5, 17.25}};
  s.targets = {"ball", "wand"};
  s.warnings = {"the light is low", "rechts is absent"};
  return s;
}

inline std::vector<object_tracking::CameraTimingEstimate> known_times() {
  return {{.latency_s = 0.0265, .latency_sigma_s = 0, .readout_s = 0.025, .readout_sigma_s = 0.0012},
          {.latency_s = 0.0125, .latency_sigma_s = 0.0003, .readout_s = -0.03, .readout_sigma_s = 0.0014}};
}

}  // namespace huetrack::publish
