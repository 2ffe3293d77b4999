// The joint adjustment of camera poses and the ball's path to where the cameras saw it. Private to this module.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/wave/ball_path.h"

namespace huetrack::wave {

// The ball's outline in one frame.
struct BallObservation {
  int camera = 0;
  double t_s = 0;              // the frame's stamp
  Eigen::Vector2d px;          // centre of the outline, raw pixels
  Eigen::Matrix2d covariance;  // px^2
};

// When a camera's rows are exposed; see calib::CameraTiming.
struct CameraTime {
  double latency_s = 0, readout_s = 0;
};

// What is known of it beforehand.
struct TimePrior {
  CameraTime time;
  double latency_sigma_s = 0.05;  // > 0; against that of the camera whose latency stays
  double readout_sigma_s = 0.03;  // > 0
};

// -1/2..1/2 from the top row to the bottom one.
double below_middle(const calib::Camera& camera, const Eigen::Vector2d& px);

struct WaveState {
  std::vector<calib::Rigid3d> cam_from_world;
  BallPath path;                  // in true time, as far as it is known
  std::vector<CameraTime> times;  // beside the poses; empty: a global shutter, without latency

  // When the row of this pixel was exposed, of a frame that is stamped so.
  double exposed_s(const calib::CameraRig& rig, int camera, double stamp_s, const Eigen::Vector2d& px) const;
};

// How like one another the errors of a camera's outlines are: of their variance, one part is the same in all frames
// (the light comes from one side), one changes slowly (with what is behind the ball), and the rest is new in every
// frame. As measured against the truth of rendered sequences: see tests/benchmark/wave_figures.
struct OutlineCorrelation {
  double lasting = 0.2;
  double slow = 0.25;
  double slow_s = 0.4;  // > 0; in which the slow part falls to 1/e
};

struct WaveAdjustmentOptions {
  double radius_m = 0.04;  // of the ball: the centre of its outline is not its centre's projection
  double loss = 3;         // > 0; Cauchy's, in standard deviations
  double jerk_m_s3 = 60;   // > 0; usual jerk of the ball, at 30 knots a second: how smooth its path is
  bool with_evidence = false;
  int reference = 0;             // the camera that stays
  int scale_a = 0, scale_b = 1;  // the distance of these two cameras stays: nothing else holds the scale
  bool hold_poses = false;       // all stay: only times and path are found
  // In the cameras' order; empty: the times stay, too. The latency of `time_reference` stays in any case: a shift of
  // all times cannot be seen.
  std::vector<TimePrior> times{};
  int time_reference = 0;
  int max_iterations = 50;
  bool with_covariance = false;
  OutlineCorrelation correlation{};  // what the covariance assumes
  // What the covariance assumes, per camera: by how much its frames are early or late beyond what the model knows,
  // another way in every second; rms. Empty: not at all.
  std::vector<double> wander_s{};
};

struct WaveFit {
  std::vector<Eigen::Vector2d> residuals;  // measured minus predicted, px, beside the observations
  std::vector<double> distance2;           // squared, in standard deviations
  double cost = 0;                         // of the whole solution, with the loss
  // Log of how likely the observations are for this jerk, whatever the poses and the path are (Laplace's approximation,
  // but for a constant): the largest tells how jerky the waving was. with_evidence only.
  double evidence = 0;
  // Per camera (centre in metres, rotation in radians), both in world axes, so that the true camera stands at centre +
  // error; 6 x cameras square. For the state as it is held by `reference` and the scale's two cameras. The solution
  // takes the errors as independent; the covariance says what correlated ones do to it.
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd time_covariance;  // of each camera's latency and readout, seconds; 2 x cameras square
};

// throws CalibrationError when it is numerically hopeless. Deterministic.
WaveFit adjust_wave(const calib::CameraRig& rig, const std::vector<BallObservation>& observations, WaveState& state,
                    const WaveAdjustmentOptions& options);

// Where the centre of a ball's outline appears; nullopt: behind the camera, or outside the lens model.
std::optional<Eigen::Vector2d> outline_centre(const calib::CameraModel& model, const Eigen::Vector3d& p_cam,
                                              double radius_m);

}  // namespace huetrack::wave
