// Targets, search volume, filter options, and the trust in each camera. Plain values.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "calib/model/rigid3.h"
#include "color/color_model.h"
#include "color/color_window.h"

namespace huetrack::object_tracking {

struct Volume {  // axis-aligned, world frame, metres
  Eigen::Vector3d min{-1, -1, 0};
  Eigen::Vector3d max{1, 1, 2};
};

// Rectangles of a camera's image in which nothing matches: (camera name, rectangles).
using IgnoredRegions = std::vector<std::pair<std::string, std::vector<color::PixelBox>>>;

enum class TargetShape : std::uint8_t {
  ball,       // its outline is fitted where the background is known
  blob,       // not round: the centroid of its colour region is measured
  automatic,  // a ball, until outline fits fail
};

// One target to track.
struct TargetOptions {
  std::string name;                            // unique, not empty; part of the topic's name (idl/topics.h)
  double radius_m = 0.04;                      // > 0; of the ball, or of a ball of about the object's size
  bool is_radius_assumed = false;              // radius_m was not given: it is this default
  TargetShape shape = TargetShape::automatic;  // observation: huetrack only
  // 1..most_count; how many objects of this colour there may be at once. More than 1: observation: huetrack only.
  int count = 1;
  static constexpr int most_count = 16;  // capacity: cost grows with pairs of regions in pairs of views
  bool is_up_to = false;                 // of count: fewer objects are normal
  color::HsiRange color;
  bool is_hue_taught = false;  // learnt from pictures: the unit of its numbers is certain
  std::vector<std::pair<std::string, color::HsiRange>> camera_colors;  // per-camera overrides: (camera name, range)
  bool adapts_color = false;  // the ranges are adapted (color_follower.h; observation: huetrack only)
  IgnoredRegions ignored;
  const color::HsiRange& color_in(std::string_view camera) const;  // its own there, else `color`
  std::vector<std::string> problems() const;
};

enum class Observation : std::uint8_t {
  paper,     // Barrera et al.: eqs. (1)-(6), nothing else
  huetrack,  // ours
};

enum class TimingMode : std::uint8_t {
  learn,  // each camera's latency and readout are estimated; prior: the rig's
  fixed,  // the rig's; 0 where it has none
};

struct ObjectTrackerOptions {
  static constexpr double default_pixel_noise_px = 0.2;
  Observation observation = Observation::huetrack;
  TimingMode timing = TimingMode::learn;  // observation: huetrack
  Volume volume;                          // where targets may be; the particles start uniformly in it
  int particle_count = 200;               // >= 1; time per frame is linear in it
  int max_particle_count = 2000;          // >= particle_count; while searching
  std::uint64_t seed = 1;                 // same seed, same recording, same options => same track, byte for byte
  // --- observation: paper
  double position_noise_m = 0.06;  // > 0; sigma_m of eqs. (1)-(3), metres per frame set
  // --- observation: huetrack
  double acceleration_m_s2 = 8;  // > 0; upper bound of the usual acceleration; the filter adapts below it
  double start_speed_m_s = 3;    // > 0; upper bound of the usual speed: gates a track's first two sets
  double pixel_noise_px =
      default_pixel_noise_px;  // > 0; std. dev. of a colour region's centre in a view; add a poor calibration's error
  // > 0; upper bound of the sigma (largest axis) by measurement noise in `tracking`, else `coasting`. Uncertain timing
  // and poses come on top of that in the covariance.
  double max_tracking_sigma_m = 0.03;
  // > 0; with one camera, the same along its ray as a share of the distance, which is known by the ball's size: to 0.2
  // by its region, to 0.02 to 0.05 by its outline.
  double max_tracking_share_along = 0.25;
  // --- both
  double coast_s = 1.0;            // > 0; coasting longer than this is lost
  double max_coast_sigma_m = 0.2;  // > 0; sigma (largest axis) above which coasting is lost
  std::vector<std::string> problems() const;
};

// Current trust in one camera's calibration, overriding the rig.
struct CameraTrust {
  // false: its sightings are not used. It is still measured where the target is expected, for its LeaveOneOut.
  bool is_used = true;
  // A move of the camera was detected otherwise: its inconsistency so far is explained.
  bool has_moved = false;
  std::optional<calib::Rigid3d> cam_from_world = {};  // replaces the rig's pose; nullopt: the rig's
  // Of that pose: cam_from_world_true = exp(e) * cam_from_world, e = (rotation vector in radians, shift in metres) in
  // the camera's own axes. A bias: included in every position's covariance and never averaged away. Symmetric, positive
  // semidefinite.
  Eigen::Matrix<double, 6, 6> pose_covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

}  // namespace huetrack::object_tracking
