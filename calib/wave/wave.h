// Calibrates camera poses, timing and lenses from a coloured ball that was waved through the volume; no board. Joint
// adjustment of poses, lenses, latencies, readouts and the ball's smooth path; each outline counts at the exposure
// time of its row, so that cameras need neither synchronisation nor a global shutter. Latencies are relative to the
// first camera's, which is held: a shift of all times is not observable. Model: design.md.
#pragma once

#include <Eigen/Core>
#include <algorithm>
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

// Rows are read before the next frame comes. frame_s: 0: unknown.
constexpr bool is_possible_readout(double readout_s, double frame_s) {
  constexpr double unsure_s = 0.003;  // error of a good wave
  return frame_s <= 0 || (readout_s <= frame_s + unsure_s && -readout_s <= frame_s + unsure_s);
}

// Known position of the ball's centre at one moment.
struct BallMark {
  double t_s = 0;           // first camera's BallFrame::t_s, less its latency
  Eigen::Vector3d p_world;  // metres
};

struct WaveOptions {
  double radius_m = 0.04;       // > 0; of the ball
  bool guessed_radius = false;  // radius_m is only roughly right, to a factor of two: the scale shows it
  double pixel_noise_px = 0.1;  // > 0; of an outline's centre; 0.02 of its radius is added
  bool has_poses = true;        // the rig's poses are roughly right; otherwise they are not used
  bool hold_poses = false;      // the rig's poses are exact: only the timing is estimated
  bool guessed_lenses = false;  // the rig's lenses are guesses; otherwise a lens is kept unless the ball contradicts it
  // Sources of the scale, weighed together with free flights of the ball (where there are some) and its radius (10 %).
  // Without any of these three the rig's poses count, too.
  std::optional<CameraDistance> camera_distance{};
  std::optional<double> rest_distance_m{};   // > 0; between the two places where the ball rested longest
  std::vector<BallMark> marks{};             // two: scale; three or more, not collinear: the world frame, too
  std::optional<double> g_m_s2{};            // > 0; gravity; nullopt: by the latitude
  std::optional<double> latitude_deg{};      // nullopt: anywhere, 0.15 %
  std::optional<double> ball_kg{};           // > 0; mass of the ball; nullopt: its flights show the drag
  bool floor = false;                        // the ball rested on the floor, which is z = 0
  std::optional<solver::WorldBox> volume{};  // where positions are wanted: their expected error is computed for it
  solver::Progress progress{};

  std::vector<std::string> problems(
      const calib::CameraRig& rig) const;  // empty when valid; one sentence per violated constraint
};

struct WaveCamera {
  int frames = 0;       // all
  double frame_s = 0;   // median interval
  int seen = 0;         // frames with a region of the colour that moves
  int used = 0;         // of these, consistent with the other cameras
  double rms_px = 0;    // of those, length
  double coverage = 0;  // 0..1; share of an 8x6 grid over the image in which the ball was
  // Share of those whose outline is narrower or wider than a whole ball's: something hides a part (a hand).
  double partly_seen = 0;
  static constexpr double much_partly = 0.2;  // of partly_seen: a hand holds the ball
  bool has_static_clutter = false;            // of the target's colour; it is ignored
  // Timing beyond the model: rms lag from second to second (with what poses and path absorbed of it), and its
  // significance (1: noise alone); rms lag from frame to frame; share of fast frames that repeat the one before.
  double wander_s = 0, wander_sigmas = 0, scatter_s = 0, repeated = 0;
  // In the world aligned with the volume (without one: with the path), world axes.
  Eigen::Vector3d centre_sigma_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation_sigma_rad = Eigen::Vector3d::Zero();
  double moved_m = 0, turned_rad = 0;  // from the rig's pose; with has_poses only
  // The estimated lens compared with the given one: relative difference of the focal length with its sigma, and rms
  // distance of the pixels over the image.
  double longer = 0, longer_sigma = 0, lens_px = 0;
};

struct WavePair {
  int a = 0, b = 0;
  int shared = 0;  // frames of a at whose time b saw the ball too
};

