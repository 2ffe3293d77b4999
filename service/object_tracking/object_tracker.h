// WHERE IS THE OBJECT: still, calibrated cameras; the target's position in the world.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/model/rigid3.h"
#include "capture/frame.h"
#include "color/color_model.h"
#include "color/color_window.h"
#include "object_tracking/color_watch.h"
#include "object_tracking/object_estimate.h"

namespace huetrack::object_tracking {

struct Volume {  // axis-aligned, world frame, metres
  Eigen::Vector3d min{-1, -1, 0};
  Eigen::Vector3d max{1, 1, 2};
};

// Rectangles of a camera's image in which nothing matches: (camera name, rectangles).
using IgnoredRegions = std::vector<std::pair<std::string, std::vector<color::PixelBox>>>;

enum class TargetShape : std::uint8_t {
  ball,       // its outline is fitted wherever what is behind it is known
  blob,       // not round: the centre of its colour's region counts
  automatic,  // a ball, until its outlines say that it is none
};

// One target to track.
struct TargetOptions {
  std::string name;        // unique, not empty; where it is published, it is part of a topic's name (idl/topics.h)
  double radius_m = 0.04;  // > 0; of the ball, or of a ball of about the object's size
  TargetShape shape = TargetShape::automatic;  // observation: huetrack only
  // 1..most_count; how many objects of this colour there may be at once. More than 1: observation: huetrack only.
  int count = 1;
  static constexpr int most_count = 16;  // pairs of regions in pairs of views are gone through: as measured up to here
  bool is_up_to = false;                 // of a count: there may be fewer of them for long, and that is as it should be
  color::HsiRange color;
  std::vector<std::pair<std::string, color::HsiRange>> camera_colors;  // per-camera overrides: (camera name, range)
  bool adapts_color = false;  // the ranges follow the object's colour (color_follower.h; observation: huetrack only)
  IgnoredRegions ignored;
  const color::HsiRange& color_in(std::string_view camera) const;  // its own there, else `color`
  std::vector<std::string> problems() const;
};

enum class Observation : std::uint8_t {
  paper,     // Barrera et al.: eqs. (1)-(6), nothing else
  huetrack,  // ours
};

enum class TimingMode : std::uint8_t {
  learn,  // each camera's latency and readout follow from the motion, from what the rig says of them or from nothing
  fixed,  // the rig's hold; 0 where it has none
};

struct ObjectTrackerOptions {
  Observation observation = Observation::huetrack;
  TimingMode timing = TimingMode::learn;  // observation: huetrack
  Volume volume;                          // where targets may be; the particles start uniformly in it
  int particle_count = 200;               // >= 1; time per frame is linear in it
  int max_particle_count = 2000;          // >= particle_count; while searching
  std::uint64_t seed = 1;                 // same seed, same recording, same options => same track, byte for byte
  // --- observation: paper
  double position_noise_m = 0.06;  // > 0; sigma_m of eqs. (1)-(3), metres per frame set
  // --- observation: huetrack
  double acceleration_m_s2 = 8;  // > 0; the hardest usual acceleration; the filter finds what is needed below it
  double start_speed_m_s = 3;    // > 0; the highest usual speed: how far an object may be between two sets of a lock
  double pixel_noise_px = 0.2;   // > 0; std. dev. of a colour region's centre in a view; add a poor calibration's error
  double max_tracking_sigma_m = 0.03;  // > 0; a position less sure than this (largest axis) is coasting, not tracking
  // --- both
  double coast_s = 1.0;            // > 0; coasting longer than this is lost
  double max_coast_sigma_m = 0.2;  // > 0; coasting less surely than this (largest axis) is lost
  std::vector<std::string> problems() const;
};

// What is held of one camera's calibration at the moment, beside what the rig says.
struct CameraTrust {
  // false: what this camera shows moves no estimate and starts none. It is still looked at where the target is
  // expected, for its ViewWitness.
  bool is_used = true;
  std::optional<calib::Rigid3d> cam_from_world = {};  // its pose in place of the rig's; nullopt: the rig's
  // Of that pose: cam_from_world_true = exp(e) * cam_from_world, e = (rotation vector in radians, shift in metres) in
  // the camera's own axes. An error that lasts: it is in every position's covariance, and no number of frames averages
  // it away. Symmetric, positive semidefinite.
  Eigen::Matrix<double, 6, 6> pose_covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

// What searching has seen in the sets in which it found nothing, since the target was last found (observation:
// huetrack).
struct SearchFindings {
  std::size_t sets = 0;
  std::vector<std::size_t> sets_with_color;  // per camera of the rig: sets in which it showed a region of the colour
  std::optional<double> radius_m;            // that the regions of two views agree on, if they do; > 0
  // Something moves through the volume as the target would, of twice the hue: hue_deg was given in OpenCV's units, of
  // which there are 180.
  bool is_found_at_twice_the_hue = false;
  // What a user should try, one sentence; empty when nothing was searched. `cameras`: their names, in the order of the
  // rig.
  std::string advice(const TargetOptions& target, const std::vector<std::string>& cameras) const;
};

// What the outlines of a target have told (observation: huetrack).
struct OutlineFindings {
  std::size_t fitted = 0, not_fitted = 0;  // in views where what is behind the edge was known
  bool is_blob = false;                    // so that they are not looked at any more: shape: automatic
  // How large it really is, as far as the rig's distances are right; nullopt: too few have been seen.
  std::optional<double> radius_m = {}, radius_sigma_m = {};
};

// thread-compatible; one per target; the pipeline's tracking threads own them. Never throws after
// construction, but for trust().
class ObjectTracker {
 public:
  // Copies what it needs of the rig. throws std::invalid_argument, naming the problems.
  ObjectTracker(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options);
  ~ObjectTracker();
  ObjectTracker(ObjectTracker&&) noexcept;
  ObjectTracker& operator=(ObjectTracker&&) noexcept;

