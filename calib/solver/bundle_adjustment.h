// Bundle adjustment of cameras, lenses and board poses: least squares over reprojection errors (Ceres), outlier
// rejection, covariance. Model: design.md. Deterministic: one thread, independent of the order of the views.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/model/camera_rig.h"
#include "calib/solver/calibration_error.h"
#include "calib/solver/lens.h"

namespace huetrack::solver {

// One board in one image.
struct BoardView {
  int camera = 0;                   // index into the cameras
  int set = 0;                      // >= 0; views of one moment share the board pose
  std::string image;                // for messages: "left07.jpg", "cam0 at 3.20 s"
  std::vector<int> ids;             // ascending; of Board::point()
  std::vector<Eigen::Vector2d> px;  // raw pixels, one per id
  // Stamp without jitter, on a clock common to all cameras. nullopt: none (a still).
  std::optional<double> stamp_s{};
  double blur_px{};  // standard deviation of the edges' blur, median over the corners; 0: not known
};

// An estimated time and its prior.
struct AdjustedTime {
  double value_s = 0;
  double prior_s = 0, prior_sigma_s = 0;  // sigma 0: held
  double sigma_s = 0;                     // result: posterior standard deviation
};

// Prior of a free lens.
struct LensPrior {
  LensParameters mean = LensParameters::Zero();
  Eigen::MatrixXd information;  // the inverse of its covariance, parameter_count() square
};

struct AdjustedCamera {
  std::string name;
  calib::ImageSize image_size;
  LensModel lens = LensModel::radtan5;
  LensParameters parameters = LensParameters::Zero();
  calib::Rigid3d cam_from_world;
  bool lens_is_free = true;  // otherwise the intrinsics are held
  // Covariance of held intrinsics, parameter_count() square; empty: exact. It is propagated into the result's.
  Eigen::MatrixXd lens_covariance;
  // Of free intrinsics that were given. nullopt: as lenses of webcams and action cameras are (calib::usual_lens).
  std::optional<LensPrior> lens_prior;
  // Standard deviation of its corners over Adjustment::noise_px. Set by adjust(); 1 unless clearly noisier than most
  // cameras (out of focus).
  double relative_noise = 1;
  // > 0: penalises a lens that folds (distorted radius not growing) out to the image's corners, where coefficients may
  // be undetermined. Residual in pixels per unit of missing slope.
  double unfold = 0;
  bool pose_is_free = true;  // at least one camera's is held
  // As in calib::CameraTiming; estimated where a board moves. A common offset of all latencies is not observable: at
  // least one camera's is held.
  AdjustedTime latency, readout;
  // Standard deviation of its stamps' errors, estimated where a board moves. 0: not yet known.
  double stamp_sigma_s = 0;
  calib::CameraTiming timing;  // as given; rig_of() keeps it where nothing better was estimated

