// Camera poses and times from a coloured ball that was waved through the volume: no board.
// Joint adjustment of all poses, of each camera's latency and readout and of the ball's smooth path, every outline at
// the time at which its row was exposed, so that cameras need not run in step, nor have a global shutter. Latencies are
// told against the first camera's, which stays: a shift of all times cannot be seen.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/solver/calibration_error.h"
#include "calib/solver/progress.h"
#include "calib/solver/volume_accuracy.h"
#include "calib/wave/ball_finder.h"

namespace huetrack::wave {

struct CameraDistance {
  int a = 0, b = 0;   // two cameras of the rig
  double metres = 0;  // > 0, between their centres (about: the lenses)
};

// The ball's centre was here at this moment.
struct BallMark {
  double t_s = 0;           // on the clock of BallFrame::t_s of the first camera, less its latency
  Eigen::Vector3d p_world;  // metres
};

struct WaveOptions {
  double radius_m = 0.04;       // > 0; of the ball
  double pixel_noise_px = 0.1;  // > 0; of an outline's centre, to which 0.02 of its radius is added
  bool has_poses = true;        // the rig's poses are roughly right; otherwise they are found from nothing
  bool hold_poses = false;      // they are right: only the times are found; nothing sets the scale then
  // What sets the scale, at most one of these; none: the rig's poses, or without them the ball's radius (rough).
  std::optional<CameraDistance> camera_distance{};
  std::optional<double> rest_distance_m{};   // > 0; between the two places where the ball rested longest
  std::vector<BallMark> marks{};             // two: scale; three or more, not in a line: the world's frame too
  std::optional<solver::WorldBox> volume{};  // where positions will be wanted: how good they are is told for it too
  solver::Progress progress{};

  std::vector<std::string> problems(
      const calib::CameraRig& rig) const;  // empty when valid; one sentence per violated constraint
};

struct WaveCamera {
  int frames = 0;                   // that were looked at
  double frame_s = 0;               // from one of them to the next, usually
  int seen = 0;                     // with a region of the colour that is not still
  int used = 0;                     // whose region agrees with the other cameras
  double rms_px = 0;                // of those, length
  double coverage = 0;              // 0..1; share of an 8x6 grid over the image in which the ball was
  bool has_static_clutter = false;  // of the target's colour, that stay where they are; they are left out
  // Times that are not as the model has them: rms by which its frames are early or late from second to second, also
  // where poses and path followed that, and how sure it is (1: noise alone); the same from frame to frame; and the
  // share of fast frames that are the one before once more.
  double wander_s = 0, wander_sigmas = 0, scatter_s = 0, repeated = 0;
  // In the world as it is aligned with the volume (without one: with the path), world axes.
  Eigen::Vector3d centre_sigma_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation_sigma_rad = Eigen::Vector3d::Zero();
  double moved_m = 0, turned_rad = 0;  // from the rig's pose; with has_poses only
};

struct WavePair {
  int a = 0, b = 0;
  int shared = 0;  // frames of a at whose time b saw the ball too
};

// What the scale rests on.
struct WaveScale {
  enum class Source { camera_distance, rest_distance, marks, rig_poses, ball_size };
  Source source = Source::rig_poses;
  int a = 0, b = 0;       // camera_distance: whose
  std::size_t marks = 0;  // marks: how many
  double measured_m = 0;  // the distance that was measured, of marks the longest; 0: none was
  double sigma = 0;       // relative
  // Of a measured one: how many times as large it makes all as the rig's own poses do, and how well those know, by how
  // far they are otherwise off; 1 and 0: there are none.
  double over_rig = 1, rig_sigma = 0;
};

// Figures only: what they are worth is said in calib/report/wave_report.h.
struct WaveResult {
  // The path's least length, width and thickness over the distance from the cameras: thinner, and it leaves cameras
  // free to turn around it, or hardly tells how they stand across it.
  static constexpr double least_length = 0.1, least_extent = 0.02;

  calib::CameraRig rig;             // with the poses and the times found; with hold_poses its uncertainty stays
  std::vector<WaveCamera> cameras;  // beside the rig's
  std::vector<WavePair> pairs;      // all
  double radius_m = 0;              // of the ball, as it was given
  bool held_poses = false;          // see WaveOptions; what is said of scale and positions is 0 then
  bool had_poses = false;           // the rig's were taken for a start,
  bool rejected_rig_poses = false;  // but were of no use
  double rms_px = 0;                // of all used regions, length
  // The rms error of positions along the path, and in the volume, that follows from the poses' covariance; and what the
  // scale's uncertainty adds to it.
  double expected_m = 0, by_scale_m = 0;
  std::optional<double> expected_in_volume_m;  // nullopt: no volume was given, or no two cameras see any of it
  double by_scale_in_volume_m = 0;
  double halves_m = 0;        // how far positions along the path differ between the two halves of the recording
  double halves_sigma_m = 0;  // and by how much they should, by their own covariance
  WaveScale scale;
  double size_ratio = 1;                // how large the ball looks over how large radius_m says
  std::optional<double> marks_error_m;  // the worst of three marks or more, which set the world; nullopt: they did not
  double jerk_m_s3 = 0;                 // how jerky the waving was (learnt)
  double duration_s = 0;
  Eigen::Vector3d extent_m = Eigen::Vector3d::Zero();  // of the path, along its principal axes, the longest first
  double camera_distance_m = 0;                        // mean distance of the cameras from the path's middle

  bool is_in_a_plane() const { return extent_m.z() < least_extent * camera_distance_m; }
};

// That the path is in a plane. Without poses it is an error, with them a doubt.
solver::Reason motion_in_a_plane(const Eigen::Vector3d& extent_m);

// frames: in any order; several per camera. throws std::invalid_argument: options.problems(); CalibrationError: it
// cannot be done, and why: which camera, which pair. Deterministic.
WaveResult calibrate_wave(const calib::CameraRig& rig, std::vector<BallFrame> frames, const WaveOptions& options);

}  // namespace huetrack::wave