  // The ranges of colour that are looked for in this camera by now, appended to `out`: of the target, and for as long
  // as it may turn out that its hues were given in other units, of those. For who has what matches found elsewhere.
  void colors_looked_for(std::size_t camera, std::vector<color::HsiRange>& out) const;
  // Where the outline was in this camera's frame of the last update(), and how it moves, appended to `out`; nothing
  // where none would be fitted. For who has the pixels elsewhere. Of one object (count: 1; observation: huetrack).
  void expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const;
  // How many frames of this camera told nothing of the target: they say what matches other colours (Frame::matches).
  std::uint64_t frames_of_other_colors(std::size_t camera) const;

  // What a camera is going to deliver, where that is known beforehand: makes its colour table now, which otherwise
  // holds the first set up for some 5 ms.
  void expect(int camera, capture::PixelFormat format, capture::ColorRange range);

  // From the next update() on: per camera of the rig what is held of its calibration; fewer entries: the remaining
  // cameras are as the rig says. Replaces what was said before. The target is not searched anew, and what its views'
  // contradictions have told of a camera is forgotten where its pose becomes another one. observation: paper takes
  // is_used and the pose, and knows no covariance. throws std::invalid_argument: a value is not finite.
  void trust(std::span<const CameraTrust> cameras);

  // set.frames has one slot per camera of the rig; a frame whose size is not the rig's is not used (the caller checks
  // sizes at start). Sets come in time order.
  // Of a target with a count of 1.
  ObjectEstimate update(const capture::FrameSet& set);
  // Of any target, one estimate or more: of a count of 1 that of the object; of a larger one those of all objects that
  // are known, by ascending numbers, and of those that have just ended; where there are none, one of the target itself.
  void update(const capture::FrameSet& set, std::vector<ObjectEstimate>& out);

  // The particles after the last update, world frame, metres: for pictures and previews. about: every how many-th, so
  // that there are at least so many of them, but fewer than twice that; 0: all.
  std::vector<Eigen::Vector3f> particles(std::size_t about = 0) const;

  SearchFindings search_findings() const;
  OutlineFindings outline_findings() const;

  // What the last update() looked at: nothing of views in which the target is neither expected nor searched. Of several
  // objects one stands for all, where it is apart from the others. Valid until the next update(). observation:
  // huetrack.
  std::span<const SeenRegion> regions() const;
  std::vector<ColorShare> color_shares() const;  // per camera of the rig; observation: huetrack

  // Where something is that would be one object more than the target's count, seen for more than a second: another one,
  // or something that looks like one. World frame, metres; nullopt: there is none, or, of a count of 1, the room has
  // the colour anyway. observation: huetrack.
  std::optional<Eigen::Vector3d> further_object() const;

  // Per camera of the rig: how the object's colour lies in the range that is looked for (color_watch.h). color_news()
  // counts what there is to tell of it.
  std::vector<ColorHealth> color_health() const;
  std::uint64_t color_news() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// ObjectTracker::colors_looked_for() of one that has just been made.
std::vector<color::HsiRange> first_colors_looked_for(const TargetOptions& target, const ObjectTrackerOptions& options,
                                                     std::string_view camera);

}  // namespace huetrack::object_tracking
