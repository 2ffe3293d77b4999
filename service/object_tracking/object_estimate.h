// What the object tracker says about one target after one frame set. A plain value.
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

// One camera's time as a target's motion tells it; seconds. Row r of H is exposed around
//   stamp - latency + (r / (H - 1) - 1/2) readout.
// The latency of the rig's first camera is held, and all others hang on it: a shift of all of them together moves the
// object along its path and changes no picture.
struct CameraTimingEstimate {
  double latency_s = 0, latency_sigma_s = 0;
  double readout_s = 0, readout_sigma_s = 0;
};

enum class TrackState : std::uint8_t {
  searching,  // never found yet: there is no position
  tracking,   // seen in enough views, position and covariance hold
  coasting,   // seen by nobody, or by too few to fix it: predicted, with growing covariance
  lost,       // coasted too long or too far: there is no position, the search is on
};
std::string_view name(TrackState state);  // "searching", ...

// What a view saw of the target, beside what the other views of the same set say of the same moment: the evidence that
// views agree with one another, or contradict. How far apart the two are, and how far they may be:
//   d = px - project(position),  S = covariance + J position_covariance J',  J = d px / d p_world at position
// d' S^-1 d is chi-square with 2 degrees of freedom where two others or more see it, with 1 where one does.
struct ViewWitness {
  capture::Timestamp at;       // when the row was exposed on which it is seen, with the times that are believed
  Eigen::Vector2d px;          // measured centre, raw pixels
  Eigen::Matrix2d covariance;  // px^2, of all its errors: those that are new in every frame and those that last
  // By the others alone, brought to `at` along the velocity: nothing that this view saw in this set is in it, nor what
  // the motion up to now lets expect, which this view has shaped, too. World frame, metres. A single other view leaves
  // its ray open: position is that point of it which is nearest to the estimate, and along the ray the covariance is as
  // large as the volume, so that d counts across the epipolar line only.
  Eigen::Vector3d position;
  Eigen::Matrix3d position_covariance;
  Eigen::Vector3d velocity;  // m/s, of the estimate: nothing but motion tells it
  int others = 0;            // >= 1; views that position stands on
};

// A region of the target's colour that was looked at in a view: the target, or something like it.
struct SeenRegion {
  int camera = 0;
  capture::Timestamp at{};  // when its row was exposed, by the rig's times and not by what motion has told of them
  Eigen::Vector2d px;       // its centre, raw pixels
  double radius_px = 0;     // of the disc of its area
  double below_middle = 0;  // its row: r / (H - 1) - 1/2
  // Standard deviation of px on each axis, where its outline was fitted: noise, and what lasts; 0: the middle of a
  // region.
  double outline_sigma_px = 0;
  bool is_target = false;  // what the tracker takes for the target; otherwise it is found elsewhere, or in a search
};

// How much of a camera's picture has the target's colour.
struct ColorShare {
  double of_picture = 0;  // 0..1, on a grid, as of some tenths of a second ago
  double of_target = 0;   // 0..1, as much as the target could cover anywhere in the volume
  // Of of_picture: what never moves and is no object. It matches nothing as long as it stays.
  double still = 0;
  // The largest connected patch of that, raw pixels: its middle, and its bounds (u_min v_min u_max v_max).
  Eigen::Vector2d still_px = Eigen::Vector2d::Zero();
  std::array<int, 4> still_box{};
};

// What the outlines of a target have told (observation: huetrack).
struct OutlineFindings {
  std::size_t fitted = 0, not_fitted = 0;  // in views where what is behind the edge was known
  // How large it really is, as far as the rig's distances are right: the mean of the views, its standard deviation, and
  // the least and the largest of them; nullopt: too few have been seen. Blur, and light that darkens towards the edge,
  // make it up to a quarter of a pixel smaller, which is most of the deviation.
  std::optional<double> radius_m = {};
  double radius_sigma_m = 0;
  double least_radius_m = 0, largest_radius_m = 0;
};

struct ViewSupport {
  bool delivered = false;  // this camera gave a frame in this set
  bool in_view = false;    // the estimate projects into its image
  bool seen = false;       // and this view supports the estimate
  Eigen::Vector2f px =
      Eigen::Vector2f::Constant(std::numeric_limits<float>::quiet_NaN());  // the estimate's projection, raw pixels
  float radius_px = 0;                                                     // the target's radius there
  float support = 0;      // 0..1, share of the expected pixels that have the target's colour
  float residual_px = 0;  // distance from the projection to the centre of the colour region; 0 if not seen
  // nullopt: nothing of the object's colour is where it may be expected in this view, or no other view shows it. Also
  // of a view that was left out of this set because it contradicts the others (seen is false then), and of one that is
  // not used (CameraTrust); the others never stand on these.
  std::optional<ViewWitness> witness = {};
  // What this view's contradictions with the others add to its error, as a standard deviation, px: an error that lasts,
  // and that is in the estimate's covariance. 0: they agree as well as they should.
  float doubt_px = 0;
};

struct ObjectEstimate {
  std::size_t target = 0;  // which of the configuration's, where several are tracked; set by whoever tracks them
  // Which of a target's objects, where it has several (TargetOptions::count): from 1 on, each number once. 0: the
  // target itself, which is one object, or of several of which none is known at the moment.
  std::uint32_t object = 0;
  capture::Timestamp at;         // the capture time that position refers to
  std::uint64_t set_number = 0;  // FrameSet::number
  TrackState state = TrackState::searching;
  // World frame, metres. NaN in searching and lost: there is none, and a stale one is never given.
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
  // When each camera's rows are exposed, as this target's motion has told so far, one per camera of the rig; empty with
  // observation: paper.
  std::vector<CameraTimingEstimate> times;

  // Of a target of several objects, the first one of this object, and the last: it is `lost`, and never heard of again.
  bool is_birth = false, is_end = false;

  bool has_position() const { return state == TrackState::tracking || state == TrackState::coasting; }
};

// What an object is called wherever it is told: "ball", or "ball_3" of a target of several.
std::string object_name(std::string_view target, std::uint32_t object);

}  // namespace huetrack::object_tracking