struct ScaleSource {
  enum class Kind { camera_distance, rest_distance, marks, throws, rig_poses, ball_size };
  Kind kind = Kind::rig_poses;
  int a = 0, b = 0;       // camera_distance: the cameras
  std::size_t count = 0;  // of marks or flights
  double measured_m = 0;  // the measured distance, of marks the longest; 0: none
  double ratio = 1;       // its scale over the one that was taken
  double sigma = 0;       // relative, with what poses and lenses add
  double weight = 0;      // of all sources: 1
};

struct WaveScale {
  std::vector<ScaleSource> sources;  // the one with most weight first; with hold_poses none
  double sigma = 0;                  // relative
  bool is_measured() const {         // by more than the ball's size and the rig's own poses
    return std::ranges::any_of(sources, [](const ScaleSource& s) { return s.kind < ScaleSource::Kind::rig_poses; });
  }
  // Of a measured one: the scale over that of the rig's own poses, and the relative uncertainty of those. 1 and 0: the
  // rig had none.
  double over_rig = 1, rig_sigma = 0;
};

// What the throws say of the vertical.
struct WaveVertical {
  double tilt_rad = 0;   // of the world's z axis; 0: it is from the throws
  double sigma_rad = 0;  // of the vertical, rms
  std::size_t flights = 0;
};

// Facts; calib/report/wave_report.h judges them.
struct WaveResult {
  // Least length, and least width and thickness, of the path over the distance of the cameras: below, poses are not
  // determined.
  static constexpr double least_length = 0.1, least_extent = 0.02;

  calib::CameraRig rig;             // with poses, timing and uncertainty; with hold_poses its uncertainty is as given
  std::vector<WaveCamera> cameras;  // per camera of the rig
  std::vector<WavePair> pairs;      // all
  double radius_m = 0;              // as given; a guessed one as the scale shows it
  bool guessed_radius = false;      // see WaveOptions
  bool held_poses = false;          // see WaveOptions; scale and errors of positions are 0 then
  bool had_poses = false;           // WaveOptions::has_poses
  bool guessed_lenses = false;      // see WaveOptions
  bool rejected_rig_poses = false;  // the rig's poses did not fit, and were found from nothing
  double rms_px = 0;                // of all used regions, length
  // Expected rms error of positions, by the poses' covariance, along the path and in the volume; and the part that the
  // scale's uncertainty adds.
  double expected_m = 0, by_scale_m = 0;
  std::optional<double> expected_in_volume_m;  // nullopt: no volume was given, or no two cameras see any of it
  double by_scale_in_volume_m = 0;
  double halves_m = 0;        // rms difference of positions along the path between the two halves of the recording
  double halves_sigma_m = 0;  // as their covariances predict it
  WaveScale scale;
  std::optional<WaveVertical> vertical;  // nullopt: the ball never flew
  double size_ratio = 1;                 // apparent over given radius
  std::optional<double> marks_error_m;   // largest residual of three or more marks; nullopt: no such marks
  double jerk_m_s3 = 0;                  // of the waving, estimated
  double duration_s = 0;
  Eigen::Vector3d extent_m = Eigen::Vector3d::Zero();  // of the path, along its principal axes, descending
  Eigen::Vector3d path_min = Eigen::Vector3d::Zero(), path_max = Eigen::Vector3d::Zero();  // in the rig's world, metres
  double camera_distance_m = 0;  // mean distance of the cameras from the path's middle

  bool is_in_a_plane() const { return extent_m.z() < least_extent * camera_distance_m; }
};

// The path lies in a plane: an error without initial poses, otherwise a doubt.
solver::Reason motion_in_a_plane(const Eigen::Vector3d& extent_m);

// frames: in any order; several per camera. Deterministic. throws std::invalid_argument: options.problems();
// CalibrationError: not possible, with the cause (camera, pair, fault).
WaveResult calibrate_wave(const calib::CameraRig& rig, std::vector<BallFrame> frames, const WaveOptions& options);

}  // namespace huetrack::wave
