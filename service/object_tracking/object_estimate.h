// The published result for one target after one frame set. Plain values.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::object_tracking {

// One camera's timing as estimated from a target's motion; seconds. Row r of H is exposed around
//   stamp - latency + (r / (H - 1) - 1/2) readout.
// The latency of the rig's first camera is fixed: a common shift moves the object along its path and changes no image.
struct CameraTimingEstimate {
  double latency_s = 0, latency_sigma_s = 0;
  double readout_s = 0, readout_sigma_s = 0;
};

enum class TrackState : std::uint8_t {
  searching,  // never found yet: no position
  tracking,   // seen in enough views
  coasting,   // seen in too few views: predicted, with growing covariance
  lost,       // coasted too long or too far: no position, searching again
};
std::string_view name(TrackState state);  // "searching", ...

// One view's measurement and the leave-one-out prediction by the other views of the same frame set. Residual and its
// covariance:
//   d = px - project(position),  S = covariance + J position_covariance J^T,  J = d px / d p_world at position
// d^T S^-1 d is chi-square with 2 dof where two or more other views see the target, with 1 dof where one does.
struct LeaveOneOut {
  capture::Timestamp at;       // exposure of the row in which it is seen, by the estimated timing
  Eigen::Vector2d px;          // measured centre, raw pixels
  Eigen::Matrix2d covariance;  // px^2, noise and bias
  // From the other views' sightings of this set alone, without the track's prediction, which this view has shaped, too;
  // moved to `at` along the velocity. World frame, metres. With a single other view, the point of its ray nearest to
  // the estimate; the variance along the ray is that of the volume, so that d counts across the epipolar line only.
  Eigen::Vector3d position;
  Eigen::Matrix3d position_covariance;
  Eigen::Vector3d velocity;  // m/s, of the estimate
  int others = 0;            // >= 1; views in `position`
};

// A region of the target's colour in a view: the target, or something like it.
struct SeenRegion {
  int camera = 0;
  capture::Timestamp at{};  // exposure of its row by the rig's timing, not by the estimated one
  Eigen::Vector2d px;       // its centre, raw pixels
  double radius_px = 0;     // of the disc of its area
  double below_middle = 0;  // its row: r / (H - 1) - 1/2
  double sigma_px = 0;      // 1 sigma of px per axis: noise, bias, and what may be hidden
  bool is_target = false;   // associated with the target
};

// How much of a camera's picture has the target's colour.
struct ColorShare {
  double of_picture = 0;  // 0..1, on a grid, some tenths of a second old
  double of_target = 0;   // 0..1, the most that the target can cover anywhere in the volume
  double still = 0;       // 0..1, static clutter, masked
  // Largest connected patch of the clutter, raw pixels: centroid and bounds (u_min v_min u_max v_max).
  Eigen::Vector2d still_px = Eigen::Vector2d::Zero();
  std::array<int, 4> still_box{};
};

// Statistics of a target's outline fits (observation: huetrack).
struct OutlineFindings {
  std::size_t fitted = 0, not_fitted = 0;  // in views with a known background
  // The radius as measured, at the rig's scale: weighted mean of the views, 1 sigma; smallest and largest of all views;
  // nullopt: too few. Blur and limb darkening make it up to 0.25 px smaller, which is most of the sigma.
  std::optional<double> radius_m = {};
  double radius_sigma_m = 0;
  double least_radius_m = 0, largest_radius_m = 0;

  static constexpr double ratio = 1.13;  // of the radius to that by outlines, either way; shade makes 6 % (experiment)
  // Whether they contradict this radius, m. A wrong radius shows in all views alike; what differs between views, a hand
  // or static clutter that passes for a part of the ball, may be in all of them, too. radius_m has a value.
  bool contradict(double radius_m) const;
};

struct ViewSupport {
  bool delivered = false;  // this camera gave a frame in this set
  bool in_view = false;    // the estimate projects into its image
  bool seen = false;       // and detects the target
  Eigen::Vector2f px =
      Eigen::Vector2f::Constant(std::numeric_limits<float>::quiet_NaN());  // the estimate's projection, raw pixels
  float radius_px = 0;                                                     // the target's radius there
  float support = 0;      // 0..1, share of the expected pixels that have the target's colour
  float residual_px = 0;  // distance from the projection to the centre of the colour region; 0 if not seen
  // nullopt: not detected in this view, or in no other one. Present, too, for a view that was rejected in this set as
  // inconsistent (then seen is false) and for one that is not used (CameraTrust); the others' predictions exclude
  // these.
  std::optional<LeaveOneOut> leave_one_out = {};
  // Inflation by inconsistency with the other views, 1 sigma of a bias, included in the covariance. 0: consistent.
  float inflation_px = 0;
};

struct ObjectEstimate {
  std::size_t target = 0;  // index of the configuration; set by the caller
  // Of a target with several objects (TargetOptions::count): its number, from 1 on, never reused. 0: the target itself:
  // it is one object, or none of several is known now.
  std::uint32_t object = 0;
  capture::Timestamp at;         // the capture time that position refers to
  std::uint64_t set_number = 0;  // FrameSet::number
  TrackState state = TrackState::searching;
  // World frame, metres. NaN in searching and lost: a stale position is never published.
  Eigen::Vector3d position = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  Eigen::Vector3d velocity = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());    // m/s
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());  // of position, m^2
  Eigen::Vector3d map_position =
      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());  // the best particle
  int views = 0;                                                            // that see the target
  double confidence = 0;                                                    // 0..1, see ObjectTracker
  int particle_count = 0;
  double effective_sample_size = 0;   // 1..particle_count
  std::vector<ViewSupport> per_view;  // one per camera of the rig
  // Estimated timing, one per camera of the rig; empty with observation: paper.
  std::vector<CameraTimingEstimate> times;

  // Of a target with several objects: the first estimate of this one; the last one, which is `lost`.
  bool is_birth = false, is_end = false;

  bool has_position() const { return state == TrackState::tracking || state == TrackState::coasting; }
};

// As published: "ball", or "ball_3" of a target with several objects.
std::string object_name(std::string_view target, std::uint32_t object);

}  // namespace huetrack::object_tracking