  calib::CameraModel model() const { return camera_model(lens, parameters); }
};

// Motion of a board around the moment of its set, constant acceleration: at tau, its point p is at R(turn) p + shift in
// the board's frame at tau = 0, (turn, shift) = tau course.col(0) + tau^2 / 2 course.col(1).
struct BoardMotion {
  using Course = Eigen::Matrix<double, 6, 2>;  // rotation (rad) and translation (m): per s, and per s^2
  bool is_known = false;                       // otherwise the board is taken to rest during the set
  double at_s = 0;                             // tau = 0, on the clock of the stamps less latency
  Course course = Course::Zero();              // estimated
  // Prior from neighbouring sets: mean, and information of each of the six axes. Constant during a solution: relative
  // motion is compared, since a change of lens or camera moves the boards of all sets alike.
  Course expected = Course::Zero();
  std::array<Eigen::Matrix2d, 6> information{};
};

// Hyperparameters of the motion prior: rms second and third derivative of rotation (rad) and position (m), per axis.
struct BoardMotionPrior {
  std::array<double, 2> change{}, jerk{};  // per s^2, per s^3; 0: not yet known
};

// A view that contradicts the others: median lengths of residuals.
struct ViewMisfit {
  double own_px = 0;
  double others_px = 0;  // of the views that were not dropped
};

struct ViewFit {
  std::vector<Eigen::Vector2d> residuals;  // measured minus projected, pixels, one per id
  std::vector<bool> used;                  // one per id; false: outlier
  double rms_px = 0;                       // length of the residuals, over all corners of the view
  double speed_px_s = 0;                   // median of its corners; 0: at rest, or not known
  std::optional<ViewMisfit> dropped;       // the whole view is an outlier
};

// Deviation of a board from its file: bend along x and along y (parabola, height of the middle, metres), and relative
// excess of its x scale over its y scale, their mean being right.
using BoardWarp = Eigen::Vector3d;

// Input of adjust(): initial values. Output: the estimate.
struct Adjustment {
  board::Board board;
  std::vector<AdjustedCamera> cameras;
  std::vector<BoardView> views;                  // sorted by set, camera, image
  std::vector<calib::Rigid3d> world_from_board;  // per set; only of sets with views
  BoardWarp warp = BoardWarp::Zero();
  bool warp_is_free = false;
  // Per set. Input: empty: boards rest; otherwise one per set, estimated where views have stamps and sets are close in
  // time, and each corner counts at the exposure time of its row.
  std::vector<BoardMotion> motions;
  BoardMotionPrior motion_prior;
  double stamp_sigma_s = 0;           // of all cameras (rms of AdjustedCamera::stamp_sigma_s)
  std::vector<double> stamp_error_s;  // per view, added to its stamp; empty without motions

  // Results.
  std::vector<ViewFit> fits;  // per view
  double noise_px = 0;        // standard deviation of a corner per axis, estimated from the residuals
  double rms_px = 0;          // length of the residuals of all used corners
  int corners_used = 0;
  // Of all camera parameters that are not exact, camera by camera: lens (parameter_count()), then pose (rotation,
  // translation in the camera's frame: cam_from_world_true = exp(error) * cam_from_world); where boards move, followed
  // by each camera's latency and readout. Scaled by the noise; widened where the scatter between sets shows that errors
  // within a set are correlated.
  Eigen::MatrixXd covariance;
  std::vector<int> lens_offset;  // into covariance, per camera; -1: not in it
  std::vector<int> pose_offset;
  std::vector<int> time_offset;              // of its latency and readout
  BoardWarp warp_sigma = BoardWarp::Zero();  // of a free warp

  bool moves(int set) const { return !motions.empty() && motions[static_cast<std::size_t>(set)].is_known; }
  Eigen::Vector3d board_point(int id) const;         // with the warp, board frame
  Eigen::Vector3d centre_sigma(int camera) const;    // std. dev. of the camera's position, its own axes, metres
  Eigen::Vector3d rotation_sigma(int camera) const;  // about its own axes, radians
  LensParameters lens_sigma(int camera) const;       // 0 where exactly known
  double rms_of_camera(int camera) const;            // used corners, pixels
  int views_used(int camera) const;
};

struct AdjustmentOptions {
  // Outliers: residuals above this many (robust) standard deviations and above least_outlier_px.
  double outlier_sigmas = 5;
  double least_outlier_px = 0.5;
  bool find_outliers = true;  // false: all corners count
  int max_iterations = 100;   // >= 1, of each solution
  bool with_covariance = true;
};

// throws CalibrationError: no corner left to use, or numerically singular.
Adjustment adjust(Adjustment start, const AdjustmentOptions& options = {});

// The views that were not dropped, with their used corners.
std::vector<BoardView> inliers(const Adjustment& adjustment);
// Their Adjustment::stamp_error_s.
std::vector<double> stamp_errors_of_inliers(const Adjustment& adjustment);

// Residuals of all corners at `state`; nothing is estimated.
std::vector<ViewFit> evaluate(const Adjustment& state);

// Candidate poses of a board from one view, best first: one, or two where the planar ambiguity is not resolved. Empty:
// not enough corners.
struct BoardPose {
  calib::Rigid3d cam_from_board;
  double rms_px = 0;
};
std::vector<BoardPose> board_poses(const board::Board& board, const BoardView& view, LensModel lens,
                                   const LensParameters& parameters);

}  // namespace huetrack::solver
