// Camera poses from a coloured ball that was waved through the volume: no board.
// Joint adjustment of all poses and of the ball's smooth path, every frame at its own capture time, so that cameras
// need not run in step.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
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
  double t_s = 0;           // on the clock of BallFrame::t_s
  Eigen::Vector3d p_world;  // metres
};

struct WaveOptions {
  double radius_m = 0.04;       // > 0; of the ball
  double pixel_noise_px = 0.1;  // > 0; of an outline's centre, to which 0.02 of its radius is added
  bool has_poses = true;        // the rig's poses are roughly right; otherwise they are found from nothing
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
  int frames = 0;       // that were looked at
  int seen = 0;         // with a region of the colour that is not still
  int used = 0;         // whose region agrees with the other cameras
  double rms_px = 0;    // of those, length
  double coverage = 0;  // 0..1; share of an 8x6 grid over the image in which the ball was
  // In the world as it is aligned with the volume (without one: with the path), world axes.
  Eigen::Vector3d centre_sigma_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation_sigma_rad = Eigen::Vector3d::Zero();
  double moved_m = 0, turned_rad = 0;  // from the rig's pose; with has_poses only
};

struct WavePair {
  int a = 0, b = 0;
  int shared = 0;  // frames of a at whose time b saw the ball too
};

struct WaveResult {
  calib::CameraRig rig;             // with the poses found, and made_by
  std::vector<WaveCamera> cameras;  // beside the rig's
  std::vector<WavePair> pairs;      // all
  double rms_px = 0;                // of all used regions, length
  // The rms error of positions along the path, and in the volume, that follows from the poses' covariance; and what the
  // scale's uncertainty adds to it.
  double expected_m = 0, by_scale_m = 0;
  std::optional<double> expected_in_volume_m;  // nullopt: no volume was given, or no two cameras see any of it
  double by_scale_in_volume_m = 0;
  double halves_m = 0;        // how far positions along the path differ between the two halves of the recording
  double halves_sigma_m = 0;  // and by how much they should, by their own covariance
  double scale_sigma = 0;     // relative
  std::string scale_from;     // "the distance between cam0 and cam1, 4.020 m"
  double size_ratio = 1;      // how large the ball looks over how large radius_m says
  double jerk_m_s3 = 0;       // how jerky the waving was (learnt)
  double duration_s = 0;
  Eigen::Vector3d extent_m = Eigen::Vector3d::Zero();  // of the path, along its principal axes
  std::vector<std::string> doubts;                     // why it may not be usable, each with what to do; empty: usable
  std::vector<std::string> notes;

  bool usable() const { return doubts.empty(); }
};

// frames: in any order; several per camera. throws std::invalid_argument: options.problems(); CalibrationError: it
// cannot be done, and why: which camera, which pair. Deterministic.
WaveResult calibrate_wave(const calib::CameraRig& rig, std::vector<BallFrame> frames, const WaveOptions& options);

}  // namespace huetrack::wave
