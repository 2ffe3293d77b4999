// Joint least squares of camera poses, camera timing and the ball's path. Model: design.md. Private to this module.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/model/lens_derivatives.h"
#include "calib/wave/ball_path.h"

namespace huetrack::wave {

// The ball's outline in one frame.
struct BallObservation {
  int camera = 0;
  double t_s = 0;              // the frame's stamp
  Eigen::Vector2d px;          // centre of the outline, raw pixels
  Eigen::Matrix2d covariance;  // px^2
};

// See calib::CameraTiming.
struct CameraTime {
  double latency_s = 0, readout_s = 0;
};

struct TimePrior {
  CameraTime time;
  double latency_sigma_s = 0.05;  // > 0; relative to the time reference
  double readout_sigma_s = 0.03;  // > 0
};

// -1/2..1/2 from the top row to the bottom row.
double below_middle(const calib::Camera& camera, const Eigen::Vector2d& px);

// A lens less the given one: log of the focal length (of both axes), principal point (px), and the first four
// distortion coefficients: k1 k2 p1 p2, of a fisheye k1 k2 k3 k4.
constexpr int lens_freedom = 7;
using LensChange = Eigen::Matrix<double, lens_freedom, 1>;
calib::LensParameters changed(calib::LensParameters lens, const LensChange& change);
calib::CameraModel changed(const calib::CameraModel& lens, const LensChange& change);
// Derivative of a pixel by the change, of that by the changed lens's parameters.
Eigen::Matrix<double, 2, lens_freedom> by_change(const calib::PixelByLens& by_lens, const calib::LensParameters& lens);

struct WaveState {
  std::vector<calib::Rigid3d> cam_from_world;
  BallPath path;                   // in true time
  std::vector<CameraTime> times;   // per camera; empty: global shutters without latency
  std::vector<LensChange> lenses;  // per camera; empty: the rig's lenses

  // Exposure time of the row of this pixel: stamp - latency + below_middle * readout.
  double exposed_s(const calib::CameraRig& rig, int camera, double stamp_s, const Eigen::Vector2d& px) const;
  calib::CameraModel lens(const calib::CameraRig& rig, std::size_t camera) const;
};

// Correlation of one camera's outline errors over time, as shares of their variance; the rest is white.
// Experiment: outlines of rendered waves against truth; calib/wave/EXPERIMENTS.md.
struct OutlineCorrelation {
  double constant_share = 0.15;  // the same in all frames: light from one side
  double slow_share = 0.4;       // decays exponentially: light and background change with the ball's place
  double slow_s = 0.6;           // > 0; time constant of the decay

  // Variance of the mean of many frames, this long apart, over that of independent ones. Without the constant share,
  // which turns the camera.
  double frames_as_one(double frame_s) const;
};

// Covariance of gain^T e, for outline errors e of unit variance, correlated within each camera. gain: two rows per
// observation.
Eigen::MatrixXd propagated(const Eigen::MatrixXd& gain, const std::vector<BallObservation>& observations,
                           std::size_t cameras, const OutlineCorrelation& correlation);

// Of a readout: the rig's, or what cameras have. Normal, without a robust loss.
struct ReadoutPrior {
  double mean_s = 0, sigma_s = 0.03;  // sigma_s > 0
  double weight = 1;                  // how often it counts, see WaveAdjustmentOptions::frames_as_one
};

struct WaveAdjustmentOptions {
  double radius_m = 0.04;  // of the ball: an outline's centre is not the centre's projection
  double loss = 3;         // > 0; Cauchy's, in standard deviations
  double jerk_m_s3 = 60;   // > 0; rms jerk of the ball at 30 knots per second
  bool with_evidence = false;
  int reference = 0;                         // this camera's pose is held
  int scale_a = 0, scale_b = 1;              // the distance of these two cameras is held
  bool hold_poses = false;                   // all poses are held: only times and path are estimated
  std::vector<TimePrior> times{};            // per camera; empty: times are held
  std::vector<ReadoutPrior> any_readouts{};  // per camera; empty: none
  int time_reference = 0;                    // its latency is held: a shift of all times is not observable
  // Per camera, 1 sigma of a lens's change: what lenses are (empty: they are held), and how sure the given one is
  // (empty: a guess). The second has a loss: a lens that the ball contradicts gives way.
  std::vector<LensChange> any_lens_sigmas{}, given_lens_sigmas{};
  // Per camera, OutlineCorrelation::frames_as_one(): the priors of lenses weigh so much more, as outlines count as
  // independent.
  std::vector<double> frames_as_one{};
  int max_iterations = 50;
  bool with_covariance = false;
  OutlineCorrelation correlation{};  // assumed by the covariance
  // Assumed by the covariance, per camera: rms error of its stamps beyond the model, independent from second to second.
  // Empty: none.
  std::vector<double> wander_s{};
};

struct WaveFit {
  std::vector<Eigen::Vector2d> residuals;  // per observation: measured minus predicted, px
  std::vector<double> distance2;           // per observation: squared Mahalanobis distance
  double cost = 0;                         // of the whole problem, with the loss
  // Log marginal likelihood of the jerk (Laplace approximation, up to a constant). with_evidence only.
  double evidence = 0;
  // Errors (true less found) of each camera's centre (metres) and rotation (radians), world axes, and after those of
  // all cameras each lens's LensChange: (6 + lens_freedom) x cameras square. In the gauge of `reference` and scale_a,
  // scale_b. The solution takes outline errors as white; the covariance accounts for their correlation.
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd time_covariance;  // of each camera's latency and readout, seconds; 2 x cameras square
};

// Variance of whitened residuals, two for each squared distance, weighted by Cauchy's loss (of this scale, in standard
// deviations); at least 1.
double noise_variance(const std::vector<double>& distance2, double loss);

// Of the priors of these lenses.
double lens_cost(const WaveAdjustmentOptions& options, const std::vector<LensChange>& lenses);

// Moves `state` to the minimum. Deterministic.
// throws CalibrationError: it does not converge, or path or poses (undetermined_poses) are not determined.
WaveFit adjust_wave(const calib::CameraRig& rig, const std::vector<BallObservation>& observations, WaveState& state,
                    const WaveAdjustmentOptions& options);

// Centre of the outline of a ball, raw pixels; nullopt: behind the camera, or outside the lens model.
std::optional<Eigen::Vector2d> outline_centre(const calib::CameraModel& model, const Eigen::Vector3d& p_cam,
                                              double radius_m);

}  // namespace huetrack::wave
